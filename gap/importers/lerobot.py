"""LeRobotDataset: Parquet files of frames, and meta/info.json.

Versions 2 (a file per episode) and 3 (many episodes a file). Read are `action`,
`observation.state`, `timestamp` [s] and `episode_index`; pictures are not. An action
is what was told from its frame on. What their numbers mean is the robot's own matter:
degrees, radians, or shares of a range from -100 to 100.

Format: https://github.com/huggingface/lerobot
"""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.storage import parquet, reading

ROLES = {"action": tables.TOLD, "observation.state": tables.SEEN}
ENDS = {
    ".pos": tables.POSITION,
    ".vel": tables.SPEED,
    ".torque": tables.EFFORT,
    ".effort": tables.EFFORT,
}


def read(path: Path) -> Table:
    """The table of a dataset; columns are named as `action.NAME`, trials by episode.

    Raises:
        FormatError: no frames, or a feature missing or of another size than told.
    """
    features = _info(path / "meta" / "info.json")
    frames = _frames(path)
    columns = []
    for feature, role in ROLES.items():
        values = frames[feature]
        names = _names(features.get(feature, _Feature()), values.shape[1])
        for at, name in enumerate(names):
            part, quantity = name, ""
            for end, kind in ENDS.items():
                if name.endswith(end):
                    part, quantity = name.removesuffix(end), kind
            part = "" if part.isdigit() else part
            label = f"{feature}.{name}"
            columns.append(Column(label, values[:, at], role, part, quantity))
    return tables.stamped(
        frames["timestamp"], columns, "LeRobotDataset", frames["episode_index"]
    )


class _Feature(msgspec.Struct):
    """What is used of a feature in meta/info.json."""

    names: list[Any] | dict[str, Any] | None = None


class _Info(msgspec.Struct):
    """What is used of meta/info.json."""

    features: dict[str, _Feature]


def _info(path: Path) -> dict[str, _Feature]:
    todo = "A LeRobotDataset names its features there."
    return reading.typed(reading.read_json(path), _Info, path, todo=todo).features


def _names(feature: _Feature, count: int) -> list[str]:
    """Names of a feature's entries: a list, or a table with one."""
    names = feature.names
    if isinstance(names, dict):
        lists = [item for item in names.values() if isinstance(item, list)]
        names = lists[0] if lists else list(names)
    return tables.named(names or (), count)


def _frames(path: Path) -> dict[str, np.ndarray]:
    """The frames of all files, in the order of episodes and times."""
    wanted = ("timestamp", "episode_index", *ROLES)
    files = sorted(path.glob("data/**/*.parquet"))
    if not files:
        raise FormatError(f"{path} has no frames (data/**/*.parquet).")
    left, parts = reading.DATA, []
    for file in files:
        parts.append(parquet.foreign(file, wanted, most=left))
        left -= sum(values.nbytes for values in parts[-1].values())
    made = {}
    for name in wanted:
        columns = [part[name] for part in parts if len(part["timestamp"])]
        wide = name in ROLES
        if wide:  # a robot of one joint has numbers where others have lists
            columns = [c[:, None] if c.ndim == 1 else c for c in columns]
        widths = {column.shape[1:] for column in columns}
        if len(widths) != 1 or any(c.ndim != 1 + wide for c in columns):
            each = "a list of equally many numbers" if wide else "a number"
            raise FormatError(f"{path}: {name} needs {each} in each frame.")
        made[name] = np.concatenate(columns)
    if not all(np.isfinite(made[name]).all() for name in wanted[:2]):
        raise FormatError(f"{path}: a frame without a timestamp or an episode_index.")
    order = np.lexsort((made["timestamp"], made["episode_index"]))
    return {name: values[order] for name, values in made.items()}
