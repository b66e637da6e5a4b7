"""A small file of each kind that is read.

The logs of a servo on a pendulum and of odometry are made up, in the forms of two
readers. They are to be alike from run to run, no more; the physics is coarse.
"""

import csv
import gzip
import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bench.storage.campaigns import text, tiny
from bench.versions import ROOT

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


def make(home: Path) -> None:
    """Write all the files."""
    from bns.campaign import drive
    from bns.campaign.engines.registry import InlineEngine
    from bns.campaign.file import Campaign
    from bns.experiment.run import train

    campaign = tiny(2, trials=2)
    config = campaign.members[0].config
    from dataclasses import replace

    config = replace(config, replicates=2, record_replicates=1, trials=3, threads=1)
    train(config, home / "run")
    _plain(home / "run", home / "plain")
    asked = iter([False, False, True])
    train(config, home / "begun", stop=lambda: next(asked))
    file = home / "campaign.toml"
    file.write_text(text(2, trials=2, replicates=2))
    whole = Campaign(
        campaign.name,
        campaign.members,
        campaign.replicates,
        campaign.seed,
        campaign.batch_runs,
        text=file.read_text(),
    )
    drive.run(whole, home / "store", InlineEngine())
    _parts(home)
    _calibrations(home)
    _robots(home)
    _logs(home)
    _recordings(home)
    _tables(home)


def _plain(run: Path, copy: Path) -> None:
    """A run as it is stored where pyarrow is missing."""
    from bns.storage import parquet, tables

    shutil.copytree(run, copy)
    for path in list(copy.rglob("*.parquet")):
        table = parquet.read(path)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        tables.write_plain(path, columns)
        path.unlink()


def _tables(home: Path) -> None:

    pace(home / "pace.pt")
    sage(home / "sage")
    events = "timestamp,event\n1000000000.0,MOTION_START\n"
    (home / "sage" / "event.csv").write_text(events)
    lerobot(home / "lerobot")
    mcap(home / "ros2.mcap")
    with gzip.open(home / "own.csv.gz", "wb") as out:
        out.write((home / "own.csv").read_bytes())


def _parts(home: Path) -> None:
    """A part that is not compacted, a failure, nets, a diagnosis, answers, commands."""
    from bns.campaign.part import encode
    from bns.campaign.store import CampaignStore
    from bns.gap.planning import command_file
    from bns.storage import files
    from bns.worlds.static_snn import kinematic_nets
    from bns.worlds.trial import Commands

    store = CampaignStore.open(home / "store")
    loose = CampaignStore.create(home / "loose", "tiny", store.seed)
    for part in list(store.read())[:1]:
        loose.add(part.key, encode(part))
        (home / "part.parquet").write_bytes(encode(part))
    loose.fail("00ff", reason="it did not", attempts=2)
    kinematic_nets(hidden=5, patterns=60).save(home / "nets.npz")
    from bns.gap import store as gap_store

    gap_store.save(_diagnosis(), home / "gap")
    answer = {"kind": "none", "names": [], "aliases": {}}
    content = {"schema": "bns-gap-answers", "version": 1, "cases": {"a": answer}}
    files.write_json(home / "answers.json", content)
    commands = Commands([[0.1, 0.05], [-0.1, 0.2]], [0.5, 1.0])
    command_file.write(commands, home / "commands.csv")


def _diagnosis() -> Any:
    from bns.gap.records import Diagnosis, Fit, Verdict

    fit = Fit(("a",), ("b",), (1.0,), ((0.5, 1.5),), ("m",), 1.0, 2.0, 0.1, 3.0)
    none = Fit((), (), (), (), (), 1.0, 2.0, 0.1, 3.0)
    verdict = Verdict(
        "effect", (("a",),), (("a",),), 1.0, 0.01, 0.5, (), 2.0, "a it is"
    )
    parts: list[Mapping[str, Any]] = [{"share": [1.0, None]}, {}, {}, {"closed": 0.5}]
    return Diagnosis("khepera3", 3, ("one",), verdict, (fit, none), *parts)


def _calibrations(home: Path) -> None:
    from bns.hardware.driving.odometry import Wheels
    from bns.hardware.dynamixel import joints
    from bns.hardware.tracking.camera import Camera
    from bns.worlds.corrected import Corrected, _table

    Camera.overhead((1280, 720)).write(home / "camera.json")
    Wheels(left=0.0411, right=0.0409, axle=0.0885).write(home / "wheels.json")
    joints.write(home / "servos.toml", joints.read(), said="Zeros of a test.")
    import tomli_w

    world = Corrected("kitchen", "mujoco", "khepera3", ("wheel_gain:factor=0.9",), "x")
    text = tomli_w.dumps({"worlds": {"kitchen": _table(world)}})
    (home / "worlds.toml").write_text(text)


