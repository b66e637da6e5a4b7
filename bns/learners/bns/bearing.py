"""Which legs still bear a walking robot, told from its motion alone.

Two questions, after each trial. Has the robot changed: is what it did lately foretold
better by the model of its legs (`nominal`) with others of them lost, without anything
learned before, than by the present model with all that was learned? And, changed or
not: of which legs does the model foretell all that is remembered best?

What the model leaves is taken for a smooth function of the goals with noise, a Gaussian
process as in `change_detection`. For the first question its size is that of what the
present model left before, and the trial that says most does not count, so that one fall
is no change. For the second its size is as it may be under each account.

The numbers were chosen on ten sound runs of 100 trials and on their walks with legs
raised. Of twenty other sound runs a leg was taken for lost in 0.4 % of the trials.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from bns.experiment import robots
from bns.learners.bns.change_detection import (
    LARGEST,
    NEW,
    NOISE,
    ODDS,
    OLD,
    covariance,
    foretold,
)
from bns.learners.bns.nominal import FEET, NONE, Contacts, Lost, Nominal, moved

MOST = 4  # legs that may be lost
ACCOUNTS: tuple[Lost, ...] = tuple(
    frozenset(legs)
    for count in range(MOST + 1)
    for legs in combinations(range(FEET), count)
)
SHARES = np.array([0.9, 0.62, 0.97])  # of random commands, least squares
SMOOTH = 0.6  # of what the model leaves, the rest is noise; assumed
BLUR = 0.02  # mean square, scaled, that counts as none; assumed
RARE = 2.0  # nats that each lost leg has to bring; assumed
SURE = 1.0  # ... and besides for each trial that is remembered: a walk that is walked
# again and again errs alike each time; assumed
LEAST = 0.05  # mean square of what the model leaves, scaled, at least; assumed


class Account(NamedTuple):
    """What was found of a run.

    Attributes:
        lost: legs that bear nothing.
        newest: patterns since the robot changed; 0 = it did not.
    """

    lost: Lost
    newest: int = 0


class Bearing:
    """Runs that are asked, trial by trial, which legs they have lost.

    Args:
        nominal: the model of their legs, which goes on without lost ones.

    Raises:
        BnsError: a robot whose legs are not known.
    """

    def __init__(self, nominal: Nominal):
        self.nominal = nominal
        self._contacts = robots.contacts(nominal.robot)
        self._known: list[dict[bytes, np.ndarray]] = [{} for _ in nominal.lost]

    def ask(self, run: int, inputs: np.ndarray, targets: np.ndarray, size: int) -> int:
        """Ask a run, and tell its model, see `judged`.

        Args:
            run: which.
            inputs: scaled, of the patterns that it remembers, newest last, ``(N, 36)``.
            targets: scaled, ``(N, 3)``.
            size: patterns of a trial.

        Returns:
            patterns since the robot changed; 0 = it did not.
        """
        told, lost = self.told(run, inputs), self.nominal.lost[run]
        found = judged(inputs, targets, told, size, lost)
        self.nominal.without(run, found.lost)
        return found.newest

    def told(self, run: int, inputs: np.ndarray) -> np.ndarray:
        """As the function `told`, what was said of a run's patterns being kept.

        Args:
            run: whose patterns they are.
            inputs: scaled goals in force and next ones, ``(N, 36)``.

        Returns:
            scaled motion, ``(N, A, 3)``.
        """
        keys, known = [row.tobytes() for row in inputs], self._known[run]
        fresh = [number for number, key in enumerate(keys) if key not in known]
        if fresh:
            found = told(inputs[fresh], self._contacts)
            for number, rows in zip(fresh, found, strict=True):
                known[keys[number]] = rows
        self._known[run] = {key: known[key] for key in keys}
        return np.array([known[key] for key in keys])

    def numbers(self) -> np.ndarray:
        """Legs that each run takes for lost, their numbers as digits, ``(R,)``."""
        lost = [sorted(leg + 1 for leg in legs) for legs in self.nominal.lost]
        return np.array([float("".join(map(str, legs)) or 0) for legs in lost])


def told(inputs: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Motion by the model under each of `ACCOUNTS`, scaled, ``(N, A, 3)``.

    Args:
        inputs: scaled goals in force and next ones, ``(N, 36)``.
        contacts: see `moved`.
    """
    from bns.learners.bns.walking import GOAL, MOVED

    goals = inputs.astype(float) * GOAL
    before, after = np.split(goals, 2, axis=1)
    found = moved(before, after, contacts, ACCOUNTS).transpose(1, 0, 2)
    scaled: np.ndarray = found / np.array(MOVED)
    return scaled


