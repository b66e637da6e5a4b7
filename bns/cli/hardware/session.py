"""What talks to a robot: verbs of `bns hardware`, and `bns run --world hardware`."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.errors import BnsError

if TYPE_CHECKING:
    from bns.worlds.trial import Trial
import sys
from dataclasses import replace

AT_REST = 60.0  # s between samples: none but those at which commands begin and end


def check(given: Any) -> int:
    """`bns hardware check`."""
    if given.robot == "phantomx":
        from bns.hardware.dynamixel.rig import report

        for line in report(given.port, given.servos):
            print(line, flush=True)
        print("Nothing has moved.")
        return 0
    from bns.hardware.rig import report as khepera

    with _rig(given) as rig:
        for line in khepera(rig, move=given.move):
            print(line, flush=True)
    if not given.move:
        print("Nothing has moved; --move drives a little and compares.")
    return 0


OUT = {"camera": "camera.json", "wheels": "wheels.json", "servos": "servos.toml"}
"""what is calibrated -> file"""


def calibrate(given: Any) -> int:
    """`bns hardware calibrate`; gives the exit code.

    Args:
        given: its arguments.

    Raises:
        BnsError: the file exists, or the calibration failed.
    """
    out = Path(given.out or OUT[given.what])
    if out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    lines = {"camera": _camera, "wheels": _wheels, "servos": _servos}[given.what]
    for line in lines(given, out):
        print(line, flush=True)
    print(f"{given.what}: {out}")
    return 0


def _camera(given: Any, out: Path) -> Iterator[str]:
    from bns.hardware import setup

    lens = setup.lens(given.views) if given.views else None
    yield from setup.camera(
        given.port, given.camera, given.calibration, lens, out, robot=given.robot
    )


def _servos(given: Any, out: Path) -> Iterator[str]:
    from bns.hardware.dynamixel import rig

    if given.robot != "phantomx":
        raise BnsError("A Khepera III has no servos: give --robot phantomx.")
    yield from rig.calibrate(given.port, given.servos, out)


def _wheels(given: Any, out: Path) -> Iterator[str]:
    from bns.hardware.driving import odometry

    if given.robot != "khepera3":
        raise BnsError("A hexapod has no wheels: give --what servos.")
    if not given.move:
        raise BnsError(
            "The robot drives to measure its wheels: clear the board, give --move."
        )
    with _rig(given) as rig, rig.operator:
        rig.robot.wheels = (1.0, 1.0)
        done = list(odometry.drives(rig.mover(), (0.0, 0.0, 0.0)))
    ways, moved = (np.array(part) for part in zip(*done, strict=True))
    found = odometry.fit(ways, moved)
    for name, error in zip(("left", "right", "axle"), found.error, strict=True):
        size = getattr(found, name)
        yield f"{name:<7} {size * 1e3:.3f} mm, standard error {error * 1e3:.3f} mm"
    found.write(out)


def record(given: Any) -> int:
    """`bns hardware record`; gives the exit code.

    Args:
        given: its arguments.

    Raises:
        BnsError: ``--move`` is not given, the dataset exists, or a trial failed; trials
            done before are written.
    """
    from bns.worlds.data import dataset

    if not given.move:
        raise BnsError(
            "The robot drives for a recording: clear the board, give --move."
        )
    out = Path(given.out)
    if out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    world, told = _recorded(given)
    trials = []
    try:
        for number in range(given.trials):
            (trial,) = world.run([told(number)], trial=number)
            trials.append(trial)
            print(f"trial {number + 1} of {given.trials}: {_end(trial)}", flush=True)
    except BnsError as error:
        if not trials:
            raise
        dataset.write(out, trials, provenance={"by": "bns hardware record"})
        raise BnsError(f"{error} The {len(trials)} trials so far: {out}.") from error
    finally:
        world.close()
    dataset.write(out, trials, provenance={"by": "bns hardware record"})
    print(f"dataset: {out}; bns gap diagnose {out} --model {given.robot}")
    return 0


def _end(trial: "Trial") -> str:
    """Where a robot was last seen: a recording has no pose at its very end."""
    seen = trial.poses_world[np.isfinite(trial.poses_world).all(1)]
    if not len(seen):
        return "never seen"
    x, y, yaw = seen[-1]
    return f"last seen at {x:.3f}, {y:.3f} m, {np.degrees(yaw):.1f} deg"


def _recorded(given: Any) -> tuple[Any, Callable[[int], Any]]:
    """The robot that is recorded, and what it is told in each trial.

    A hexapod is sampled where it rests, between two commands: its servos are read one
    after the other, so that no sample between is of one moment.
    """
    from bns.gap.planning import command_file
    from bns.hardware.driving import excitation

    shared: dict[str, Any] = {
        "port": given.port,
        "camera": given.camera,
        "calibration": given.calibration,
        "damage": given.damage,
    }
    if given.robot == "phantomx":
        from bns.hardware.worlds.hexapod import HardwareHexapod

        if given.plan:
            raise BnsError("--plan: plans are for wheeled robots; leave it out.")
        world = HardwareHexapod(servos=given.servos, sample_dt=AT_REST, **shared)
        return world, lambda number: excitation.steps(
            given.commands, seed=given.seed, number=number // 2
        )
    from bns.hardware.worlds.wheeled import HardwareWorld

    planned = command_file.read(given.plan) if given.plan else None
    wheeled = HardwareWorld(
        given.robot,
        wheels=given.wheels,
        sample_dt=0.05,
        start=excitation.START,
        recording=True,
        **shared,
    )
    return (
        wheeled,
        lambda number: (
            planned
            or excitation.commands(given.commands, seed=given.seed, number=number // 2)
        ),
    )


class _rig:
    """A rig for a `with` block."""

    def __init__(self, given: Any):
        self.given = given

    def __enter__(self) -> Any:
        from bns.hardware.rig import connect

        self.rig = connect(
            self.given.port,
            self.given.camera,
            calibration=self.given.calibration,
            wheels=self.given.wheels,
        )
        return self.rig

    def __exit__(self, *_: object) -> None:
        self.rig.close()


STOPPED = 130
"""exit code of a run that was stopped; it can be resumed"""


def learn(given: Any) -> int:
    """Train on the robot, draw, and say what happened.

    Args:
        given: what `bns run` was told; one replicate is run, whatever the preset says.
    """
    from bns.hardware.clock import urgent
    from bns.hardware.line import check_port
    from bns.hardware.setup import filled
    from bns.storage.lock import Lock

    given = filled(given, given.config.world.robot)
    check_port(given.port)
    urgent()
    with Lock(given.out) as lock:
        return _locked(given, lock)


def _locked(given: Any, lock: Any) -> int:
    """Train into a directory in which nobody else writes."""
    from bns.cli import outputs
    from bns.experiment.run import train
    from bns.hardware.faults import LinkError, SafetyStop
    from bns.tasks import registry as tasks

    config = replace(given.config, replicates=1, record_replicates=1, threads=1)
    out = Path(given.out)
    world = _world(given, config)
    try:
        world.ready()  # before anything is written
        with outputs.live(given.rerun, config) as on_trial:
            record = train(
                config,
                out,
                world=world,
                resume=given.resume,
                progress=True,
                on_trial=on_trial,
                background=not tasks.of(config).closed_loop,
                lock=lock,
            )
    except (SafetyStop, LinkError) as error:
        if not (out / "run.json").exists():
            raise
        again = f"bns run {out} --resume --port {given.port}"
        raise BnsError(f"{error} Go on with: {again}") from error
    finally:
        world.close()
    outputs.write(record, out, recording=given.rerun != "off", report=given.report)
    return 0


def _world(given: Any, config: Any) -> Any:
    """The robot of a configuration as a world."""
    from bns.tasks import registry as tasks

    task = tasks.of(config)
    settings: dict[str, Any] = {
        "damage": config.world.damage,
        "reality": config.world.reality,
        "sample_dt": config.world.sample_dt,
        "port": given.port,
        "camera": given.camera,
        "calibration": given.calibration,
        "log": str(Path(given.out) / "faults.jsonl"),
        "on_void": _say_void,
        **task.surroundings(),
    }
    if config.world.robot == "phantomx":
        from bns.hardware.worlds.hexapod import HardwareHexapod

        return HardwareHexapod(servos=given.servos, **settings)
    if task.closed_loop:
        from bns.hardware.worlds.wheeled import HardwareLight

        return HardwareLight(config.world.robot, wheels=given.wheels, **settings)
    from bns.hardware.worlds.wheeled import HardwareWorld

    return HardwareWorld(config.world.robot, wheels=given.wheels, **settings)


def _say_void(trial: int, reason: str) -> None:
    print(f"trial {trial + 1} is void ({reason}) and repeated", file=sys.stderr)