def _robots(home: Path) -> None:
    for name in ("burger", "arm"):
        shutil.copytree(ROOT / "examples" / name, home / name)
    (home / "law").mkdir()
    shutil.copy(ROOT / "models" / "ax12a" / "law.toml", home / "law" / "law.toml")


MAP = """robot = "khepera3"
[columns]
time = {column = "t", unit = "ms"}
x = {column = "px", unit = "mm"}
y = "py"
yaw = "heading"
left_speed = "vl"
right_speed = "vr"
"""
FIELDS = {
    "time": "log_time", "x": "/pose:x", "y": "/pose:y", "yaw": "/pose:yaw",
    "left_speed": "/speed:left", "right_speed": "/speed:right",
}  # fmt: skip


def _logs(home: Path) -> None:
    (home / "map.toml").write_text(MAP)
    rows = [
        f"{100 * k},{k},{k / 10},{k / 20},0.1,{0.1 + (k > 3) / 10}" for k in range(8)
    ]
    (home / "log.csv").write_text("t,px,py,heading,vl,vr\n" + "\n".join(rows) + "\n")
    head = "time,shoulder_goal,elbow_goal,shoulder,elbow\n"
    rows = [f"{k / 10},0.1,{0.1 * (k > 3)},{k / 50},{k / 60}" for k in range(8)]
    (home / "own.csv").write_text(head + "\n".join(rows) + "\n")
    from mcap.writer import Writer

    with (home / "log.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        pose = writer.register_channel("/pose", "json", schema)
        speed = writer.register_channel("/speed", "json", schema)
        for k in range(6):
            stamp = 1_700_000_000_000_000_000 + k * 100_000_000
            seen = json.dumps({"x": k, "y": 2 * k, "yaw": k / 10}).encode()
            told = json.dumps({"left": 0.1, "right": 0.1 * (k > 2)}).encode()
            writer.add_message(pose, stamp, seen, stamp)
            writer.add_message(speed, stamp, told, stamp)
        writer.finish()


def _recordings(home: Path) -> None:
    from bns.gap.importers import kscale_sts3215, xl330

    for name in ("khepera", "kscale", "xl330", "mrclam"):
        (home / name).mkdir()
    items = [{"T": 0.5, "phi_l": 1.0, "phi_r": 2.0, "sm": [0.01, 0.0, 0.1]}] * 5
    lines = "\n".join(map(json.dumps, items))
    (home / "khepera" / "lstraight.tuple").write_text(lines)
    known = dict.fromkeys(("axle", "l_diam", "r_diam", "l_x", "l_y", "l_theta"), 0.04)
    known |= {"covariance": (np.eye(6) * 1e-6).tolist()}
    (home / "khepera" / "lstraight_results.json").write_text(json.dumps(known))
    columns = list(kscale_sts3215.SOURCES.values())
    table = np.zeros((20, len(columns)), np.float32)
    table[:, 0], table[:, 1] = np.arange(20) / 100, np.sin(np.arange(20) / 10)
    np.savez(home / "kscale" / "runs.npz", _columns=np.array(columns), a=table)
    head = "file,kp,length,mass,trajectory,vin\n"
    (home / "kscale" / "index.csv").write_text(head + "a,16,0.15,0.741,sin,15.0\n")
    entry = dict.fromkeys(xl330.ENTRIES.values(), 1.0)
    entries = [entry | {"timestamp": k / 100, "position": k / 50} for k in range(9)]
    told = {"mass": 0.5, "length": 0.1, "kp": 200, "vin": 7.4, "trajectory": "sin"}
    (home / "xl330" / "a.json").write_text(json.dumps(told | {"entries": entries}))
    times = np.arange(0, 6, 0.1)
    seen = np.column_stack([1e9 + times, times / 10, times / 20, times / 30])
    sent = np.column_stack([1e9 + times, 0 * times + 0.1, np.sin(times)])
    np.savetxt(home / "mrclam" / "Robot2_Groundtruth.dat", seen)
    packed = home / "mrclam" / "Robot2_Odometry.dat.gz"
    with gzip.open(packed, "wt") as out:
        np.savetxt(out, sent)


STEP, SUBSTEPS, SAMPLES = 0.02, 20, 120  # [s], and how many
CELLS = tuple((mass, gain) for mass in (0.1, 0.15, 0.2) for gain in (200, 400))
DRIVES = ("sines", "steps")
LEVER, VOLTAGE, GRAVITY = 0.1, 5.0, 9.81  # [m], [V], [m/s2]
STALL, LOSS, FRICTION = 0.5, 0.05, 0.01  # [N m], [N m s/rad], [N m]
DUTY = 4096 / (2 * math.pi) / 128 / 885  # per rad of error at gain 1


def servo(directory: Path) -> tuple[Path, Path]:
    """Runs of a servo, unchanged and with 50 g more than is said.

    Returns:
        Directories of the changed and of the unchanged runs.
    """
    changed, unchanged = directory / "changed", directory / "unchanged"
    rng = np.random.default_rng(0)
    for mass, gain in CELLS:
        for drive in DRIVES:
            _write_run(unchanged, mass, gain, drive, rng)
    for drive in DRIVES:
        _write_run(changed, *CELLS[0], drive, rng, added=0.05)
    return changed, unchanged


def odometry(directory: Path, count: int = 600) -> Path:
    """Intervals of a robot on two wheels whose left wheel is 3 % larger."""
    rng = np.random.default_rng(0)
    radius, axle, interval = 0.0205, 0.0884, 0.8
    ways = ((1, 1), (-1, -1), (-1, 1), (1, -1))
    rows = []
    for _ in range(count):
        pair = ways[int(rng.integers(4))]
        left, right = (0.5 * way * float(rng.uniform(0.95, 1.0)) for way in pair)
        ahead_left = 1.03 * left * radius * interval
        ahead_right = right * radius * interval
        turn = (ahead_right - ahead_left) / axle
        ahead = (ahead_left + ahead_right) / 2
        moved = np.array([ahead * math.cos(turn / 2), ahead * math.sin(turn / 2), turn])
        moved += rng.normal(0, (7e-4, 5e-4, 1.7e-3))
        seen = [round(float(value), 6) for value in moved]
        speeds = {"phi_l": round(left, 6), "phi_r": round(right, 6)}
        rows.append({"T": interval, **speeds, "sm": seen})
    directory.mkdir(parents=True)
    text = "\n".join(json.dumps(row) for row in rows)
    (directory / "lstraight.tuple").write_text(text + "\n")
    return directory


def _write_run(
    directory: Path,
    mass: float,
    gain: int,
    drive: str,
    rng: np.random.Generator,
    added: float = 0.0,
) -> None:
    goals = [_goal(drive, STEP * n) for n in range(SAMPLES)]
    entries = _entries(goals, mass + added, gain, rng)
    told = {"mass": mass, "length": LEVER, "kp": gain, "vin": VOLTAGE}
    content = {**told, "motor": "xl330", "trajectory": drive, "entries": entries}
    directory.mkdir(parents=True, exist_ok=True)
    name = f"{round(1000 * mass)}_{gain}_{drive}.json"
    (directory / name).write_text(json.dumps(content))


def _goal(drive: str, time: float) -> float:
    if drive == "steps":
        return 0.6 if int(time / 0.6) % 2 else -0.4
    return 0.7 * math.sin(3.0 * time) + 0.3 * math.sin(7.0 * time)


def _entries(
    goals: list[float], mass: float, gain: int, rng: np.random.Generator
) -> list[dict[str, float]]:
    angle = speed = 0.0
    rows = []
    for number, goal in enumerate(goals):
        duty = max(-1.0, min(1.0, DUTY * gain * (goal - angle)))
        rows.append(
            {
                "timestamp": round(STEP * number, 6),
                "position": round(angle + float(rng.normal(0, 1e-3)), 6),
                "speed": round(speed, 6),
                "goal_position": round(goal, 6),
                "load": round(abs(300 * duty)),
                "input_volts": VOLTAGE,
                "temp": 30,
                "torque_enable": True,
            }
        )
        for _ in range(SUBSTEPS):
            torque = STALL * duty - LOSS * speed - FRICTION * math.tanh(speed / 0.05)
            torque -= mass * GRAVITY * LEVER * math.sin(angle)
            speed += torque / (mass * LEVER**2) * STEP / SUBSTEPS
            angle += speed * STEP / SUBSTEPS
            duty = max(-1.0, min(1.0, DUTY * gain * (goal - angle)))
    return rows
