"""The fit as a linear Gaussian model: evidence of each set of explanations.

Every row has a normal prior: as wide as a plausible departure if its explanation is in
(the slab), as wide as its slack if it is out (the spike; 0 = exactly nominal). With the
residuals linear in the rows the evidence of a set is known in closed form (Bishop,
Pattern Recognition and Machine Learning, 2006, 3.5; spike and slab: George and
McCulloch, JASA 88, 1993). All that it needs is one small matrix per stretch of the
recording, so that thousands of sets, stretches left out and moments at which a row
sets in cost no simulation.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bns.gap.decomposition.evidence.spread import Spread, Widened
from bns.gap.decomposition.problem import Problem

KAPPA = 3.0
"""what an explanation costs: the log odds against it; e^3 = 20, the number of
explanations of a usual model, so that about one in all is expected"""
EDGE = 0.1  # of a level's departure, by which a fit may leave its bounds: whole losses
# are at theirs

AT = 9.0  # squared deviations by which rows may want beyond a bound and still be at it

Support = frozenset[str]


@dataclass(frozen=True, eq=False)
class Linear:
    """Residuals linear in K rows, in units of their priors, by stretch.

    Attributes:
        columns: numbers of the rows, ``(K,)``.
        terms: columns of each explanation.
        free: explanations that may be in or out; nuisances are always in.
        normal: ``J' W J`` of each of B stretches, ``(B, K, K)``.
        slope: ``J' W z`` of each, ``(B, K)``.
        square: ``z' W z`` of each, ``(B,)``.
        slack: of each row in units of its prior, ``(K,)``.
        always: rows that are in, whatever is, ``(K,)``.
        low, high: bounds in units of the prior, from the nominal, ``(K,)``.
        lam: residuals that count as one independent one.
        penalty: what each explanation costs.
        family: of explanations that share one cause, and pay once.
        covers: explanations that add nothing beside one, by that.
        joins: explanations beside all of which one adds nothing, by that.
        design: whitened-free columns, ``(N, C, K)``.
        target: residuals of the nominal model, ``(N, C)``.
        weight: of the squares, ``(N, C)``.
        block: number of the stretch, ``(N,)``.
    """

    columns: np.ndarray
    terms: Mapping[str, tuple[int, ...]]
    free: tuple[str, ...]
    normal: np.ndarray
    slope: np.ndarray
    square: np.ndarray
    slack: np.ndarray
    always: np.ndarray
    low: np.ndarray
    high: np.ndarray
    lam: float
    penalty: Mapping[str, float]
    family: Mapping[str, str]
    covers: Mapping[str, frozenset[str]]
    joins: Mapping[str, frozenset[str]]
    design: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    block: np.ndarray
    _costs: dict = field(default_factory=dict)
    _sums: dict = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        problem: Problem,
        design: Mapping[int, np.ndarray],
        units: Mapping[int, float],
        target: np.ndarray,
        weight: np.ndarray,
        lam: float = 1.0,
    ) -> "Linear":
        """Set up from derivatives.

        Args:
            problem: the recording.
            design: derivative by each row, by its number, ``(N, C)``.
            units: of each row: what its prior's standard deviation is.
            target: residuals of the nominal model, ``(N, C)``, finite.
            weight: of the squares, ``(N, C)``.
            lam: see there.
        """
        columns = np.array(sorted(design))
        unit = np.array([units[k] for k in columns])
        matrix = np.stack([design[k] for k in columns], axis=-1) * unit
        place = {number: at for at, number in enumerate(columns)}
        terms = {
            name: tuple(place[k] for k in numbers if k in place)
            for name, numbers in problem.terms.items()
        }
        terms = {name: found for name, found in terms.items() if found}
        rows = [problem.rows[k] for k in columns]
        term = [row.term for row in problem.rows]
        always = np.array([row.nuisance for row in rows])
        free = tuple(n for n, found in terms.items() if not always[found[0]])
        low, high = (bound[columns] for bound in problem.bounds)
        middle = problem.nominal[columns]
        edge = np.array([0.0 if row.smooth else EDGE for row in rows])
        made = cls(
            columns=columns,
            terms=terms,
            free=free,
            normal=np.empty(0),
            slope=np.empty(0),
            square=np.empty(0),
            slack=np.array([row.slack for row in rows]) / unit,
            always=always,
            low=(low - middle) / unit - edge,
            high=(high - middle) / unit + edge,
            lam=lam,
            penalty=dict.fromkeys(free, problem.model.odds),
            family={row.term: row.family or row.term for row in rows},
            covers={row.term: frozenset(row.covers) for row in rows if row.covers},
            joins={
                term[number]: frozenset(term[k] for k in parts)
                for number, parts in problem.joins.items()
            },
            design=matrix,
            target=target,
            weight=weight,
            block=problem.block,
        )
        return made._summed(matrix, target)

    def in_blocks(self, block: np.ndarray) -> "Linear":
        """The same model with other stretches, ``(N,)``, numbered from 0."""
        return self._with(block=block)._summed(self.design, self.target)

    def _summed(self, design: np.ndarray, target: np.ndarray) -> "Linear":
        count, size = int(self.block.max()) + 1, design.shape[-1]
        normal = np.zeros((count, size, size))
        slope, square = np.zeros((count, size)), np.zeros(count)
        for number in range(count):
            rows = self.block == number
            part = design[rows].reshape(-1, size)
            weight, values = self.weight[rows].ravel(), target[rows].ravel()
            heavy = part * weight[:, None]
            normal[number] = heavy.T @ part
            slope[number] = heavy.T @ values
            square[number] = (weight * values**2).sum()
        return self._with(
            design=design, target=target, normal=normal, slope=slope, square=square
        )

    def _with(self, **changes: Any) -> "Linear":
        return replace(self, **changes, _costs={}, _sums={})

    def moved(self, change: np.ndarray, drop: str = "") -> "Linear":
        """The same with a change of the prediction, ``(N, C)``, taken off the target.

        Args:
            change: of the predicted features.
            drop: explanation that is no longer free (the change is its own).
        """
        target = self.target - change
        count, size = len(self.square), self.design.shape[-1]
        slope, square = np.zeros((count, size)), np.zeros(count)
        for number in range(count):
            rows = self.block == number
            values = (self.weight[rows] * target[rows]).ravel()
            slope[number] = self.design[rows].reshape(-1, size).T @ values
            square[number] = values @ target[rows].ravel()
        free = tuple(name for name in self.free if name != drop)
        return self._with(target=target, slope=slope, square=square, free=free)

    def of_blocks(self, kept: np.ndarray) -> "Linear":
        """Some stretches alone, ``(B,)`` of booleans."""
        return self._with(
            normal=self.normal[kept], slope=self.slope[kept], square=self.square[kept]
        )

    def correlated(self, lam: float) -> "Linear":
        """The same with as many residuals counting as one."""
        return self._with(lam=lam)

    def _total(self) -> tuple[np.ndarray, np.ndarray, float]:
        if "all" not in self._sums:
            self._sums["all"] = (
                self.normal.sum(axis=0),
                self.slope.sum(axis=0),
                float(self.square.sum()),
            )
        return self._sums["all"]

    def prior(self, support: Iterable[str], *, slack: bool = True) -> np.ndarray:
        """Standard deviation of each row, ``(K,)``; 0 = exactly nominal."""
        made = self.slack.copy() if slack else np.zeros(len(self.slack))
        for name in support:
            made[list(self.terms[name])] = 1.0
        made[self.always] = 1.0
        return made

    def solve(
        self, support: Iterable[str], *, slack: bool = True, without: int = -1
    ) -> np.ndarray:
        """Most probable rows, in units of their priors, ``(K,)``.

        Args:
            support: explanations that are in.
            slack: whether the others may move within their slack.
            without: number of a stretch that is left out.
        """
        normal, slope, _ = self._total()
        if without >= 0:
            normal, slope = normal - self.normal[without], slope - self.slope[without]
        prior = self.prior(support, slack=slack)
        used = np.flatnonzero(prior)
        made = np.zeros(len(prior))
        made[used] = np.linalg.solve(
            self._curvature(normal, prior, used), slope[used] / self.lam
        )
        return made

    def _curvature(
        self, normal: np.ndarray, prior: np.ndarray, used: np.ndarray
    ) -> np.ndarray:
        return normal[np.ix_(used, used)] / self.lam + np.diag(prior[used] ** -2)

    def covariance(self, support: Iterable[str]) -> np.ndarray:
        """Posterior covariance of the rows, ``(K, K)``, in units of their priors."""
        prior = self.prior(support)
        used = np.flatnonzero(prior)
        made = np.zeros((len(prior), len(prior)))
        made[np.ix_(used, used)] = np.linalg.inv(
            self._curvature(self._total()[0], prior, used)
        )
        return made

    def cost(self, support: Iterable[str]) -> float:
        """Minus the log evidence of a set with its prior, but for a constant.

        Where a row of it would leave its bounds the set is no better than the one
        without that explanation, and costs more; but where that bound is the nominal
        value and others of its rows stay inside, the row alone is out: a dry friction
        that does not break away is one. Rows that are at a bound within what the data
        leave open pay for what they are off.
        """
        key = frozenset(support)
        if key not in self._costs:
            self._costs[key] = self._cost(key)
        return self._costs[key]

    def _cost(self, key: Support) -> float:
        for name, covered in self.covers.items():
            if name in key and covered & key:
                return self.cost(key - covered) + KAPPA * len(covered & key)
        for name, parts in self.joins.items():
            if name in key and parts <= key:  # the parts alone can be all that it is
                return self.cost(key - {name}) + KAPPA
        wider = self._widened(self._rows(key))
        value, found = wider.tailed()
        far = self._beyond(wider.rows, found)
        if edges := self._edges(key, set(wider.rows[far])):
            wider = self._widened([row for row in wider.rows if row not in edges])
            value, found = wider.tailed()
            far = self._beyond(wider.rows, found)
        value += self.paid(key) + self._nuisances_beyond(wider)
        if far.any() and (off := self._at_bounds(wider, found, far)) < AT:
            return float(value + 0.5 * off)
        if far.any():
            beyond = set(wider.rows[far])
            out = {name for name in key if beyond & set(self.terms[name])}
            value = max(value, self.cost(key - out) + KAPPA * len(out))
        return float(value)

    def _widened(self, rows: Sequence[int]) -> Widened:
        """What was recorded where some rows are in."""
        more = 1.0 - self.slack[rows] ** 2
        return self.spread(frozenset()).widened(rows, more)

    def _nuisances_beyond(self, wider: Widened) -> float:
        """What it costs that nuisances are held to their bounds, in nats: half their
        squared deviations from there, by what the data leave open. Else a lead of the
        motion, which may be a thousandth of a second, would be a delay of a tenth.

        Args:
            wider: with the rows that are in.
        """
        out = np.flatnonzero(self.always)
        wanted = wider.beside(out)
        off = wanted - np.clip(wanted, self.low[out], self.high[out])
        far = np.abs(off) > 1e-6
        return 0.5 * _squared(off[far], wider, out[far]) if far.any() else 0.0

    def _at_bounds(self, wider: Widened, found: np.ndarray, far: np.ndarray) -> float:
        """Squared deviations, by what the data leave open, from where rows want to be
        to their bounds; infinite where such a bound is the nominal value.

        Args:
            wider: with the rows that are in.
            found: where they want to be, ``(n,)``.
            far: those beyond a bound, booleans ``(n,)``.
        """
        out = wider.rows[far]
        edge = np.clip(found[far], self.low[out], self.high[out])
        if not edge.all():
            return np.inf
        return _squared(found[far] - edge, wider, out)

    def _beyond(self, rows: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Which rows' most probable values lie beyond their bounds, ``(n,)``."""
        low, high = self.low[rows] - 1e-6, self.high[rows] + 1e-6
        return np.asarray((found < low) | (found > high))

    def _edges(self, key: Support, far: set[int]) -> set[int]:
        """Rows of a set that want to be beyond a bound that is their nominal value,
        while others of their explanation stay inside theirs."""
        edges: set[int] = set()
        for name in key if far else ():
            mine = far & set(self.terms[name])
            if mine < set(self.terms[name]):
                edges |= {r for r in mine if 0.0 in (self.low[r], self.high[r])}
        return edges

    def _rows(self, names: Iterable[str]) -> list[int]:
        """Rows of some explanations, in one order: sums in the order of a set differ in
        the last bit from run to run."""
        return sorted(row for name in names for row in self.terms[name])

    def spread(self, support: Support) -> Spread:
        """What was recorded, as it may spread under a set's prior; kept for none."""
        if "none" in self._sums and not support:
            return self._sums["none"]
        normal, slope, square = self._total()
        made = Spread.of(normal, slope, square, self.lam, self.prior(support))
        if not support:
            self._sums["none"] = made
        return made

    def paid(self, support: Support) -> float:
        """What a set costs: each family once, its dearest member."""
        most: dict[str, float] = {}
        for name in support:
            family = self.family.get(name, name)
            most[family] = max(most.get(family, 0.0), self.penalty[name])
        return math.fsum(most.values())

    @property
    def weighed(self) -> Mapping[Support, float]:
        """Cost of each set that was asked for so far."""
        return self._costs

    def alike(self, one: str, other: str) -> float:
        """Largest cosine, without its sign, of what rows of two explanations change."""
        rows, columns = (self.terms.get(name, ()) for name in (one, other))
        normal = self._total()[0]
        size = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
        found = [abs(normal[i, j]) / (size[i] * size[j]) for i in rows for j in columns]
        return float(max(found, default=0.0))

    def rest(self, values: np.ndarray) -> np.ndarray:
        """Residuals at values of the rows, ``(N, C)``."""
        return self.target - self.design @ values

    def squares(self, support: Iterable[str]) -> float:
        """Weighted square of what a set leaves, the others exactly nominal."""
        return self.left(self.solve(support, slack=False))

    def left(self, values: np.ndarray) -> float:
        """Weighted square of what values of all rows leave.

        Args:
            values: in units of their priors, ``(K,)``.
        """
        normal, slope, square = self._total()
        return float(square - 2 * slope @ values + values @ normal @ values)

    def square_of(self, values: np.ndarray, names: Iterable[str]) -> float:
        """Weighted square of what some explanations change at values of all rows.

        Args:
            values: in units of their priors, ``(K,)``.
            names: explanations.
        """
        rows = self._rows(names)
        normal = self._total()[0][np.ix_(rows, rows)]
        return float(values[rows] @ normal @ values[rows])

    def held_out(
        self, support: Iterable[str], under: "Linear | None" = None
    ) -> np.ndarray:
        """Weighted square of each stretch, the rows fitted to the others, ``(B,)``.

        Args:
            support: the set.
            under: the model whose weights count, of the same stretches; None = this.
        """
        some, told = tuple(support), under or self
        made = np.empty(len(told.square))
        for number in range(len(made)):
            values = self.solve(some, slack=False, without=number)
            made[number] = (
                told.square[number]
                - 2 * told.slope[number] @ values
                + values @ told.normal[number] @ values
            )
        return made

    def scores(self, values: np.ndarray) -> np.ndarray:
        """Derivative of half the weighted square by stretch, ``(B, K)``."""
        return self.slope - self.normal @ values

    def since(self, name: str, on: np.ndarray, label: str) -> "Linear":
        """With a further explanation: that one, in some stretches only.

        Args:
            name: explanation.
            on: in which stretches it holds, booleans ``(B,)``.
            label: name of the new one.
        """
        old = list(self.terms[name])
        size, more = self.design.shape[-1], len(old)
        index = np.r_[np.arange(size), old]
        normal = self.normal[:, index][:, :, index].copy()
        slope = self.slope[:, index].copy()
        normal[~on, size:, :] = 0.0
        normal[~on, :, size:] = 0.0
        slope[~on, size:] = 0.0
        late = tuple(range(size, size + more))
        grown = {key: getattr(self, key)[index] for key in ("columns", "low", "high")}
        return self._with(
            **grown,
            slack=np.r_[self.slack, np.zeros(more)],
            always=np.r_[self.always, np.zeros(more, dtype=bool)],
            terms={**self.terms, label: late},
            free=(*self.free, label),
            penalty={**self.penalty, label: self.penalty[name]},
            normal=normal,
            slope=slope,
        )


def _squared(off: np.ndarray, wider: Widened, rows: np.ndarray) -> float:
    """Squared deviations ``(m,)`` of rows, by what the data leave open of them."""
    return float(off @ np.linalg.solve(wider.covariance(rows), off))


def stretches(count: int, kept: Iterable[int]) -> np.ndarray:
    """Which of so many stretches are kept, ``(count,)``."""
    made = np.zeros(count, dtype=bool)
    made[list(kept)] = True
    return made
