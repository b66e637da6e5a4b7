"""What `bns run` leaves beside the data, and what it says at the end."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bns import stats
from bns.errors import BnsError, install, missing
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.progress import Each, counting, uncounted, working

RECORDING = "recording.rrd"
REPORT = "report.html"
DRAWING = "figures"
"""name of the progress of a report"""


@contextmanager
def live(choice: str, config: RunConfig) -> Iterator[Callable | None]:
    """What streams each trial to a viewer, where that was asked for."""
    if choice != "live":
        yield None
        return
    from bns.viz import recording as viewer

    with viewer.stream(config) as on_trial:
        yield on_trial


def write(
    record: RunRecord, out: Path, *, recording: bool = True, report: bool = True
) -> None:
    """Write recording and report, then say where everything is.

    Without Rerun there is no recording, and a line says how to get one.

    Args:
        record: of a run.
        out: its directory.
        recording: whether to write the recording.
        report: whether to write the report.
    """
    made: dict[str, Path | str] = {"data": out}
    if report:
        with counting(DRAWING) as each:
            made |= attempt(
                "report", lambda: write_report([out], out / REPORT, each=each)
            )
    if recording and find_spec("rerun") is None:
        made["in 3D"] = f"{install('view')}, then bns view {out}"
    elif recording:
        with working("writing the recording"):
            made |= attempt(
                "recording", lambda: write_recording(record, out / RECORDING)
            )
    print(summary(record))
    for name, path in made.items():
        print(f"{name + ':':<11}{path}")


def attempt(name: str, make: Callable[[], Path]) -> dict[str, Path]:
    """What `make` wrote, by name; nothing, and a line that says why, where it failed.

    A picture that cannot be made must not take the data with it.
    """
    try:
        return {name: make()}
    except (BnsError, OSError) as error:
        why = str(error)
    except ModuleNotFoundError as error:
        why = missing(error)
        if not why:
            raise
    print(f"bns: no {name}: {why}", file=sys.stderr)
    return {}


def write_report(
    directories: list[Path], path: Path, *, each: Each = uncounted
) -> Path:
    """The HTML report on runs.

    Args:
        directories: of the runs.
        path: file to write.
        each: goes through the figures, and may count them.
    """
    from bns.viz import report

    report.write(directories, path, each=each)
    return path


def write_recording(record: RunRecord, path: Path) -> Path:
    """The recording of the most typical replicate whose samples were kept."""
    from bns.viz import recording

    os.environ.setdefault("RERUN_ANALYTICS", "0")
    replicate, dense = shown(record)
    recording.write(record, dense, path, replicate=replicate)
    return path


def shown(record: RunRecord) -> tuple[int, dict[int, Any]]:
    """The most typical replicate whose samples were kept, and its trials by number."""
    from bns.viz import choices
    from bns.worlds.data import dataset

    kept = min(record.config.record_replicates, record.replicates)
    replicate = choices.typical(record if not kept else _first(record, kept))
    if not kept:
        return replicate, {}
    found = dataset.read(Path(record.directory) / "dataset")
    known = zip(found.replicates, found.numbers, found.trials, strict=True)
    return replicate, {
        number: trial for run, number, trial in known if run == replicate
    }


def summary(record: RunRecord) -> str:
    """What happened, in words."""
    solved = stats.trials_to_solve(record)
    runs = "1 run" if record.replicates == 1 else f"{record.replicates} runs"
    lines = [f"{record.trials} trials of {runs}, numbered from 0."]
    lines.append(sentence("Solved", solved, "after {} trials"))
    onset, damage = int(record.damage_onset.max()), record.config.world.damage
    if onset < 0:
        lines.append("No damage.")
    elif onset >= record.trials:
        lines.append(f"Damage from trial {onset} on was not met: {'; '.join(damage)}.")
    else:
        lines.append(f"Damage from trial {onset} on: {'; '.join(damage)}.")
        recovered = stats.trials_to_recover(record)
        lines.append(sentence("Recovered", recovered, "within {} trials"))
    return "\n".join(lines)


def sentence(word: str, values: np.ndarray, phrase: str) -> str:
    """How many runs got somewhere, and when.

    Args:
        word: what they did, as in "Solved".
        values: trials that each run needed, ``(R,)``; infinity = it did not.
        phrase: with the place of the number, as in "after {} trials".
    """
    reached = np.isfinite(values)
    text = f"{word} by {reached.sum()} of {len(values)}"
    if not reached.any():
        return f"{text}."
    middle = stats.median_interval(values)
    if middle.value == np.inf:
        return f"{text}. Half of the runs or more did not, so there is no median."
    text += f", {phrase.format(number(middle.value))} in the median"
    if middle.low == -np.inf:
        return f"{text}."
    low, high = number(middle.low), number(middle.high)
    return f"{text} (95 % interval {low} to {high})."


def number(value: float) -> str:
    """A count in words: whole where it is, "never" for infinity."""
    return "never" if value == np.inf else f"{value:g}"


def _first(record: RunRecord, runs: int) -> RunRecord:
    from dataclasses import replace

    return replace(
        record,
        columns={name: value[:runs] for name, value in record.columns.items()},
        sent=record.sent[:runs],
        poses=record.poses[:runs],
        predicted=record.predicted[:runs],
        damage_onset=record.damage_onset[:runs],
    )
