"""Trials for other tools: a LeRobotDataset, or one Parquet table.

A LeRobotDataset (version 2.1, https://github.com/huggingface/lerobot) has an episode a
trial, frames at a fixed rate, `action` (what the robot is told at the frame) and
`observation.state` (what is observed; between two samples on the line through both).
Frames whose sample was lost hold NaN. The table has a row per sample as it was
recorded, `replicate`, `trial`, `time` [s], `command.NAME` as it holds then, and the
observed channels; the unit of each column is in its metadata.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns import __version__
from bns.errors import BnsError
from bns.storage import files, parquet
from bns.worlds.checks import bounded
from bns.worlds.data.dataset import Dataset
from bns.worlds.trial import Trial

CHUNK = 1000
"""episodes of a directory"""
EPISODE = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
ACTION, STATE = "action", "observation.state"
COUNTS = ("frame_index", "episode_index", "index", "task_index")
FIGURES: Mapping[str, Callable[..., Any]] = {
    "min": np.nanmin,
    "max": np.nanmax,
    "mean": np.nanmean,
    "std": np.nanstd,
}


def lerobot(
    data: Dataset, directory: Path | str, *, fps: float = 0.0, task: str = ""
) -> Path:
    """Write trials as a LeRobotDataset; it appears complete or not at all.

    Args:
        data: of one robot.
        directory: to create.
        fps: frames a second, a whole number; 0 = as the samples of the first trial
            have it.
        task: what the robot did, a sentence; "" = its name.

    Returns:
        The directory.

    Raises:
        BnsError: the directory exists, or a trial without commands.
        StorageError: it cannot be written.
    """
    directory = Path(directory)
    _told(data)
    rate = round(bounded("fps", fps or _rate(data.trials[0]), 1, 1e4, "1/s"))
    said = task or f"drive the {data.robot}"

    def fill(temporary: Path) -> None:
        """Write all files of the dataset into a directory."""
        first, rows = 0, []
        for number, trial in enumerate(data.trials):
            frames = _frames(trial, rate, number, first)
            first += len(frames["timestamp"])
            name = EPISODE.format(episode_chunk=number // CHUNK, episode_index=number)
            (temporary / name).parent.mkdir(parents=True, exist_ok=True)
            parquet.write(temporary / name, _columns(frames))
            rows.append(_episode(number, frames, said))
        _meta(temporary / "meta", data, rate, said, rows)

    _new(directory, fill)
    return directory


def table(data: Dataset, path: Path | str) -> Path:
    """Write trials as one Parquet table.

    Args:
        data: of one robot.
        path: of the file.

    Returns:
        The file.

    Raises:
        BnsError: the file exists, or a trial without commands.
        StorageError: it cannot be written.
    """
    import pyarrow

    path = Path(path)
    if path.exists():
        raise BnsError(f"{path} exists and is not overwritten; give another --out.")
    _told(data)
    parts = [
        _samples(*item)
        for item in zip(data.replicates, data.numbers, data.trials, strict=True)
    ]
    units = {"time": "s"} | {channel.name: channel.unit for channel in data.channels}
    told = data.trials[0].commands.channels
    units |= {f"command.{channel.name}": channel.unit for channel in told}
    columns = {
        name: np.concatenate([part[name] for part in parts]) for name in parts[0]
    }
    fields = [
        pyarrow.field(name, pyarrow.from_numpy_dtype(values.dtype), metadata=(
            {"unit": units[name]} if name in units else None
        ))
        for name, values in columns.items()
    ]  # fmt: skip
    schema = pyarrow.schema(fields, metadata={"robot": data.robot})
    made = pyarrow.table(list(map(pyarrow.array, columns.values())), schema=schema)
    files.write_bytes(path, parquet.encode(made))
    return path


def _new(directory: Path, fill: Any) -> None:
    if directory.exists():
        raise BnsError(
            f"{directory} exists and is not overwritten; give another --out."
        )

    def begin(temporary: Path) -> None:
        temporary.mkdir()
        fill(temporary)

    files.replace(directory, begin)


def _told(data: Dataset) -> None:
    for number, trial in enumerate(data.trials):
        if not len(trial.commands):
            raise BnsError(f"Trial {number} has no commands: it cannot be exported.")


def _rate(trial: Trial) -> float:
    steps = np.diff(trial.times)
    steps = steps[steps > 0]
    return float(np.clip(1 / np.median(steps), 1, 1e4)) if len(steps) else 1.0


def _held(trial: Trial, moments: np.ndarray) -> np.ndarray:
    """What the robot is told at moments [s], shape ``(F, C)``."""
    ends = trial.times[trial.boundaries[1:]]
    which = np.searchsorted(ends, moments + 1e-9, side="right")
    return trial.commands.values[np.minimum(which, len(trial.commands) - 1)]


def _samples(replicate: int, number: int, trial: Trial) -> dict[str, np.ndarray]:
    count = len(trial.times)
    told = _held(trial, trial.times)
    names = [channel.name for channel in trial.commands.channels]
    seen = [channel.name for channel in trial.channels]
    return {
        "replicate": np.full(count, replicate),
        "trial": np.full(count, number),
        "time": trial.times,
        **{f"command.{name}": told[:, at] for at, name in enumerate(names)},
        **{name: trial.observed[:, at] for at, name in enumerate(seen)},
    }


def _frames(trial: Trial, rate: int, number: int, first: int) -> dict[str, np.ndarray]:
    """The frames of an episode; those before it in the dataset are `first`."""
    begin, end = trial.times[0], trial.times[-1]
    count = int(np.floor((end - begin) * rate + 1e-6)) + 1
    moments = begin + np.arange(count) / rate
    seen = [np.interp(moments, trial.times, column) for column in trial.observed.T]
    return {
        ACTION: _held(trial, moments).astype(np.float32),
        STATE: np.stack(seen, axis=1).astype(np.float32),
        "timestamp": (np.arange(count) / rate).astype(np.float32),
        "frame_index": np.arange(count),
        "episode_index": np.full(count, number),
        "index": first + np.arange(count),
        "task_index": np.zeros(count, np.int64),
    }


def _columns(frames: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Frames as columns; lists of more than one number as such, as LeRobot has them."""
    import pyarrow

    made: dict[str, Any] = {}
    for name, values in frames.items():
        if values.ndim == 1 or values.shape[1] == 1:
            made[name] = values.ravel()
        else:
            flat = pyarrow.array(values.ravel())
            made[name] = pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])
    return made


