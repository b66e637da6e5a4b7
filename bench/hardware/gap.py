"""Recording with the hardware mode and diagnosing what was withheld."""

from collections.abc import Sequence

import numpy as np

from bench.result import Result, bench

HIDDEN = "wheel_gain:wheel=left,factor=0.85"
TRIALS, COMMANDS = 8, 10
RATE = 30.0  # pictures a second


@bench(
    "a recording over the emulated port, camera and tracker, its hidden effect named",
    bar="the withheld effect is named",
)
def hardware_gap(quick: bool) -> Result:
    """Excitation as `bns hardware record` drives it, on a robot with a weak wheel.

    Virtual time: line, drawn frames and tracker as in a session. The figure is 1 where
    the verdict names the effect, alone or among others, else 0. A second robot, with
    nothing wrong, is recorded and diagnosed the same way; what is said of it is in the
    details.
    """
    count = 4 if quick else TRIALS
    found, world, trials = _rehearsed([HIDDEN], count)
    named = [list(names) for names in found.verdict.named]
    hit = any("wheel_gain" in name for names in named for name in names)
    spread = np.concatenate([np.diff(t.times) for t in trials])
    sound = None if quick else _rehearsed([], count)[0].verdict
    return Result(
        figure=float(hit),
        unit="named",
        holds=hit,
        n=count,
        details={
            "withheld": HIDDEN,
            "verdict": found.verdict.sentence,
            "named": named,
            "fits": [list(fit.effects) for fit in found.fits[:3]],
            "noise that was found [m, m, rad]": found.floor["sigma"],
            "sample step, median [s]": round(float(np.median(spread)), 4),
            "void trials": world.voids,
            "without an effect": sound.sentence if sound else "not run",
        },
    )


def _rehearsed(effects: Sequence[str], count: int):
    """Diagnosis, world and trials of an emulated robot that was recorded."""
    from bns.gap.diagnose import diagnose
    from bns.gap.models.wheeled.model import WheeledModel
    from bns.hardware.driving.excitation import START, commands
    from bns.hardware.emulators import virtual
    from bns.hardware.worlds.wheeled import HardwareWorld

    rig = virtual.rig(effects, rate=RATE, seed=2)
    world = HardwareWorld(rig=rig, sample_dt=0.05, start=START, recording=True)
    trials = []
    for number in range(count):
        told = commands(COMMANDS, seed=1, number=number // 2)
        trials += world.run([told], trial=number)
    found = diagnose(trials, WheeledModel("khepera3", threads=1), full=False)
    return found, world, trials
