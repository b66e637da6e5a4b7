"""How what was recorded spreads under a prior, and what other priors cost beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

STRONG = 4.0  # plausible departures from which a row has a prior of its own size
LEAST = 1e-12  # of a prior's variance: what double precision leaves


@dataclass(frozen=True, eq=False)
class Spread:
    """How what was recorded spreads under a prior, ``C = lam W^-1 + J V J'``, as far as
    sets need it: a change of the prior of few rows costs a small matrix (Woodbury's
    identity, the determinant's lemma).

    Attributes:
        variance: of each row, ``(K,)``.
        inner: ``J' C^-1 J``, ``(K, K)``.
        pull: ``J' C^-1 z``, ``(K,)``.
        cost: minus the log evidence, but for a constant.
    """

    variance: np.ndarray
    inner: np.ndarray
    pull: np.ndarray
    cost: float

    @classmethod
    def of(
        cls,
        normal: np.ndarray,
        slope: np.ndarray,
        square: float,
        lam: float,
        prior: np.ndarray,
    ) -> "Spread":
        """By the normal equations.

        Args:
            normal: ``J' W J``, ``(K, K)``.
            slope: ``J' W z``, ``(K,)``.
            square: ``z' W z``.
            lam: residuals that count as one.
            prior: standard deviation of each row, ``(K,)``; 0 = exactly nominal.
        """
        used = np.flatnonzero(prior)
        curvature = normal[np.ix_(used, used)] / lam + np.diag(prior[used] ** -2)
        factor = np.linalg.cholesky(curvature)
        half = np.linalg.solve(
            factor, np.column_stack([normal[used] / lam, slope[used] / lam])
        )
        inner = normal / lam - half[:, :-1].T @ half[:, :-1]
        pull = slope / lam - half[:, :-1].T @ half[:, -1]
        cost = 0.5 * square / lam - 0.5 * float(half[:, -1] @ half[:, -1])
        cost += float(np.log(np.diag(factor)).sum() + np.log(prior[used]).sum())
        return cls(prior**2, inner, pull, cost)

    def widened(self, rows: Sequence[int], more: np.ndarray) -> "Widened":
        """The same where the variance of some rows is another.

        Args:
            rows: numbers of the rows.
            more: added to the variance of each, ``(n,)``.
        """
        return Widened.of(self, np.array(rows, dtype=int), more)


@dataclass(frozen=True, eq=False)
class Widened:
    """A spread where the variance of some rows is another: one factorisation of a small
    matrix, since thousands are asked for.

    Attributes:
        spread: before.
        rows: numbers of the rows, ``(n,)``.
        more: added to the variance of each, ``(n,)``.
        left: what is left of their pulls, ``(n,)``.
        cost: see `Spread`.
    """

    spread: Spread
    rows: np.ndarray
    more: np.ndarray
    left: np.ndarray
    cost: float
    _factors: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(cls, spread: Spread, rows: np.ndarray, more: np.ndarray) -> "Widened":
        """See `Spread.widened`."""
        if not len(rows):
            return cls(spread, rows, more, more, spread.cost, (more, more))
        pull = spread.pull[rows]
        wider = spread.inner[rows[:, None], rows] * more
        wider.flat[:: len(rows) + 1] += 1.0
        factors, order, left, singular = lapack.dgesv(wider, pull)
        if singular:  # known better than doubles can tell from exactly
            wider.flat[:: len(rows) + 1] += LEAST
            factors, order, left, _ = lapack.dgesv(wider, pull)
        cost = spread.cost + 0.5 * float(np.log(np.abs(factors.diagonal())).sum())
        cost -= 0.5 * float((more * pull) @ left)
        return cls(spread, rows, more, left, cost, (factors, order))

    @property
    def values(self) -> np.ndarray:
        """Most probable values of the rows, ``(n,)``, in units of their priors."""
        return np.asarray((self.spread.variance[self.rows] + self.more) * self.left)

    def beside(self, others: np.ndarray) -> np.ndarray:
        """Most probable values of rows whose variance stays, ``(m,)``, in units of
        their priors.

        Args:
            others: their numbers, ``(m,)``.
        """
        spread = self.spread
        taken = spread.inner[others[:, None], self.rows] @ (self.more * self.left)
        return np.asarray(spread.variance[others] * (spread.pull[others] - taken))

    def covariance(self, numbers: np.ndarray) -> np.ndarray:
        """Posterior covariance of any rows, ``(m, m)``, in units of their priors.

        Args:
            numbers: of the rows, ``(m,)``.
        """
        inner = self.spread.inner
        variance = self.spread.variance.copy()
        variance[self.rows] += self.more
        seen = inner[numbers[:, None], numbers]
        if len(self.rows):
            across = inner[self.rows[:, None], numbers]
            solved, _ = lapack.dgetrs(*self._factors, across)
            seen = seen - across.T @ (self.more[:, None] * solved)
        mine = variance[numbers]
        return np.asarray(np.diag(mine) - mine[:, None] * seen * mine)

    def tailed(self) -> tuple[float, np.ndarray]:
        """Minus the log evidence, and the most probable values of the rows, ``(n,)``,
        where these have, each, a prior as wide as its unit; with priors as `tail` has
        them.

        A normal prior holds back what is far off and not told well by the data, though
        it may be of any size: a load many times as heavy as its link plausibly departs
        by, of which one motion tells. Such rows have a prior of their own departure.
        """
        found = self.values
        value = self.cost + tail(found)
        far = np.abs(found) > STRONG
        if far.any():
            scale = np.where(far, found**2, 1.0)
            wider = Widened.of(self.spread, self.rows, self.more + scale - 1.0)
            other = wider.cost + tail(wider.values[~far])
            if other < value:
                return other, wider.values
        return value, found


def tail(values: np.ndarray) -> float:
    """What priors cost less than normal ones, in nats: beyond a plausible departure
    they fall as its inverse, since damage may be of any size.

    A prior whose scale is itself unknown, at the scale that explains a value best
    (Tipping, JMLR 1, 2001): a value of `z` deviations costs ``1/2 + ln z``, not
    ``z^2 / 2``.

    Args:
        values: of rows, in units of their priors.
    """
    far = np.maximum(np.abs(values), 1.0)
    return float((0.5 + np.log(far) - far**2 / 2).sum())
