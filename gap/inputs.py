"""Recordings and nominal models by what a user calls them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns import models
from bns.errors import BnsError, FormatError, OutOfBoundsError, UnknownNameError
from bns.gap.model import GapModel
from bns.worlds.trial import Trial

IMPORTERS: Mapping[str, str] = {
    "khepera3_odometry": "wheel speeds of a Khepera III beside its laser's motion",
    "kscale_sts3215": "runs of a Feetech servo on a lever (index.csv, runs.npz)",
    "mrclam6": "robots told speeds, seen by motion capture (RobotN_*.dat)",
    "xl330": "runs of a Dynamixel servo on a lever, one JSON file each",
}
"""readers of known recordings, and what they read"""

ODOMETRY = "khepera3_odometry"
SERVO = "servo_pendulum"


def model(name: str, *, threads: int = 2) -> GapModel:
    """The nominal model called `name`.

    Args:
        name: a robot of this package, or the TOML file of a user's own model.
        threads: of the physics.

    Raises:
        BnsError: there is no such model, or it can not be diagnosed.
    """
    if name.endswith(".toml"):
        from bns.gap.own_model import OwnModel

        return OwnModel.read(name, threads=threads)
    if name.endswith(".xml"):
        raise BnsError(
            f"{name} alone does not say what is told and seen: give a TOML file that "
            "maps its channels (docs/gap_your_robot.md)."
        )
    kind = models.robot(name).kind
    if kind == "wheeled":
        from bns.gap.wheeled import WheeledModel

        return WheeledModel(name, threads=threads)
    if kind == "servo":
        from bns.gap.servo_model import ServoModel

        return ServoModel()
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
) -> list[Trial]:
    """All trials of some recordings, pooled.

    Args:
        paths: dataset directories; or CSV or MCAP logs with `columns`; or directories
            that `importer` reads.
        model: which they are for.
        columns: TOML file that maps the columns of logs to channels.
        importer: one of `IMPORTERS`.
        only: ``name=value``: keep trials whose conditions say so.

    Raises:
        BnsError: something is missing, malformed, or of another robot.
    """
    if importer and columns:
        raise BnsError("Give --importer or --columns, not both.")
    found = [trial for path in paths for trial in _read(path, model, columns, importer)]
    for text in only:
        name, _, value = text.partition("=")
        known = sorted({key for trial in found for key in trial.conditions})
        if not value or (known and name not in known):
            raise UnknownNameError("condition (write name=value)", text, known)
        found = [t for t in found if _same(t.conditions.get(name), value)]
    if not found:
        raise BnsError("No trial is left: nothing was recorded, or --only drops all.")
    _of_robot(found, model)
    return [_fitting(trial, model) for trial in found]


def _read(path: str, model: GapModel, columns: str, importer: str) -> list[Trial]:
    from bns.worlds import dataset, importing

    if importer:
        return _imported(importer, path)
    if Path(path).is_dir():
        return list(dataset.read(path).trials)
    if hasattr(model, "read_log"):
        return model.read_log(path)
    if not Path(path).exists():
        raise FormatError(f"{path} is neither a dataset directory nor a log.")
    if not columns:
        raise BnsError(f"{path} is no dataset directory; a log needs --columns FILE.")
    if path.endswith(".mcap"):
        return importing.from_mcap(path, columns)
    return importing.from_csv(path, columns)


def _imported(name: str, path: str) -> list[Trial]:
    from importlib import import_module

    if name not in IMPORTERS:
        raise UnknownNameError("importer", name, IMPORTERS)
    reader: Any = import_module(f"bns.gap.importing.{name}")
    if name == "mrclam6":
        return [t for n in reader.robots(path) for t in reader.read(path, n)]
    found = reader.read(path)
    return [found] if isinstance(found, Trial) else list(found)


def _same(given: object, wanted: str) -> bool:
    if isinstance(given, int | float):
        try:
            return bool(np.isclose(float(wanted), given))
        except ValueError:
            return False
    return str(given) == wanted


def _of_robot(found: Sequence[Trial], model: GapModel) -> None:
    others = sorted({t.robot for t in found if t.robot and t.robot != model.name})
    if others:
        raise BnsError(
            f"The recording is of {', '.join(others)}, the model is {model.name!r}; "
            "give the --model that was recorded."
        )


def _fitting(trial: Trial, model: GapModel) -> Trial:
    """A trial with the observed channels of the model alone, if it has them."""
    given = {channel.name: channel.unit for channel in trial.channels}
    for channel in model.channels:
        if given.get(channel.name) != channel.unit:
            return trial  # `check` says what is wrong
    if tuple(trial.channels) == tuple(model.channels):
        return trial
    names = [channel.name for channel in model.channels]
    observed = np.stack([trial.channel(name) for name in names], axis=1)
    return trial.replace(observed=observed, channels=tuple(model.channels))


def tellable(found: Sequence[Trial], model: GapModel) -> None:
    """Stop at commands that the model can not execute.

    Raises:
        BnsError: other command channels, or speeds beyond the robot's limits.
    """
    known = limits(model)
    for number, trial in enumerate(found):
        if not len(trial.commands):
            raise BnsError(
                f"Trial {number} has no commands, so that it can not be simulated; map "
                f"columns to {', '.join(known) or 'the commands'}."
            )
        for column, channel in enumerate(trial.commands.channels if known else ()):
            if channel.name not in known:
                raise BnsError(
                    f"Trial {number} has the command channel {channel.name!r}; model "
                    f"{model.name!r} is told {', '.join(known)}."
                )
            low, high, unit = known[channel.name]
            margin = 1e-6 * (high - low)
            values = trial.commands.values[:, column]
            for value in (float(values.min()), float(values.max())):
                if not low - margin <= value <= high + margin:
                    told = f"trial {number}: {channel.name}"
                    raise OutOfBoundsError(told, value, low, high, unit)


def limits(model: GapModel) -> dict[str, tuple[float, float, str]]:
    """Lowest and highest command and its unit by channel; empty if not known."""
    own = getattr(model, "limits", None)
    if own is not None:
        return dict(own)
    if model.name not in models.names():
        return {}
    robot = models.robot(model.name)
    if robot.kind != "wheeled":
        return {}
    return {c.name: (c.low, c.high, c.unit) for c in robot.commands}
