"""What the servos of a walking robot say before anything is fitted.

`Signs`: legs that hold, hang or are gone; only what is found becomes a candidate.
`Suspects`: joints and legs whose positions depart most.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bns.models.legs import joints_of
from bns.models.legs import names as legs_of
from bns.worlds.trial import Trial

TOLD = 0.1  # [rad] from its place that a joint has to be told, to be held; assumed
HELD = 0.15  # of that, by which a joint that is held moves mostly; assumed
MOSTLY = (0.1, 0.9)  # but for the time in which an impact shakes it; assumed
ASTRAY = 0.2  # [rad] off its goal (RMS) that a servo without power ends at least
STRAYING = 2.0  # times what the model foresees, likewise; assumed
MOST = 2  # joints of a leg that have to; the load may hold the third where it is told
UNLOADED = 0.3  # of what the model foresees: a leg's servos are off by less; assumed
LIGHTER = 0.5  # the same for a leg to be a candidate: that is no verdict; assumed
ALONE, ALIKE = 0.6, 0.3  # share of the worst leg: beyond it alone, below it all alike
NEARLY = 0.6  # of the worst leg's share: the second is suspected as well

Ends = Mapping[str, np.ndarray]
"""by joint, how far it is from its goal where each command ends [rad]"""


@dataclass(frozen=True)
class Signs:
    """Joints and legs that do not do as the model has it.

    Attributes:
        held: joints that keep their place although they are told others, and the place
            [rad]: they may be locked there.
        raised: legs of which all joints do.
        limp: legs most of whose servos end far from their goals.
        unloaded: legs whose servos end at their goals as if little hung on them.
        joints: all whose readings that explains.
    """

    held: Mapping[str, float] = field(default_factory=dict)
    raised: tuple[str, ...] = ()
    limp: tuple[str, ...] = ()
    unloaded: tuple[str, ...] = ()
    joints: frozenset[str] = frozenset()


def signs(
    trials: Sequence[Trial], predicted: Sequence[np.ndarray], names: Sequence[str]
) -> Signs:
    """What recordings show.

    Args:
        trials: recordings, the joints' positions after the pose.
        predicted: by the nominal model, in the same columns, ``(T, n_channels)`` each.
        names: of the joints, as the commands have them.
    """
    seen = _ends(names, [(t, t.observed) for t in trials])
    told = _ends(names, list(zip(trials, predicted, strict=True)))
    still = held(trials, names)

    by_leg = {leg: joints_of(leg, names) for leg in legs_of(names)}
    raised = [leg for leg, joints in by_leg.items() if still.keys() >= {*joints}]
    limp = [leg for leg, joints in by_leg.items() if _limp(joints, seen, told)]
    off = {leg: _loaded(joints, seen, told) for leg, joints in by_leg.items()}
    free = [leg for leg, share in off.items() if share < LIGHTER]
    gone = [leg for leg in free if off[leg] < UNLOADED]
    explained = {joint for leg in (*limp, *gone) for joint in by_leg[leg]}
    return Signs(
        still, tuple(raised), tuple(limp), tuple(free), frozenset(explained | {*still})
    )


def held(trials: Sequence[Trial], names: Sequence[str]) -> dict[str, float]:
    """Joints that keep their place although they are told others, see `Signs`."""
    found = {}
    for at, name in enumerate(names):
        seen = np.concatenate([trial.observed[:, 3 + at] for trial in trials])
        if not np.isfinite(seen).any():
            continue
        place = float(np.nanmedian(seen))
        told = np.concatenate([trial.commands.values[:, at] for trial in trials])
        away = float(np.abs(told - place).max(initial=0.0))
        if away > TOLD and np.ptp(np.nanquantile(seen, MOSTLY)) < HELD * away:
            found[name] = place
    return found


def _limp(joints: Sequence[str], seen: Ends, told: Ends) -> bool:
    """Whether most of a leg's servos end far from their goals."""
    astray = [
        _rms(seen[joint]) > max(ASTRAY, STRAYING * _rms(told[joint]))
        for joint in joints
    ]
    return sum(astray) >= MOST


def _loaded(joints: Sequence[str], seen: Ends, told: Ends) -> float:
    """How far a leg's servos end from their goals, over what is foreseen; NaN where
    nothing was seen."""
    own, model = (
        _rms(np.concatenate([off[j] for j in joints])) for off in (seen, told)
    )
    return own / model if model else np.nan


def _ends(names: Sequence[str], paths: Sequence[tuple[Trial, np.ndarray]]) -> Ends:
    """How far each joint is from its goal where commands end [rad], by name."""
    off = [
        path[trial.boundaries[1:], 3:] - trial.commands.values for trial, path in paths
    ]
    return dict(zip(names, np.vstack(off).T, strict=True))


def _rms(off: np.ndarray) -> float:
    """NaN where nothing was seen: then nothing is said."""
    known = off[np.isfinite(off)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan


@dataclass(frozen=True)
class Suspects:
    """Where the servos' positions depart most.

    Attributes:
        joints: names, the worst first.
        legs: names of legs, the worst first.
        all: whether effects on the servos of all legs are suspected as well.
    """

    joints: tuple[str, ...]
    legs: tuple[str, ...]
    all: bool


def shares(
    rests: Sequence[np.ndarray], names: Sequence[str], sigma: float
) -> dict[str, float]:
    """Share of each joint in the squared departure beyond the noise.

    Args:
        rests: recorded minus predicted positions of each trial, ``(T, J)`` [rad].
        names: of the joints.
        sigma: of the readings [rad].
    """
    square = np.nanmean(np.vstack(rests) ** 2, axis=0) - sigma**2
    square = np.maximum(square, 0.0) + 1e-3 * sigma**2
    return dict(zip(names, (square / square.sum()).tolist(), strict=True))


def suspects(
    rests: Sequence[np.ndarray], names: Sequence[str], sigma: float
) -> Suspects:
    """Joints and legs to be considered.

    Args:
        rests: recorded minus predicted positions of each trial, ``(T, J)`` [rad].
        names: of the joints.
        sigma: of the readings [rad].
    """
    share = shares(rests, names, sigma)
    by_leg = {
        leg: sum(value for name, value in share.items() if name.startswith(leg))
        for leg in legs_of(names)
    }
    legs = sorted(by_leg, key=by_leg.__getitem__, reverse=True)
    worst = by_leg[legs[0]]
    near = tuple(leg for leg in legs[:2] if by_leg[leg] >= NEARLY * worst)
    own = [name for name in share if name.startswith(near)]
    joints = sorted(own, key=share.__getitem__, reverse=True)
    return Suspects(tuple(joints) if worst > ALIKE else (), near, worst < ALONE)
