"""One bit of a stored file flipped: noticed, or without any effect on what is read."""

import logging
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bench.storage.readers import fingerprint, make, readers
from bns import seeding
from bns.errors import BnsError

FLIPS = 400


@bench(
    "single bits flipped in every kind of stored file: accepted with other content",
    bar="0 of 400 a kind",
)
def bit_flips(quick: bool) -> Result:
    """Flip, read, compare every number and word with what was read before."""
    count = 20 if quick else FLIPS
    logging.getLogger("bns").setLevel(logging.ERROR)
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        make(home)
        stored = [reader for reader in readers() if reader.stored]
        kinds = {reader.name: _flipped(reader, home, count) for reader in stored}
    wrong = sum(kind["other content"] + kind["tracebacks"] for kind in kinds.values())
    return Result(
        figure=wrong,
        unit="flips",
        holds=wrong == 0,
        n=count * len(kinds),
        details={"flips a kind": count, "kinds": kinds},
    )


def _flipped(reader, home: Path, count: int) -> dict[str, int]:
    """What comes of flips of one file."""
    path, found = home / reader.file, Counter()
    data, before = path.read_bytes(), fingerprint(reader.read(home))
    rng = seeding.generator(0, "bench", "bit-flips", reader.name)
    bits = rng.choice(8 * len(data), count, replace=8 * len(data) < count)
    for bit in np.asarray(bits):
        made = bytearray(data)
        made[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(made)
        try:
            same = fingerprint(reader.read(home)) == before
            found["same content" if same else "other content"] += 1
        except BnsError as error:
            found["refused" if "\n" not in str(error) else "tracebacks"] += 1
        except Exception:  # any other is a fault
            found["tracebacks"] += 1
    path.write_bytes(data)
    names = ("refused", "same content", "other content", "tracebacks")
    return {name: found[name] for name in names}
