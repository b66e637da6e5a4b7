"""LeRobotDataset: Parquet files of frames, and meta/info.json.

Versions 2 (a file per episode) and 3 (many episodes a file). Read are `action`,
`observation.state`, `timestamp` [s] and `episode_index`; pictures are not. An action
is what was told from its frame on. What their numbers mean is the robot's own matter:
degrees, radians, or shares of a range from -100 to 100.

Format: https://github.com/huggingface/lerobot
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table

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
    info = _info(path / "meta" / "info.json")
    frames = _frames(path)
    columns = []
    for feature, role in ROLES.items():
        values = frames[feature]
        names = _names(info.get("features", {}).get(feature, {}), values.shape[1])
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


def _info(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FormatError(f"{path} cannot be read as JSON ({error}).") from None
    if not isinstance(content, dict) or not isinstance(content.get("features"), dict):
        raise FormatError(f"{path} names no features; a LeRobotDataset does.")
    return content


def _names(feature: Any, count: int) -> list[str]:
    """Names of a feature's entries: a list, or a table with one."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        lists = [item for item in names.values() if isinstance(item, list)]
        names = lists[0] if lists else list(names)
    return tables.named(names if isinstance(names, list) else (), count)


def _frames(path: Path) -> dict[str, np.ndarray]:
    import pyarrow
    from pyarrow import parquet

    wanted = ["timestamp", "episode_index", *ROLES]
    files = sorted(path.glob("data/**/*.parquet"))
    if not files:
        raise FormatError(f"{path} has no frames (data/**/*.parquet).")
    parts: dict[str, list[np.ndarray]] = {name: [] for name in wanted}
    for file in files:
        try:
            table = parquet.read_table(file, columns=wanted)
            for name in wanted:
                rows = table.column(name).to_pylist()
                parts[name].append(np.array(rows, dtype=float))
        except (pyarrow.ArrowException, OSError, KeyError, TypeError, ValueError) as e:
            first = str(e).splitlines()[0]
            raise FormatError(
                f"{file} needs frames with {', '.join(wanted)} ({first})."
            ) from None
    try:
        made = {name: np.concatenate(items) for name, items in parts.items()}
    except ValueError:
        raise FormatError(f"{path}: frames differ in size between files.") from None
    for name in ROLES:
        if made[name].ndim != 2:
            raise FormatError(f"{path}: {name} needs a list of numbers in each frame.")
    order = np.lexsort((made["timestamp"], made["episode_index"]))
    return {
        name: np.squeeze(values[order]) if values.ndim < 2 else values[order]
        for name, values in made.items()
    }
