"""Diagnosis of odometry: what is wrong, what is tied, and which drive would tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError
from bns.gap.models.odometry import fit
from bns.gap.models.odometry.fit import CANDIDATES, Motions, Noise, OdometryFit
from bns.gap.records import Verdict

LARGEST = 3  # candidates together at most
TIE = 9.0  # difference of costs up to which two supports are tied: three deviations
BLOCK = 50  # intervals held out together
SENSOR = np.array([0.005, 0.005, 0.01])
"""deviation of a pose measured before and after a whole drive [m, m, rad]; assumed"""

DRIVES: Mapping[str, tuple[float, float]] = {
    "turn in place, ten turns": (-2.777, 2.777),
    "long straight drive, 2 m": (2.0, 2.0),
    "arc of 1 m radius, half a turn": (3.003, 3.281),
    "short straight drive, 0.1 m": (0.1, 0.1),
    "turn about the left wheel, one turn": (0.0, 0.555),
}
"""way of the left and right wheel [m] of drives that a small robot does safely"""


@dataclass(frozen=True, eq=False)
class OdometryDiagnosis:
    """What is wrong with odometry.

    Attributes:
        verdict: supports of candidates, tied ones together.
        fits: of every support that the verdict names, and of nothing, by support.
        gain: how much the best support lowers the held-out cost, and its standard
            error over blocks.
        noise: of the motions.
        plan: drives by how well they would tell the first two tied supports apart, in
            deviations, best first; empty where nothing is tied.
    """

    verdict: Verdict
    fits: Mapping[tuple[str, ...], OdometryFit]
    gain: tuple[float, float]
    noise: Noise
    plan: tuple[tuple[str, float], ...]


def diagnose(
    motions: Motions, *, length_bias: float = fit.LENGTH_BIAS
) -> OdometryDiagnosis:
    """Forward selection on held-out blocks, then exchanges that leave it as good.

    Args:
        motions: many short intervals.
        length_bias: common error of the sensor's lengths per interval [m].

    Raises:
        BnsError: too few intervals to hold any out.
    """
    if len(motions) < 4 * BLOCK:
        raise BnsError(
            f"{len(motions)} intervals are too few to hold some out; {4 * BLOCK} are "
            "needed."
        )
    noise = fit.noise_of(motions, length_bias=length_bias)
    chosen, gain = _select(motions, noise)
    tied = _tied(motions, noise, chosen) if chosen else [()]
    fits = {names: fit.fit(motions, names, noise) for names in {(), *tied}}
    plan = _plan(motions, fits[tied[0]], fits[tied[1]]) if len(tied) > 1 else ()
    verdict = _verdict(tied, fits, gain, plan)
    return OdometryDiagnosis(verdict, fits, gain, noise, plan)


def _select(motions: Motions, noise: Noise) -> tuple[tuple[str, ...], tuple]:
    """Candidates that lower the held-out cost by more than two standard errors."""
    chosen: tuple[str, ...] = ()
    nothing = before = _held_out(motions, chosen, noise)
    for _ in range(LARGEST):
        tries = {
            name: _held_out(motions, (*chosen, name), noise) for name in _free(chosen)
        }
        if not tries:
            break
        best = min(tries, key=lambda name: tries[name].sum())
        better, error = _sum(before - tries[best])
        if better < max(2 * error, TIE):
            break
        chosen, before = (*chosen, best), tries[best]
    return chosen, _sum(nothing - before)


def _free(chosen: Sequence[str]) -> list[str]:
    """Candidates that move a number which no chosen one moves."""
    moved = {number for name in chosen for number in CANDIDATES[name]}
    return [
        name
        for name, numbers in CANDIDATES.items()
        if name not in chosen and not set(numbers) <= moved
    ]


def _held_out(motions: Motions, names: Sequence[str], noise: Noise) -> np.ndarray:
    """Cost of each block under a fit to the blocks of the other parity."""
    block = np.arange(len(motions)) // BLOCK
    costs = np.zeros(block[-1] + 1)
    for parity in (0, 1):
        fitted = fit.fit(motions.take(block % 2 != parity), names, noise)
        for number in range(parity, len(costs), 2):
            part = motions.take(block == number)
            costs[number] = fit.cost(part, fitted.magnitudes, noise)
    return costs


def _sum(gains: np.ndarray) -> tuple[float, float]:
    return float(gains.sum()), float(gains.std(ddof=1) * np.sqrt(len(gains)))


def _tied(
    motions: Motions, noise: Noise, chosen: tuple[str, ...]
) -> list[tuple[str, ...]]:
    """The support and those with one candidate exchanged that cost no more, by cost."""
    supports = {tuple(sorted(item)) for item in (chosen, *_exchanges(chosen))}
    costs = {item: fit.fit(motions, item, noise).cost for item in supports}
    ranked = sorted(costs, key=costs.__getitem__)
    return [item for item in ranked if costs[item] <= costs[ranked[0]] + TIE]


def _exchanges(chosen: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    for at in range(len(chosen)):
        rest = chosen[:at] + chosen[at + 1 :]
        for name in _free(rest):
            yield (*rest, name)


def _plan(
    motions: Motions, one: OdometryFit, other: OdometryFit
) -> tuple[tuple[str, float], ...]:
    """How far the poses after each drive lie apart under two explanations."""
    separations = {}
    for name, (left, right) in DRIVES.items():
        whole = Motions(
            np.array([left]), np.array([right]), np.zeros((1, 3)), motions.axle
        )
        first = whole.predict(fit.changed(one.magnitudes))[0]
        second = whole.predict(fit.changed(other.magnitudes))[0]
        separations[name] = float(np.linalg.norm((first - second) / SENSOR))
    return tuple(sorted(separations.items(), key=lambda item: -item[1]))


def _verdict(tied, fits, gain, plan) -> Verdict:
    best = tied[0]
    kind = (
        "no gap"
        if not best
        else "either"
        if len(tied) > 1
        else "effect"
        if len(best) == 1
        else "together"
    )
    differing = _differing(tied)
    angle = _angle(fits[tied[0]], fits[tied[1]]) if len(tied) > 1 else float("nan")
    said = " and ".join(_text(name, fits[best].magnitudes[name]) for name in best)
    text = {
        "no gap": "Nothing that was tried lowers the error of motions held out.",
        "effect": f"{said} explains the motions.",
        "together": f"{said} explain the motions together.",
        "either": f"{said}; but {' or '.join(differing)}: these drives can not tell.",
    }[kind]
    from scipy.stats import norm

    return Verdict(
        kind=kind,
        named=tuple(tied) if best else (),
        sets=tuple(tied),
        angle=angle,
        p_gap=float(norm.sf(gain[0] / gain[1])) if best and gain[1] else 1.0,
        p_misfit=float("nan"),  # the noise is the fit's own: there is nothing to test
        second=tied[1] if len(tied) > 1 else (),
        margin=fits[tied[1]].cost - fits[best].cost if len(tied) > 1 else float("nan"),
        sentence=text,
        change=f"Record: {plan[0][0]}, its ends measured." if plan else "",
    )


def _differing(tied: Sequence[tuple[str, ...]]) -> list[str]:
    common = set.intersection(*(set(item) for item in tied)) if tied else set()
    return [" and ".join(n for n in item if n not in common) for item in tied]


def _text(name: str, magnitude: float) -> str:
    if name in ("axle", "both_diameters", "left_diameter", "right_diameter"):
        return f"{name} {100 * magnitude:+.2f} %"
    if name == "mount_angle":
        return f"{name} {1e3 * magnitude:+.1f} mrad"
    return f"{name} {1e3 * magnitude:+.2f} mm"


def _angle(one: OdometryFit, other: OdometryFit) -> float:
    """Between what two fits that differ in one candidate add to the others [deg]."""
    names, others = list(one.magnitudes), list(other.magnitudes)
    common = [name for name in names if name in others]
    rows = [one.signatures[names.index(name)] for name in common]
    a = one.signatures[next(names.index(n) for n in names if n not in common)]
    b = other.signatures[next(others.index(n) for n in others if n not in common)]
    if rows:
        base = np.linalg.qr(np.array(rows).T)[0]
        a, b = a - base @ (base.T @ a), b - base @ (base.T @ b)
    cosine = abs(a @ b) / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, 0, 1))))
