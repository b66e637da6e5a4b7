"""Diagnosis of odometry: what is wrong, what is tied, and which drive would tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from bns.errors import BnsError
from bns.gap.models.odometry import fit
from bns.gap.models.odometry.fit import BLOCK, FULL, TERMS, Noise, OdometryFit, Problem
from bns.gap.models.odometry.motions import TURN, Motions
from bns.gap.records import Verdict

TIE = 3.0  # difference of evidence up to which two supports are tied; assumed
UNSEEN = 0.5  # of a plausible size: known no better, a mount's number is not seen
REACH, MOST = 6.0, 12  # evidence behind the best, and how many, are fitted in full
MOUNT = ("mount_x", "mount_y", "mount_angle")
TURNED = 0.2  # [rad] no sensor is turned as far by accident; assumed
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
        verdict: supports of terms, tied ones together.
        fits: of every support that the verdict names, and of nothing, by support.
        full: the fit of all terms together.
        shares: of the loss that the best support closes: what each of its terms closes
            alone, and what it closes last in.
        unseen: terms of the mount of which these drives say nothing.
        gain: how much the best support lowers the held-out loss, and its standard
            error over blocks.
        noise: of the motions.
        plan: drives by how well they would tell the first two tied supports apart, in
            deviations, best first; empty where nothing is tied.
    """

    verdict: Verdict
    fits: Mapping[tuple[str, ...], OdometryFit]
    full: OdometryFit
    shares: Mapping[str, tuple[float, float]]
    unseen: tuple[str, ...]
    gain: tuple[float, float]
    noise: Noise
    plan: tuple[tuple[str, float], ...]


def diagnose(
    motions: Motions, *, length_bias: float = fit.LENGTH_BIAS
) -> OdometryDiagnosis:
    """All terms together, then those dropped that the evidence does not need.

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
    problem = fit.problem(motions, length_bias=length_bias)
    full = problem.fit(FULL)
    place = problem.fit(MOUNT[:2])  # on its own: an open heading leaves it on a circle
    known = {**full.deviations, **place.deviations}
    unseen = tuple(n for n in MOUNT if known[n] > UNSEEN * TERMS[n].size)
    turned = abs(full.values[TURN]) > TURNED
    search = Search(problem, tuple(_allowed(unseen, turned)))
    best = search.best()
    tied = search.tied(best)
    honest = replace(problem, unseen=unseen)
    fits = {names: honest.fit(names) for names in {(), *tied}}
    gain = held_out(problem, best)
    plan = _plan(motions, fits[tied[0]], fits[tied[1]]) if len(tied) > 1 else ()
    verdict = _verdict(tied, fits, gain, plan, unseen)
    shares = _shares(problem, best)
    return OdometryDiagnosis(
        verdict, fits, full, shares, unseen, gain, problem.noise, plan
    )


def _allowed(unseen: Sequence[str], turned: bool) -> Iterator[tuple[str, ...]]:
    """All sets of terms that are seen, in which no two change the same number.

    Args:
        unseen: terms that no drive shows.
        turned: whether the sensor was turned on purpose. Its place is then two numbers
            or none: a heading known a little only could turn either of them to zero.
    """
    seen = [name for name in TERMS if name not in unseen]
    for count in range(len(seen) + 1):
        for names in combinations(seen, count):
            numbers = [number for name in names for number in TERMS[name].numbers]
            alone = ("mount_x" in names) != ("mount_y" in names)
            if len(set(numbers)) == len(numbers) and not (turned and alone):
                yield names


@dataclass(frozen=True, eq=False)
class Search:
    """Supports by their evidence.

    All are ranked by predictions taken as linear about the best fit so far; those that
    come out near the best are fitted in full.

    Attributes:
        problem: the motions.
        supports: that are considered.
        known: fits so far, by support.
    """

    problem: Problem
    supports: tuple[tuple[str, ...], ...]
    known: dict[tuple[str, ...], OdometryFit] = field(default_factory=dict)

    def fit(self, names: tuple[str, ...]) -> OdometryFit:
        """A support's fit, made once."""
        if names not in self.known:
            self.known[names] = self.problem.fit(names)
        return self.known[names]

    def best(self) -> tuple[str, ...]:
        """The support of the highest evidence, ranked about everything at first."""
        best, about = None, self.problem.fit(FULL).values
        while True:
            self._fit_near(self.supports, about)
            better = min(self.known, key=self._cost)
            if better == best:
                return best
            best, about = better, self.fit(better).values

    def tied(self, best: tuple[str, ...]) -> list[tuple[str, ...]]:
        """The support and those with one term exchanged that explain as well."""
        swaps = [
            names
            for names in self.supports
            if len(names) == len(best) and len(set(names) - set(best)) == 1
        ]
        self._fit_near([best, *swaps], self.fit(best).values)
        found = [names for names in (best, *swaps) if names in self.known]
        least = self._cost(best) + TIE
        return sorted((n for n in found if self._cost(n) <= least), key=self._cost)

    def _cost(self, names: tuple[str, ...]) -> float:
        return self.fit(names).cost

    def _fit_near(
        self, supports: Sequence[tuple[str, ...]], values: np.ndarray
    ) -> None:
        """Fit the supports that come within reach of the best of them."""
        costs = self.problem.costs(supports, values)
        for at in np.argsort(costs)[:MOST]:
            if costs[at] <= costs.min() + REACH:
                self.fit(supports[at])


