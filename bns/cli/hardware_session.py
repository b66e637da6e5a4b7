"""The verbs of `bns hardware` that talk to a robot."""

from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError


def check(given: Any) -> int:
    """`bns hardware check`."""
    if given.robot == "phantomx":
        from bns.hardware.dynamixel.check import report

        for line in report(given.port):
            print(line)
        return 0
    from bns.hardware.checklist import report as khepera

    with _rig(given) as rig:
        for line in khepera(rig, move=given.move):
            print(line, flush=True)
    if not given.move:
        print("Nothing has moved; --move drives a little and compares.")
    return 0


def calibrate(given: Any) -> int:
    """`bns hardware calibrate`."""
    from bns.hardware import setup

    out = Path(given.out)
    if out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    lens = setup.lens(given.views) if given.views else None
    for line in setup.camera(given.port, given.camera, given.calibration, lens, out):
        print(line)
    print(f"camera: {out}")
    return 0


def record(given: Any) -> int:
    """`bns hardware record`."""
    from bns.gap import command_file
    from bns.hardware import excitation
    from bns.hardware.world import HardwareWorld
    from bns.worlds import dataset

    planned = command_file.read(given.plan) if given.plan else None
    if not given.move:
        raise BnsError(
            "The robot drives for a recording: clear the board, give --move."
        )
    out = Path(given.out)
    if out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    world = HardwareWorld(
        given.robot,
        port=given.port,
        camera=given.camera,
        calibration=given.calibration,
        damage=given.damage,
        sample_dt=0.05,
        as_told=True,
    )
    trials = []
    try:
        for number in range(given.trials):
            told = planned or excitation.commands(
                given.commands, seed=given.seed, number=number // 2
            )
            (trial,) = world.run([told], trial=number)
            trials.append(trial)
            end = np.round(trial.poses_world[-1], 3)
            print(f"trial {number + 1} of {given.trials}: ends at {end}", flush=True)
    finally:
        world.close()
    dataset.write(out, trials, provenance={"by": "bns hardware record"})
    print(f"dataset: {out}; bns gap diagnose {out}")
    return 0


class _rig:
    """A rig for a `with` block."""

    def __init__(self, given: Any):
        self.given = given

    def __enter__(self) -> Any:
        from bns.hardware.rig import connect

        self.rig = connect(
            self.given.port, self.given.camera, calibration=self.given.calibration
        )
        return self.rig

    def __exit__(self, *_: object) -> None:
        self.rig.close()
