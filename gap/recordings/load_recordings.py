"""Recordings and nominal models by what a user calls them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns import models
from bns.errors import BnsError, FormatError, OutOfBoundsError, UnknownNameError
from bns.gap.importers import tables
from bns.gap.models.base import GapModel
from bns.gap.recordings import trial_conditions, trial_selection
from bns.worlds.trial import Commands, Trial

IMPORTERS: Mapping[str, str] = {
    "khepera3_odometry": "wheel speeds of a Khepera III beside its laser's motion",
    "kscale_sts3215": "runs of a Feetech servo on a lever (index.csv, runs.npz)",
    "mrclam6": "robots told speeds, seen by motion capture (RobotN_*.dat)",
    "xl330": "runs of a Dynamixel servo on a lever, one JSON file each",
}
"""readers of known recordings, and what they read"""

ODOMETRY = "khepera3_odometry"
SERVO, UNICYCLE = "servo_pendulum", "irobot_create"
MODELS = {"kscale_sts3215": SERVO, "xl330": SERVO, "mrclam6": UNICYCLE}
"""what importers read is of these models"""

SAMPLES, WHOLE = 300, 1_500
"""samples of a trial that are used at most, more where all trials have fewer together:
more of them tell no more of its motion, and what has to be kept of their noise grows
with their square"""

RUN = "dataset"  # where the directory of a run keeps its recordings
SMOOTH = 0.01  # [s] over which robots move smoothly, and measurements scatter
PART = 20.0  # [s] length of the trials that long recordings are cut into

_WRITTEN = "`bns gap describe ROBOT.xml LOG` writes one (docs/gap_your_robot.md)"


def model(name: str, *, threads: int = 2) -> GapModel:
    """The nominal model called `name`.

    Args:
        name: a robot of this package, or the TOML file of a user's own model.
        threads: of the physics.

    Raises:
        BnsError: there is no such model, or it can not be diagnosed.
    """
    if name.endswith(".toml"):
        if not Path(name).is_file():
            raise BnsError(f"There is no description {name}: {_WRITTEN}.")
        from bns.gap.models.mjcf.model import OwnModel

        return OwnModel.read(name, threads=threads)
    if name == UNICYCLE:
        from bns.gap.models.unicycle import UnicycleModel

        return UnicycleModel()
    if name.endswith(".xml"):
        raise BnsError(
            f"{name} alone does not say what is told and seen, a TOML file does: "
            f"{_WRITTEN}."
        )
    kind = models.robot(name).kind
    if kind == "wheeled":
        from bns.gap.models.wheeled.model import WheeledModel

        return WheeledModel(name, threads=threads)
    if kind == "servo":
        from bns.gap.models.servo.model import ServoModel

        return ServoModel()
    if kind == "legged":
        from bns.gap.models.legged.model import WalkModel

        return WalkModel(name)
    raise BnsError(
        f"{name!r} is of kind {kind!r}, which the diagnosis does not know; describe it "
        "in a TOML file (docs/gap_your_robot.md)."
    )


def trials(
    paths: Sequence[str],
    model: GapModel,
    *,
    columns: str = "",
    importer: str = "",
    only: Sequence[str] = (),
    numbers: str = "",
) -> list[Trial]:
    """All trials of some recordings, pooled.

    Args:
        paths: dataset directories, or those of runs, which hold one; or CSV or MCAP
            logs with `columns`; or directories that `importer` reads.
        model: which they are for.
        columns: TOML file that maps the columns of logs to channels.
        importer: one of `IMPORTERS`.
        only: ``name=value``: keep trials whose conditions say so.
        numbers: of the trials to keep, counted in each recording (in each run of one)
            from 0, see `bns.gap.recordings.trial_selection.numbered`; empty means all.

    Raises:
        BnsError: something is missing, malformed, or of another robot.
    """
    if importer and columns:
        raise BnsError("Give --importer or --columns, not both.")
    wanted = trial_selection.numbered(numbers)
    found = [
        trial_conditions.labelled(
            trial, number, run=run, recording=path if len(paths) > 1 else None
        )
        for path in paths
        for run, number, trial in _read(path, model, columns, importer)
        if wanted(number)
    ]
    found = trial_selection.with_conditions(found, only)
    if not found:
        raise BnsError(
            "No trial is left: nothing was recorded, or --only and --trials drop all; "
            "trials are counted from 0."
        )
    _of_robot(found, model)
    most = max(SAMPLES, WHOLE // len(found))
    fitting = [thinned(_fitting(trial, model), most) for trial in found]
    return [on_grid(t, model.grid(t) if len(t.commands) else 0.0) for t in fitting]


def _read(
    path: str, model: GapModel, columns: str, importer: str
) -> Iterable[tuple[int | None, int, Trial]]:
    """Trials of a recording with their run, where there are several, and number."""
    from bns.worlds.data import dataset

    known = tables.reader(path) is not None
    own = model.logs and known
    if known and Path(path).is_dir() and not importer and not own:
        raise FormatError(
            f"{path} is a log of joints: describe its robot with `bns gap describe "
            f"MJCF {path} --out robot.toml`, then give --model robot.toml. Of a robot "
            "of `bns robots` give the run or dataset itself."
        )
    if Path(path).is_dir() and not importer and not own:
        inside = Path(path) / RUN
        found = dataset.read(inside if inside.is_dir() else path)
        several = len(set(found.replicates)) > 1
        runs = found.replicates if several else [None] * len(found.trials)
        return zip(runs, found.numbers, found.trials, strict=True)
    if importer:
        listed = _imported(importer, path)
    elif model.logs:
        listed = model.read_log(path, columns)
    else:
        listed = _log(path, columns)
    return ((None, number, trial) for number, trial in enumerate(listed))


def _log(path: str, columns: str) -> list[Trial]:
    from bns.worlds.data import importing

    if not Path(path).exists():
        raise FormatError(f"There is no {path}: give a dataset directory or a log.")
    if not columns:
        raise BnsError(
            f"{path} is no dataset directory. A log of a wheeled robot needs --columns "
            "FILE; one of a robot of your own needs --model FILE, which `bns gap "
            f"describe ROBOT.xml {path}` writes."
        )
    if path.endswith(".mcap"):
        return importing.from_mcap(path, columns)
    return importing.from_csv(path, columns)


def _imported(name: str, path: str) -> list[Trial]:
    from importlib import import_module

    if name not in IMPORTERS:
        raise UnknownNameError("importer", name, IMPORTERS)
    reader: Any = import_module(f"bns.gap.importers.{name}")
    if name == "mrclam6":
        numbers = reader.robots(path)
        if not numbers:
            raise FormatError(
                f"{path} holds no RobotN_Odometry.dat: give a directory of MRCLAM."
            )
        parts = [reader.read(path, n, seconds=PART) for n in numbers]
        return [trial for part in parts for trial in part]
    found = reader.read(path)
    return [found] if isinstance(found, Trial) else list(found)


def _of_robot(found: Sequence[Trial], model: GapModel) -> None:
    mine = Path(model.name).name
    others = sorted({t.robot for t in found if t.robot and Path(t.robot).name != mine})
    if others:
        raise BnsError(
            f"The recording is of {', '.join(others)}, the model is {model.name!r}; "
            "give the --model that was recorded."
        )


def _fitting(trial: Trial, model: GapModel) -> Trial:
    """A trial with the observed channels of the model alone (and light), if any."""
    given = {channel.name: channel.unit for channel in trial.channels}
    for channel in model.channels:
        if given.get(channel.name) != channel.unit:
            return trial  # `check` says what is wrong
    if tuple(trial.channels) == tuple(model.channels) or _sighted(trial, model):
        return trial
    names = [channel.name for channel in model.channels]
    observed = np.stack([trial.channel(name) for name in names], axis=1)
    return trial.replace(observed=observed, channels=tuple(model.channels))


def _sighted(trial: Trial, model: GapModel) -> bool:
    """Whether light was recorded beside the pose of a robot that can see."""
    from bns.gap.models.light import model as light_model

    return light_model.told_by(model, [trial])


def thinned(trial: Trial, most: int = SAMPLES) -> Trial:
    """A trial with every k-th sample that was seen, and those at ends of commands."""
    seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
    every = -(-len(seen) // most)
    if every <= 1:
        return trial
    kept = np.union1d(seen[::every], trial.boundaries)
    if len(kept) > 2 * most:  # more commands than samples wanted
        kept = np.union1d(seen[::every], trial.boundaries[[0, -1]])
    step = trial_conditions.sample_step(trial)
    apart = int(np.clip(SMOOTH / max(step, 1e-9), 1, every))
    rough = [
        np.diff(trial.observed[seen[at::apart]], n=3, axis=0) for at in range(apart)
    ]
    sizes = np.abs(np.concatenate(rough))
    sampled = {"step": step, "rough": np.median(sizes, axis=0).tolist()}
    return trial.replace(
        times=trial.times[kept],
        observed=trial.observed[kept],
        boundaries=np.searchsorted(kept, trial.boundaries),
        conditions={**trial.conditions, trial_conditions.SAMPLED: sampled},
        truth={},
    )


def on_grid(trial: Trial, step: float) -> Trial:
    """A trial whose commands end on the grid of a simulation.

    Each end is rounded by itself, so that rounding does not add up over many commands;
    commands shorter than a step fall away. What MuJoCo itself recorded is left as it
    is: there each command was rounded, as the models of the diagnosis do.

    Args:
        trial: recorded.
        step: of the simulation [s]; 0 = none.
    """
    told = trial.commands
    if not step or not len(told) or "mujoco" in trial.conditions:
        return trial
    ends = np.concatenate([[0.0], np.cumsum(told.durations)])
    steps = np.rint(ends / step)
    if np.abs(np.diff(steps) * step - told.durations).max() < 1e-9:
        return trial
    kept = np.flatnonzero(np.diff(steps) > 0)
    if not len(kept):
        return trial
    last = np.append(kept[1:], len(told)) - 1  # what falls away belongs to the former
    held = (steps[last + 1] - steps[kept]) * step
    bounds = np.append(trial.boundaries[kept], trial.boundaries[-1])
    return trial.replace(
        commands=Commands(told.values[kept], held, told.channels),
        boundaries=bounds,
        handled=trial.handled[kept],
    )


def tellable(found: Sequence[Trial], model: GapModel) -> None:
    """Stop at commands that the model can not execute.

    Raises:
        BnsError: other command channels, or speeds beyond the robot's limits.
    """
    known = limits(model)
    for place, trial in enumerate(found):
        label = trial_conditions.label(trial, place)
        if not len(trial.commands):
            raise BnsError(
                f"The {label} has no commands, so that it can not be simulated; map "
                f"columns to {', '.join(known) or 'the commands'}."
            )
        for column, channel in enumerate(trial.commands.channels if known else ()):
            if channel.name not in known:
                raise BnsError(
                    f"The {label} has the command channel {channel.name!r}; model "
                    f"{model.name!r} is told {', '.join(known)}."
                )
            low, high, unit = known[channel.name]
            margin = model.leeway * (high - low)
            values = trial.commands.values[:, column]
            for value in (float(values.min()), float(values.max())):
                if not low - margin <= value <= high + margin:
                    told = f"{label}: {channel.name}"
                    raise OutOfBoundsError(told, value, low, high, unit)


def limits(model: GapModel) -> dict[str, tuple[float, float, str]]:
    """Lowest and highest command and its unit by channel; empty if not known."""
    if model.limits:
        return dict(model.limits)
    if not models.known(model.name):
        return {}
    robot = models.robot(model.name)
    if robot.kind != "wheeled":
        return {}
    return {c.name: (c.low, c.high, c.unit) for c in robot.commands}