def judged(
    inputs: np.ndarray,
    targets: np.ndarray,
    told: np.ndarray,
    size: int,
    lost: Lost = NONE,
) -> Account:
    """Which legs a robot has lost.

    Args:
        inputs: scaled, of the N patterns that are remembered, newest last, ``(N, I)``.
        targets: scaled, ``(N, 3)``.
        told: what the model says under each of `ACCOUNTS`, scaled, ``(N, A, 3)``.
        size: patterns of a trial.
        lost: the present account.
    """
    whole = len(inputs) // size * size
    if whole < NEW[0] * size:
        return Account(lost)
    rest = _rest(targets[-whole:], told[-whole:])
    like, known = _like(inputs[-whole:]), ACCOUNTS.index(lost)
    newest = _changed(like, rest, size, known)
    if newest:
        best = int(_said(like[-newest:, -newest:], rest[-newest:]).argmax())
        if best != known:
            return Account(ACCOUNTS[best], newest)
    said = _said(like, rest)
    best = int(said.argmax())
    sure = said[best] - said[known] > SURE * whole / size
    return Account(ACCOUNTS[best] if sure else lost)


def odds(inputs: np.ndarray, targets: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Log probability of patterns under each of `ACCOUNTS`, less what lost legs cost.

    Args:
        inputs: scaled, ``(N, I)``.
        targets: scaled, ``(N, 3)``.
        told: what the model says under each account, scaled, ``(N, A, 3)``.

    Returns:
        ``(A,)``.
    """
    return _said(_like(inputs), _rest(targets, told))


def _changed(like: np.ndarray, rest: np.ndarray, size: int, known: int) -> int:
    """Patterns since the robot changed; 0 = it did not."""
    wanted = [new * size for new in NEW if len(like) >= (OLD + new) * size]
    if not wanted:
        return 0
    scale = np.maximum((rest[: -wanted[-1], known] ** 2).mean(0), LEAST)
    together = foretold(like, rest[:, known], scale)
    legs = [RARE * len(ACCOUNTS[known] ^ account) for account in ACCOUNTS]
    found = []
    for some in wanted:
        alone = foretold(like[-some:, -some:], rest[-some:], scale)
        gain = (alone - together[-some:, None]).reshape(-1, size, len(ACCOUNTS)).sum(1)
        brings = gain.sum(0) - gain.max(0).clip(min=0.0) - legs
        found.append((float(brings.max()), some))
    most, newest = max(found)
    return newest if most > ODDS else 0


def _said(like: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Log probability of patterns under each account, its size the likeliest, less what
    its legs cost, ``(A,)``."""
    count, root = len(like), np.linalg.cholesky(like)
    fresh = np.linalg.solve(root, rest.reshape(count, -1)).reshape(rest.shape)
    said = -count / 2 * np.log((fresh**2).mean(0) + BLUR).sum(-1)
    found: np.ndarray = said - [RARE * len(account) for account in ACCOUNTS]
    return found


def _rest(targets: np.ndarray, told: np.ndarray) -> np.ndarray:
    """What the model leaves under each account, ``(N, A, 3)``."""
    found: np.ndarray = targets[:, None].clip(-LARGEST, LARGEST) - SHARES * told
    return found


def _like(inputs: np.ndarray) -> np.ndarray:
    """Covariance of what the model leaves, its mean square being 1, ``(N, N)``."""
    noise = np.eye(len(inputs))
    smooth: np.ndarray = covariance(inputs.astype(float)) - 1.0 - NOISE * noise
    return SMOOTH * smooth + (1.0 - SMOOTH) * noise
