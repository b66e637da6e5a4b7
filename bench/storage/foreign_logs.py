"""Logs of other tools, as small as they can be: of each format that is read."""

import csv
import json
from pathlib import Path

import numpy as np

TIMES = np.arange(6) * 0.02
GOALS = np.column_stack([np.sin(TIMES), np.cos(TIMES)])
SEEN = GOALS + 0.01
JOINTS = ("hip", "knee")


def pace(path: Path) -> Path:
    """A PACE file of two joints."""
    import torch

    content = {"time": TIMES, "dof_pos": SEEN, "des_dof_pos": GOALS}
    torch.save({name: torch.tensor(value) for name, value in content.items()}, path)
    return path


def sage(path: Path, *, unit=1e6) -> Path:
    """A SAGE motion; stamps count in a `unit`th of a second."""
    path.mkdir()
    (path / "joint_list.txt").write_text("\n".join(JOINTS) + "\n")
    for name, rows in (("control.csv", GOALS), ("state_motor.csv", SEEN)):
        late = 0.0 if name == "state_motor.csv" else 0.005
        with (path / name).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["type", "timestamp", "positions"])
            for time, row in zip(TIMES, rows, strict=True):
                stamp = 1e9 + (time + late) * unit
                writer.writerow(["X", stamp, json.dumps(row.tolist())])
    return path


def lerobot(path: Path, names=JOINTS) -> Path:
    """A LeRobotDataset of two episodes."""
    import pyarrow
    from pyarrow import parquet

    (path / "meta").mkdir(parents=True)
    (path / "data" / "chunk-000").mkdir(parents=True)
    feature = {"names": {"motors": [f"{name}.pos" for name in names]}}
    info = {"fps": 50, "features": dict.fromkeys(("action", "observation.state"))}
    info["features"] = {name: feature for name in info["features"]}
    (path / "meta" / "info.json").write_text(json.dumps(info))
    for episode in (1, 0):
        frames = {
            "timestamp": TIMES,
            "episode_index": np.full(6, episode),
            "action": list(GOALS + episode),
            "observation.state": list(SEEN + episode),
        }
        file = path / "data" / "chunk-000" / f"episode_{1 - episode:06d}.parquet"
        parquet.write_table(pyarrow.table(frames), file)
    return path


def mcap(path: Path) -> Path:
    """An MCAP log of joint states in JSON; commands are late, joints turned."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        log = Writer(file)
        log.start()
        channels = []
        for topic, schema in (("/joint_states", "JointState"), ("/cmd", "JointState")):
            number = log.register_schema(f"sensor_msgs/msg/{schema}", "jsonschema", b"")
            channels.append(log.register_channel(topic, "json", number))
        for time, goal, seen in zip(TIMES, GOALS, SEEN, strict=True):
            # names in another order than before: joints go by name
            for channel, row, late in (
                (channels[0], seen, 0.0),
                (channels[1], goal, 5e-3),
            ):
                turned = slice(None, None, -1 if time > 0.05 else 1)
                said = {"name": JOINTS[turned], "position": row[turned].tolist()}
                stamp = 10**18 + round((time + late) * 1e9)
                log.add_message(channel, stamp, json.dumps(said).encode(), stamp)
        log.finish()
    return path
