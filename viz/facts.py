"""Key figures of a batch of runs, as numbers and in words."""

import math
from dataclasses import dataclass

import numpy as np

from bns import stats
from bns.experiment.record import RunRecord
from bns.stats import Interval
from bns.viz import scene
from bns.viz.charts import DEGREES, MILLIMETRES
from bns.worlds.damage import Event

NEVER = "never"


@dataclass(frozen=True)
class Facts:
    """What happened in a batch of R runs over T trials.

    Attributes:
        label: name of the batch in comparisons.
        runs: R.
        trials: T.
        solved: runs that solved before the damage (or at all, undamaged).
        to_solve: trials until the first solved one, median and interval.
        onset: first damaged trial, counted from 0; None without damage.
        recovered: runs that recovered.
        to_recover: trials from the onset until solved again, median and interval.
        last_solved: runs whose last trial solved the task.
    """

    label: str
    runs: int
    trials: int
    solved: int
    to_solve: Interval
    onset: int | None
    recovered: int
    to_recover: Interval | None
    last_solved: int

    @classmethod
    def of(cls, record: RunRecord, label: str = "") -> "Facts":
        """The facts of a record."""
        waits, back = to_solve(record), stats.trials_to_recover(record)
        hit = ~np.isnan(back)
        onset = int(record.damage_onset[hit].min()) if hit.any() else None
        return cls(
            label=label,
            runs=record.replicates,
            trials=record.trials,
            solved=int(np.isfinite(waits).sum()),
            to_solve=stats.median_interval(waits),
            onset=onset,
            recovered=int(np.isfinite(back).sum()),
            to_recover=stats.median_interval(back[hit]) if hit.any() else None,
            last_solved=int((record["solved"][:, -1] > 0).sum()),
        )


def foresees(record: RunRecord) -> bool:
    """Whether the learner said where its robots would go."""
    return bool(np.isfinite(record.predicted).any())


def who(record: RunRecord) -> str:
    """What foresees, in a word: the SNN where the learner has one."""
    return "SNN" if "snn_forward" in record.columns else "learner"


def to_solve(record: RunRecord) -> np.ndarray:
    """Trials until first solved, ``(R,)``; inf = never, or not before the damage."""
    waits = stats.trials_to_solve(record)
    onset = np.where(record.damage_onset < 0, record.trials, record.damage_onset)
    return np.where(waits <= onset, waits, np.inf)


def interval(value: Interval | None) -> str:
    """A median and its interval: ``12 (95 % interval 9 to 15)``."""
    if value is None:
        return "-"
    if not math.isfinite(value.value):
        return NEVER
    return f"{value.value:g}{_spread(value)}"


def _spread(value: Interval) -> str:
    """The interval in brackets; nothing where there are too few runs for one."""
    if not math.isfinite(value.low):
        return ""
    high = f"{value.high:g}" if math.isfinite(value.high) else NEVER
    return f" (95 % interval {value.low:g} to {high})"


def sentences(record: RunRecord, facts: Facts) -> list[str]:
    """What was run and what happened, in plain sentences."""
    config = record.config
    runs = "One run" if facts.runs == 1 else f"{facts.runs} runs"
    name = scene.picture(config).name
    found = [
        f"{runs} of the {name} task by a {config.world.robot} in the "
        f"{config.world.name} world, {facts.trials} trials each.",
        _solving(facts),
    ]
    if facts.onset is not None:
        found.append(_damage(record, facts.onset))
        found.append(_recovering(facts))
    return found


def _needed(value: Interval) -> str:
    return f"needed {value.value:g} trials{_spread(value)}"


def _solving(facts: Facts) -> str:
    when = "" if facts.onset is None else " before the damage"
    if facts.solved == 0:
        return f"None solved the task{when}."
    text = f"{facts.solved} of {facts.runs} solved the task{when}"
    if math.isfinite(facts.to_solve.value):
        text += f"; the median run {_needed(facts.to_solve)}"
    return text + "."


def _damage(record: RunRecord, onset: int) -> str:
    known = [f"{_doc(text)} ({text})" for text in record.config.world.damage]
    damage = "; ".join(known) or "how is not in the settings"
    return (
        f"From trial {onset} on (the first is trial 0) the robot was damaged: {damage}."
    )


def _doc(text: str) -> str:
    """What an effect does, in its own words."""
    return Event.parse(text).effect.doc


def _recovering(facts: Facts) -> str:
    if facts.recovered == 0:
        left = facts.trials - (facts.onset or 0)
        return f"None recovered within the {left} trials that were left."
    text = f"{facts.recovered} of {facts.runs} recovered"
    if facts.to_recover and math.isfinite(facts.to_recover.value):
        text += f"; the median run {_needed(facts.to_recover)}"
    return text + "."


def rows(record: RunRecord, facts: Facts) -> list[tuple[str, str, str]]:
    """The table of key figures: name, value, explanation."""
    meaning = scene.picture(record.config).solved
    found = [
        (
            "Solved" + ("" if facts.onset is None else " before damage"),
            f"{facts.solved} of {facts.runs} runs",
            f"{meaning} in one trial",
        ),
        ("Trials to solve", interval(facts.to_solve), "median over all runs"),
    ]
    if facts.onset is not None:
        found += [
            (
                "Recovered",
                f"{facts.recovered} of {facts.runs} runs",
                f"{meaning} again, while damaged",
            ),
            (
                "Trials to recover",
                interval(facts.to_recover),
                "median over all runs, counted from the first damaged trial",
            ),
        ]
    last = f"{facts.last_solved} of {facts.runs} runs"
    found.append(("Solved in the last trial", last, "whether it lasts"))
    if "solved_best" in record.columns:
        held = int((record["solved_best"][:, -1] > 0).sum())
        value = f"{held} of {facts.runs} runs"
        found.append(
            ("Deployed, it solves", value, "what would be run if trials ended there")
        )
    return found + _errors(record, facts)


def _errors(record: RunRecord, facts: Facts) -> list[tuple[str, str, str]]:
    """SNN error at the moments that matter, where a learner has one."""
    if "snn_forward" not in record.columns:
        return []
    moments = [("in the first trial", 0), ("in the last trial", record.trials - 1)]
    if facts.onset is not None:
        at = facts.onset
        moments[1:1] = [("just before damage", at - 1), ("in the onset trial", at)]
    position = np.hypot(record["snn_forward"], record["snn_left"]) * MILLIMETRES
    turn = record["snn_turn"] * DEGREES
    return [
        (
            f"SNN error {name}",
            f"{_plain(position[:, trial])} mm, {_plain(turn[:, trial])} deg",
            "RMS per command, before training on it; median over runs" * (at == 0),
        )
        for at, (name, trial) in enumerate(moments)
        if trial >= 0
    ]


def _plain(values: np.ndarray) -> str:
    """Median of what is finite, to three digits, never with an exponent."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "?"
    middle = float(np.median(finite))
    return f"{middle:.0f}" if middle >= 100 else f"{middle:.3g}"
