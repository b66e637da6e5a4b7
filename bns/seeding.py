"""Named random streams from one seed.

A stream is found by *what it is for*, not by the order in which streams are asked
for, so that adding one moves no other and a resumed run draws what an undisturbed
one draws.
"""

from hashlib import sha256

import numpy as np


def sequence(seed: int, *names: str | int) -> np.random.SeedSequence:
    """The seed sequence of the stream `names` under `seed`.

    Args:
        seed: master seed, a non-negative integer.
        names: the stream's identity, for example `("world", replicate, trial)`.
    """
    digest = sha256("|".join(str(name) for name in names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.SeedSequence(entropy=seed, spawn_key=key)


def generator(seed: int, *names: str | int) -> np.random.Generator:
    """A NumPy generator on the stream `names` under `seed`."""
    return np.random.default_rng(sequence(seed, *names))


def integer(seed: int, *names: str | int) -> int:
    """A 63-bit seed on the stream `names`, for generators of other libraries."""
    return int(
        sequence(seed, *names).generate_state(2, np.uint32).view(np.uint64)[0] >> 1
    )
