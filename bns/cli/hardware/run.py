"""`bns run PRESET --world hardware`: learning on a robot, in real time."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from bns.errors import BnsError

STOPPED = 130
"""exit code of a run that was stopped; it can be resumed"""


def execute(given: Any) -> int:
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
