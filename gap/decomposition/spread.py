"""How what was recorded spreads under a prior, and what other priors cost beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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

    def changed(
        self, rows: Sequence[int], more: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """The cost where the variance of some rows is another, and their most probable
        values.

        Args:
            rows: numbers of the rows.
            more: added to the variance of each, ``(n,)``.
        """
        if not len(rows):
            return self.cost, np.zeros(0)
        inner, pull = self.inner[np.ix_(rows, rows)], self.pull[rows]
        wider = np.eye(len(rows)) + inner * more
        try:
            left = np.linalg.solve(wider, pull)
        except np.linalg.LinAlgError:  # known better than doubles can tell from exactly
            wider += LEAST * np.eye(len(rows))
            left = np.linalg.solve(wider, pull)
        cost = self.cost + 0.5 * np.linalg.slogdet(wider)[1]
        cost -= 0.5 * float((more * pull) @ left)
        return cost, (self.variance[rows] + more) * left

    def evidence(
        self, rows: Sequence[int], known: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Minus the log evidence with some rows in, and their most probable values,
        ``(n,)``; with priors as `tail` has them.

        A normal prior holds back what is far off and not told well by the data, though
        it may be of any size: a load many times as heavy as its link plausibly departs
        by, of which one motion tells. Such rows have a prior of their own departure.

        Args:
            rows: numbers of the rows.
            known: variance that each has anyway, ``(n,)``.
        """
        value, found = self.changed(rows, 1.0 - known)
        value += tail(found)
        far = np.abs(found) > STRONG
        if far.any():
            scale = np.where(far, found**2, 1.0)
            other, wider = self.changed(rows, scale - known)
            other += tail(wider[~far])
            if other < value:
                return other, wider
        return value, found

    def uncertain(self, rows: Sequence[int], more: np.ndarray) -> np.ndarray:
        """Posterior covariance of some rows where the variance of these is another,
        ``(n, n)``, in units of their priors.

        Args:
            rows: numbers of the rows.
            more: added to the variance of each, ``(n,)``.
        """
        inner, variance = self.inner[np.ix_(rows, rows)], self.variance[rows] + more
        seen = np.linalg.solve(np.eye(len(rows)) + inner * more, inner)
        made: np.ndarray = np.diag(variance) - variance[:, None] * seen * variance
        return made


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