def held_out(problem: Problem, names: tuple[str, ...]) -> tuple[float, float]:
    """By how much a support lowers the loss of blocks that it was not fitted to.

    Returns:
        The sum over blocks, and its standard error.
    """
    block = np.arange(len(problem.motions)) // BLOCK
    gains = np.zeros(block[-1] + 1)
    for parity in (0, 1):
        part = problem.take(block % 2 != parity)
        fits = [part.fit(item, slack=0.0) for item in ((), names)]
        for number in range(parity, len(gains), 2):
            part = problem.take(block == number)
            nothing, explained = (part.loss(item.values) for item in fits)
            gains[number] = nothing - explained
    return float(gains.sum()), float(gains.std(ddof=1) * np.sqrt(len(gains)))


def _shares(problem: Problem, names: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """What each term closes alone and last in; those not named held at nominal."""

    def loss(support: tuple[str, ...]) -> float:
        return problem.fit(support, slack=0.0).loss

    nothing, whole = loss(()), loss(names)
    made: dict[str, tuple[float, float]] = {}
    for name in names:
        without = tuple(other for other in names if other != name)
        alone, last = nothing - loss((name,)), loss(without) - whole
        made[name] = alone / (nothing - whole), last / (nothing - whole)
    return made


def _plan(
    motions: Motions, one: OdometryFit, other: OdometryFit
) -> tuple[tuple[str, float], ...]:
    """How far the poses after each drive lie apart under two explanations."""
    separations = {}
    for name, (left, right) in DRIVES.items():
        whole = Motions(
            np.array([left]), np.array([right]), np.zeros((1, 3)), motions.axle
        )
        first, second = whole.predict(one.values)[0], whole.predict(other.values)[0]
        separations[name] = float(np.linalg.norm((first - second) / SENSOR))
    return tuple(sorted(separations.items(), key=lambda item: -item[1]))


def _verdict(
    tied: Sequence[tuple[str, ...]],
    fits: Mapping[tuple[str, ...], OdometryFit],
    gain: tuple[float, float],
    plan: Sequence[tuple[str, float]],
    unseen: Sequence[str],
) -> Verdict:
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
    if unseen:
        text += f" Of {' and '.join(unseen)} these drives say nothing."
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
    unit = TERMS[name].unit
    if unit == "1":
        return f"{name} {100 * magnitude:+.2f} %"
    if unit == "rad":
        return f"{name} {1e3 * magnitude:+.1f} mrad ({np.degrees(magnitude):+.1f} deg)"
    return f"{name} {1e3 * magnitude:+.2f} mm"


def _angle(one: OdometryFit, other: OdometryFit) -> float:
    """Between what two fits that differ in one term add to the others [deg]."""
    common = [name for name in one.names if name in other.names]
    rows = [one.signatures[one.names.index(name)] for name in common]
    a = one.signatures[next(i for i, n in enumerate(one.names) if n not in common)]
    b = other.signatures[next(i for i, n in enumerate(other.names) if n not in common)]
    if rows:
        base = np.linalg.qr(np.array(rows).T)[0]
        a, b = a - base @ (base.T @ a), b - base @ (base.T @ b)
    cosine = abs(a @ b) / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, 0, 1))))
