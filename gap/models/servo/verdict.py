"""From scores to a verdict, with thresholds taken from runs without a change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import t as student

from bns.gap.decomposition.row import Row
from bns.gap.models.servo.score import Scores
from bns.gap.records import Verdict

LEVEL = 0.05  # chance of a false alarm that is accepted
MANY = round(1 / LEVEL) - 1  # settings whose own statistics reach to that chance
# Natural logarithm of the ratio of gains whose statistics count fully: of 0.2 to 100
# about the likeliest to have predicted each of 48 settings from the others.
WIDTH = 0.5
ENOUGH = 5.0  # settings that have to count, or the width is doubled
LEAST = 1e-6  # below it a statistic is zero
COVERAGE = 0.90  # of the sets
EXCESS = (
    3.0  # times what the worst setting without a change leaves: none of the library
)


@dataclass(frozen=True, eq=False)
class Null:
    """Scores of settings in which nothing changed.

    Attributes:
        cells: names of the settings.
        statistics: `Scores.statistic` of each, shape ``(N,)``.
        left: what nothing leaves unexplained per value, shape ``(N,)``.
    """

    cells: tuple
    statistics: np.ndarray
    left: np.ndarray

    @classmethod
    def of(cls, scores: Mapping[object, Scores]) -> "Null":
        """From the scores by setting."""
        rows = scores.values()
        return cls(
            tuple(scores),
            np.array([row.statistic for row in rows]),
            np.array([row.nothing / row.size for row in rows]),
        )

    def without(self, cells: Sequence[object]) -> "Null":
        """The others."""
        keep = np.array([cell not in cells for cell in self.cells])
        names = tuple(c for c, kept in zip(self.cells, keep, strict=True) if kept)
        return Null(names, self.statistics[keep], self.left[keep])

    def chance(self, statistic: float, gain: float) -> float:
        """Probability of so large a statistic where nothing changed.

        Soft control scatters more than stiff: logarithms are set against the mean and
        scatter of the settings near in gain. Where there are `MANY` settings, the
        chance is the share of them that stand out as far among the others (a conformal
        p-value; no shape is assumed). Of fewer, and beyond all, they are taken as
        normal, of a mean and variance known from a few settings only (Student's t).

        Args:
            statistic: see `Scores.statistic`.
            gain: that the runs were told to have.
        """
        away, count = self._away(statistic, gain)
        assumed = float(student.sf(away, count - 1))
        if len(self.cells) < MANY:
            return assumed
        others = [
            self.without([cell])._away(value, cell[-1])[0]
            for cell, value in zip(self.cells, self.statistics, strict=True)
        ]
        above = sum(value >= away for value in others)
        share = (1 + above) / (1 + len(others))
        return share if above else min(share, assumed)

    def _away(self, statistic: float, gain: float) -> tuple[float, float]:
        """Deviations above settings near in gain, and how many of them count."""
        logs = np.log(np.maximum(self.statistics, LEAST))
        weight, count = self._near(gain)
        mean = float(weight @ logs)
        square = float(weight @ (logs - mean) ** 2) * count / (count - 1)
        spread = np.sqrt(square * (1 + 1 / count))
        away = np.log(max(statistic, LEAST)) - mean
        return float(away / max(spread, LEAST)), count

    def _near(self, gain: float) -> tuple[np.ndarray, float]:
        """Weights of the settings by gain, and how many count."""
        gains = np.array([cell[-1] for cell in self.cells], dtype=float)
        away, width = np.log(gains / gain), WIDTH
        enough = min(ENOUGH, 0.9 * len(gains))
        weight, count = np.zeros(len(gains)), 0.0
        while count < enough:
            weight = np.exp(-0.5 * (away / width) ** 2) + LEAST
            weight /= weight.sum()
            count = 1 / float((weight**2).sum())
            width *= 2
        return weight, count

    @property
    def slack(self) -> float:
        """By how much the truth is behind the best candidate, at most, in 90 %."""
        rank = int(np.ceil(COVERAGE * (len(self.cells) + 1))) - 1
        return float(np.sort(self.statistics)[min(rank, len(self.cells) - 1)])


def verdict(
    scores: Scores, null: Null, candidates: Mapping[str, Row], gain: float
) -> Verdict:
    """Say what explains the runs.

    Args:
        scores: of all candidates.
        null: of runs without a change.
        candidates: by name.
        gain: that the runs were told to have.
    """
    p_gap = null.chance(scores.statistic, gain)
    ranked = scores.ranked
    best = ranked[0]
    inside = [name for name in ranked if scores.worse(name) <= null.slack]
    left = scores.costs[best] / scores.size
    p_misfit = float((1 + (null.left >= left).sum()) / (1 + len(null.left)))
    second = next((n for n in ranked if n not in _class(best, candidates)), best)
    said = partial(
        Verdict,
        p_gap=p_gap,
        p_misfit=p_misfit,
        second=(second,),
        margin=scores.worse(second),
    )
    most = EXCESS * null.left.max()
    if p_gap > LEVEL and scores.nothing / scores.size <= most:
        return said(
            kind="no gap",
            named=(),
            sets=((),) if p_gap > 1 - COVERAGE else ((), (best,)),
            angle=float("nan"),
            sentence="These runs differ from the nominal law by no more than runs "
            f"without a change do; the nearest explanation would be {best}.",
            change=_excite(inside, candidates),
        )
    if left > most:
        return said(
            kind="none of the library",
            named=(),
            sets=tuple((name,) for name in inside),
            angle=float("nan"),
            sentence=f"There is a gap; {best} comes nearest, but leaves "
            f"{left / null.left.max():.1f} times what the worst setting without a "
            "change leaves.",
        )
    return _named(scores, inside, candidates, said, second)


def _named(
    scores: Scores,
    inside: Sequence[str],
    candidates: Mapping[str, Row],
    said: partial[Verdict],
    second: str,
) -> Verdict:
    best, text = inside[0], _text(scores, inside[0], candidates)
    sets = tuple((name,) for name in inside)
    if len(inside) == 1:
        return said(
            kind="effect",
            named=sets,
            sets=sets,
            angle=float("nan"),
            sentence=f"{text} explains the gap; {second} comes second.",
        )
    angle = _angle(scores.signatures[best], scores.signatures[inside[1]])
    others = " or ".join(_text(scores, name, candidates) for name in inside[1:])
    return said(
        kind="either",
        named=sets,
        sets=sets,
        angle=angle,
        sentence=f"{text}, or {others}: these runs can not tell (the first two differ "
        f"by {angle:.0f} deg).",
        change=_excite(inside, candidates),
    )


def _class(name: str, candidates: Mapping[str, Row]) -> set[str]:
    return {name, *candidates[name].aliases}


def _text(scores: Scores, name: str, candidates: Mapping[str, Row]) -> str:
    item, value = candidates[name], scores.magnitudes[name]
    unit = f" {item.unit}" if item.unit != "1" else ""
    return f"{name} ({item.parameter} = {value:.3g}{unit})"


def _excite(names: Sequence[str], candidates: Mapping[str, Row]) -> str:
    wanted = dict.fromkeys(candidates[name].excite for name in names[:3])
    return f"Record {'; '.join(wanted)}, at a low gain." if wanted else ""


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    size = np.linalg.norm(one) * np.linalg.norm(other)
    cosine = abs(one @ other) / max(size, 1e-12)
    return float(np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))))
