"""sIT&E (Papaspyros et al. 2016): IT&E that weighs the harm which a gait may do.

A second Gaussian process learns which behaviours end in harm: a fall, a strained servo,
a stop at a lamp. What is tried next has the highest expected improvement times the
probability of doing no harm (Gardner et al. 2014). In the model nothing was harmful.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np
from scipy import special

from bns.learners.ite import Ite, IteSettings, Map, Tests
from bns.prior import gaussian


@dataclass(frozen=True, kw_only=True)
class SafeIteSettings(IteSettings):
    """Settings of sIT&E; those of IT&E, whose `kappa` plays no part."""

    harmless: float = 0.5
    """harm, from 0 to 1, up to which a gait counts as doing none"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        **IteSettings.bounds,
        "harmless": (1e-3, 1, "1"),
    }


class SafeIte(Ite):
    """R runs of sIT&E; arguments as `Learner`."""

    Settings = SafeIteSettings

    def wanted(
        self, tests: Tests, known: Map, mean: np.ndarray, spread: np.ndarray
    ) -> np.ndarray:
        """Expected improvement times the probability of no harm, ``(N,)``.

        Args:
            tests: of the run so far.
            known: its map.
            mean, spread: what each is expected to achieve, and its standard deviation.
        """
        rule = self.rule
        likely, doubt = gaussian.posterior(
            known.behaviours[np.array(tests.at, int)],
            np.array(tests.harm),
            known.behaviours,
            reach=rule.reach,
            noise=rule.noise,
        )
        limit = cast(SafeIteSettings, rule).harmless
        safe = special.ndtr((limit - likely) / np.maximum(doubt, 1e-9))
        if not tests.seen:
            return safe * (mean - mean.min())
        good = [s for s, harm in zip(tests.seen, tests.harm, strict=True) if not harm]
        return safe * improvement(mean, spread, max(good, default=0.0))


def improvement(mean: np.ndarray, spread: np.ndarray, best: float) -> np.ndarray:
    """Expected improvement over `best` of normal values (Jones et al. 1998), like mean.

    Args:
        mean: expected, ``(N,)``.
        spread: standard deviations, ``(N,)``.
        best: so far.
    """
    deviation = np.maximum(spread, 1e-9)
    apart = (mean - best) / deviation
    bell = np.exp(-(apart**2) / 2) / np.sqrt(2 * np.pi)
    found: np.ndarray = (mean - best) * special.ndtr(apart) + deviation * bell
    return found


LEARNER = SafeIte
