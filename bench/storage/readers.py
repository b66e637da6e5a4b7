"""What reads each kind of file, and what that may hold."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.storage.sample_files import FIELDS
from bench.versions import ROOT


@dataclass(frozen=True)
class Reader:
    """A kind of file.

    Attributes:
        name: of the kind.
        file: where it lies, below the directory that `sample_files.make` filled.
        read: reads it; given that directory.
        sane: what is wrong with content that was accepted, one line; "" = nothing.
        stored: whether the project wrote it, and so notices a flipped bit.
    """

    name: str
    file: str
    read: Callable[[Path], Any]
    sane: Callable[[Any], str] = lambda found: ""
    stored: bool = False


def readers() -> list[Reader]:
    """All of them."""
    return [*_stored(), *_made(), *_given(), *_recorded(), *_tabled()]


def _stored() -> Iterator[Reader]:
    from bns.campaign import results
    from bns.campaign.store import CampaignStore
    from bns.storage.store import RunStore, load
    from bns.worlds.data import dataset

    yield Reader(
        "run.json", "run/run.json", lambda h: RunStore.open(h / "run"), stored=True
    )
    for name in ("arrays.npz", "record.parquet"):
        yield Reader(name, f"run/{name}", lambda h: load(h / "run"), run, True)
    step = "begun/steps/00001.npz"
    yield Reader("step.npz", step, lambda h: load(h / "begun"), run, True)
    yield Reader(
        "state.npz", "begun/state.npz", lambda h: _state(h / "begun"), state, True
    )
    for name in ("dataset.json", "trials.parquet", "commands.parquet"):
        file = f"run/dataset/{name}"
        yield Reader(
            name, file, lambda h: dataset.read(h / "run" / "dataset"), trials, True
        )
    for name in ("trials.npz", "commands.npz"):
        file = f"plain/dataset/{name}"
        yield Reader(
            name, file, lambda h: dataset.read(h / "plain" / "dataset"), trials, True
        )
    record = "plain/record.npz"
    yield Reader("record.npz", record, lambda h: load(h / "plain"), run, True)
    stores = {
        "campaign.json": lambda h: CampaignStore.open(h / "store"),
        "campaign.toml": lambda h: results.wanted(CampaignStore.open(h / "store")),
        "results.parquet": lambda h: list(CampaignStore.open(h / "store").read()),
    }
    for name, read in stores.items():
        yield Reader(name, f"store/{name}", read, stored=True)


def _made() -> Iterator[Reader]:
    from bns.campaign.part import decode
    from bns.campaign.store import CampaignStore
    from bns.gap import store as gap_store
    from bns.gap.bench.benchmark_io import read_answers
    from bns.hardware.driving.odometry import Wheels
    from bns.hardware.dynamixel import joints
    from bns.hardware.tracking.camera import Camera
    from bns.storage import reading
    from bns.worlds.static_snn import StaticNets

    listed = [
        ("part.parquet", "part.parquet", lambda h: decode(
            reading.read_bytes(h / "part.parquet", most=reading.DATA), "part"), _fine),
        ("failed.json", "loose/failed/00ff.json",
         lambda h: CampaignStore.open(h / "loose").failures(), _fine),
        ("diagnosis.json", "gap/diagnosis.json", lambda h: gap_store.load(h / "gap"),
         _fine),
        ("answers.json", "answers.json", lambda h: read_answers(h / "answers.json"),
         _fine),
        ("nets.npz", "nets.npz", lambda h: StaticNets.load(h / "nets.npz"), finite),
        ("camera.json", "camera.json", lambda h: Camera.read(h / "camera.json"),
         camera),
        ("wheels.json", "wheels.json", lambda h: Wheels.read(h / "wheels.json"),
         wheels),
        ("servos.toml", "servos.toml", lambda h: joints.read(h / "servos.toml"),
         servos),
    ]  # fmt: skip
    for row in listed:
        yield Reader(*row, stored=True)


def _state(directory: Path) -> dict[str, np.ndarray]:
    """The state of a learner, as it is checked before it goes on."""
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.run import restored
    from bns.storage.store import RunStore

    store = RunStore.open(directory)
    known = _LEARNERS.get(directory)
    if known is None:
        from bns.experiment.world_factory import make_world

        config, _ = resolve(store.config, store.mode)
        known = _LEARNERS[directory] = Batch([config], [make_world(config)])
        known.fresh = known.learner.state()
    _, arrays = store.read_state()
    restored(known.learner, known.fresh, arrays, directory / "state.npz")
    return arrays


_LEARNERS: dict[Path, Any] = {}


def _given() -> Iterator[Reader]:
    from bns.campaign import file as campaign_file
    from bns.experiment import loading
    from bns.gap.models.mjcf import log
    from bns.gap.models.mjcf.config import OwnConfig
    from bns.gap.planning import command_file
    from bns.models import mjcf, numbers, robot_model, servo_numbers
    from bns.storage import files
    from bns.worlds import corrected
    from bns.worlds.data import importing
    from bns.worlds.data.importing import ColumnMap

    def own(home: Path) -> Any:
        arm = OwnConfig.read(ROOT / "examples" / "arm" / "arm.toml")
        return log.read(str(home / "own.csv"), arm)

    def law(home: Path) -> Any:
        servo_numbers._tables.cache_clear()
        return servo_numbers.law(home / "law")

    listed = [
        ("config.toml", "run/config.toml",
         lambda h: loading.from_file(h / "run" / "config.toml"), finite),
        ("timing.jsonl", "run/timing.jsonl",
         lambda h: files.read_entries(h / "run" / "timing.jsonl"), _fine),
        ("campaign file", "campaign.toml",
         lambda h: campaign_file.read(h / "campaign.toml"), _fine),
        ("worlds.toml", "worlds.toml",
         lambda h: corrected._read(h / "worlds.toml"), _fine),
        ("column map", "map.toml", lambda h: ColumnMap.read(h / "map.toml"), _fine),
        ("CSV log", "log.csv",
         lambda h: importing.from_csv(h / "log.csv", ROOT_MAP), trials),
        ("MCAP log", "log.mcap", lambda h: importing.from_mcap(
            h / "log.mcap", FIELDS, units={"time": "ns"}), trials),
        ("own log", "own.csv", own, trials),
        ("own model", "arm/arm.toml", lambda h: OwnConfig.read(h / "arm" / "arm.toml"),
         own_model),
        ("MJCF", "arm/arm.xml",
         lambda h: mjcf.compiled(mjcf.load(h / "arm" / "arm.xml"), "arm.xml"), _fine),
        ("robot.toml", "burger/robot.toml", lambda h: robot_model.read(h / "burger"),
         finite),
        ("numbers.toml", "burger/numbers.toml", lambda h: numbers.read(h / "burger"),
         finite),
        ("law.toml", "law/law.toml", law, finite),
        ("commands.csv", "commands.csv",
         lambda h: command_file.read(h / "commands.csv"), finite),
    ]  # fmt: skip
    for row in listed:
        yield Reader(*row)


def _recorded() -> Iterator[Reader]:
    from bns.gap.importers import khepera3_odometry, kscale_sts3215, mrclam6, xl330

    listed = [
        ("lstraight.tuple", "khepera/lstraight.tuple",
         lambda h: khepera3_odometry.read(h / "khepera"), trials),
        ("lstraight_results.json", "khepera/lstraight_results.json",
         lambda h: khepera3_odometry.published(h / "khepera"), finite),
        ("index.csv", "kscale/index.csv", lambda h: kscale_sts3215.read(h / "kscale"),
         trials),
        ("runs.npz", "kscale/runs.npz", lambda h: kscale_sts3215.read(h / "kscale"),
         trials),
        ("xl330.json", "xl330/a.json", lambda h: xl330.read(h / "xl330"), trials),
        ("Groundtruth.dat", "mrclam/Robot2_Groundtruth.dat",
         lambda h: mrclam6.read(h / "mrclam", 2, seconds=2.0), trials),
        ("Odometry.dat.gz", "mrclam/Robot2_Odometry.dat.gz",
         lambda h: mrclam6.read(h / "mrclam", 2, seconds=2.0), trials),
    ]  # fmt: skip
    for row in listed:
        yield Reader(*row)


def _tabled() -> Iterator[Reader]:
    from bns.gap.describe import describe
    from bns.gap.importers import tables

    data = "lerobot/data/chunk-000/episode_000000.parquet"
    for name, file, log in (
        ("PACE log", "pace.pt", "pace.pt"),
        ("SAGE commands", "sage/control.csv", "sage"),
        ("SAGE states", "sage/state_motor.csv", "sage"),
        ("SAGE joints", "sage/joint_list.txt", "sage"),
        ("SAGE events", "sage/event.csv", "sage"),
        ("LeRobot info", "lerobot/meta/info.json", "lerobot"),
        ("LeRobot frames", data, "lerobot"),
        ("ROS 2 log", "ros2.mcap", "ros2.mcap"),
        ("packed CSV", "own.csv.gz", "own.csv.gz"),
    ):
        yield Reader(name, file, lambda h, log=log: tables.read(h / log), table)
    arm = ROOT / "examples" / "arm" / "arm.xml"
    yield Reader("described log", "own.csv", lambda h: describe(arm, h / "own.csv"))


ROOT_MAP = {
    "time": "t", "x": "px", "y": "py", "yaw": "heading", "left_speed": "vl",
    "right_speed": "vr",
}  # fmt: skip


def _fine(found: Any) -> str:
    return ""


def numbers_in(value: Any) -> Iterator[np.ndarray]:
    """All numbers of some content, as arrays of doubles."""
    if isinstance(value, Mapping):
        for item in value.values():
            yield from numbers_in(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from numbers_in(item)
    elif is_dataclass(value) and not isinstance(value, type):
        for item in fields(value):
            yield from numbers_in(getattr(value, item.name))
    elif isinstance(value, int | float | np.ndarray | np.generic):
        array = np.asarray(value)
        if array.dtype.kind in "iuf":
            yield array.astype(float)


def finite(found: Any) -> str:
    """No NaN, and nothing beyond what is real."""
    for array in numbers_in(found):
        if not (np.abs(array) <= 1e12).all():
            return f"holds {array.ravel()[:3]}"
    return ""


def own_model(found: Any) -> str:
    """Numbers as `finite` has them; a loop without a limit of torque has infinity."""
    loose = [item.torque for item in found.told]
    if any(torque != np.inf and not 0 < torque <= 1e12 for torque in loose):
        return f"holds torques {loose}"
    return finite(replace(found, told=[replace(t, torque=1.0) for t in found.told]))


def run(found: Any) -> str:
    """A record whose parts fit each other."""
    shape = (found.replicates, found.trials)
    for name, column in found.columns.items():
        if column.shape != shape or column.dtype != np.float64:
            return f"{name} is {column.dtype} of {column.shape}, not {shape}"
    if found.replicates != found.config.replicates:
        return "replicates differ"
    return ""


def state(found: Mapping[str, np.ndarray]) -> str:
    """Weights that are numbers."""
    names = [name for name in found if name.rpartition(".")[2] == "theta"]
    bad = [name for name in names if not np.isfinite(found[name]).all()]
    if not names:
        return "no weights"
    return f"{bad[0]} holds NaN" if bad else ""


def trials(found: Any) -> str:
    """Trials of something that moves."""
    listed = getattr(found, "trials", found)
    for trial in listed if isinstance(listed, list | tuple) else [listed]:
        names = [channel.name for channel in trial.channels]
        if len(set(names)) < len(names):
            return f"channels {names}"
        if np.nanmax(np.abs(trial.observed), initial=0) > 1e39:
            return "observed beyond 1e39"
        if not (np.abs(trial.commands.values) <= 1e6).all():
            return "commands beyond 1e6"
        if not np.isfinite(trial.times).all() or (np.diff(trial.times) < 0).any():
            return "times are not in order"
        held = np.diff(trial.times[trial.boundaries])
        if (np.abs(held - trial.commands.durations) > 1 + 0.5 * held + held).any():
            return "times unlike durations"
    return ""


def table(found: Any) -> str:
    """A log of columns of numbers that can be."""
    rows = {column.values.shape for column in found.columns}
    if len(rows) != 1 or not min(rows) or len({*found.names}) < len(found.names):
        return f"columns {found.names} of {rows}"
    for column in found.columns:
        most = 1e9 if column.role else 1e20
        if not (np.nan_to_num(np.abs(column.values), nan=0.0) <= most).all():
            return f"{column.name} holds {np.nanmax(np.abs(column.values))}"
    return ""


def camera(found: Any) -> str:
    """A camera that can see."""
    if not (np.linalg.cond(found.matrix) < 1e12 and 0 <= found.latency <= 10):
        return f"matrix {found.matrix.tolist()}, latency {found.latency}"
    return finite(found) if min(found.size) > 0 else f"size {found.size}"


def wheels(found: Any) -> str:
    """Wheels that can roll."""
    sizes = found.left / 0.041, found.right / 0.041, found.axle / 0.0884
    return "" if all(0.8 < size < 1.2 for size in sizes) else f"{sizes} of nominal"


def servos(found: Any) -> str:
    """Servos that can be told."""
    for joint in found:
        places = joint.zero, joint.low, joint.high
        whole = all(type(place) is int and 0 <= place <= 1023 for place in places)
        if not whole or joint.low >= joint.high or joint.sign not in (-1, 1):
            return str(joint)
    return ""


def fingerprint(value: Any) -> Any:
    """Content by which two readings are compared: every number and word."""
    if isinstance(value, Mapping):
        return tuple(
            (str(k), fingerprint(v)) for k, v in sorted(value.items(), key=str)
        )
    if isinstance(value, list | tuple):
        return tuple(fingerprint(item) for item in value)
    if is_dataclass(value) and not isinstance(value, type):
        return tuple(
            fingerprint(getattr(value, item.name))
            for item in fields(value)
            if item.name not in ("lock", "text", "directory")
        )
    if isinstance(value, np.ndarray):
        return (str(value.dtype), value.shape, value.tobytes())
    return repr(value)