def _episode(
    number: int, frames: Mapping[str, np.ndarray], task: str
) -> dict[str, Any]:
    """What the meta files hold of an episode."""
    stats = {}
    for name, values in frames.items():
        rows = np.atleast_2d(values.T).T.astype(np.float64)
        seen = np.where(np.isfinite(rows).any(0), rows, 0.0)
        stats[name] = {key: of(seen, 0).tolist() for key, of in FIGURES.items()}
        stats[name]["count"] = [len(rows)]
    length = len(frames["timestamp"])
    return {
        "about": {"episode_index": number, "tasks": [task], "length": length},
        "stats": {"episode_index": number, "stats": stats},
    }


def _meta(
    place: Path, data: Dataset, rate: int, task: str, rows: Sequence[dict[str, Any]]
) -> None:
    """Write the files of `meta`."""
    place.mkdir()
    lines = {
        "episodes": [row["about"] for row in rows],
        "episodes_stats": [row["stats"] for row in rows],
        "tasks": [{"task_index": 0, "task": task}],
    }
    for name, items in lines.items():
        text = "".join(json.dumps(item) + "\n" for item in items)
        files.write_text(place / f"{name}.jsonl", text)
    info = {
        "codebase_version": "v2.1",
        "robot_type": data.robot,
        "total_episodes": len(rows),
        "total_frames": sum(row["about"]["length"] for row in rows),
        "total_tasks": 1,
        "total_videos": 0,
        "total_chunks": -(-len(rows) // CHUNK),
        "chunks_size": CHUNK,
        "fps": rate,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": EPISODE,
        "video_path": None,
        "features": _features(data),
        "made_by": f"bns-testbed {__version__}",
    }
    files.write_text(place / "info.json", json.dumps(info, indent=4) + "\n")


def _features(data: Dataset) -> dict[str, Any]:
    listed = {ACTION: data.trials[0].commands.channels, STATE: data.channels}
    features: dict[str, Any] = {
        name: {
            "dtype": "float32",
            "shape": [len(channels)],
            "names": [channel.name for channel in channels],
            "units": [channel.unit for channel in channels],
        }
        for name, channels in listed.items()
    }
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    for name in COUNTS:
        features[name] = {"dtype": "int64", "shape": [1], "names": None}
    return features
