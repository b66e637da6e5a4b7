"""Recording with the hardware mode and diagnosing what was withheld."""

import numpy as np

from bench.result import Result

DOC = "a recording over the emulated port, camera and tracker, its hidden effect named"
BAR = "the withheld effect is named"
HIDDEN = "wheel_gain:wheel=left,factor=0.85"
TRIALS, COMMANDS = 8, 10
RATE, NOISE, SHAKE = 30.0, 8.0, 0.05  # 1/s, grey values, px


def run(quick: bool) -> Result:
    """Excitation as `bns hardware record` drives it, on a robot with a weak wheel.

    Virtual time: line, drawn frames and tracker as in a session; the camera gives 30
    pictures a second, with a standard deviation of 8 grey values and 0.05 px of
    tremble. (A still camera's places scatter by less than the diagnosis's least noise
    of 0.1 mm, whose share in the rest it then takes for structure.) The figure is 1
    where the effect is among those that the verdict names, else 0.
    """
    from bns.gap.diagnose import diagnose
    from bns.gap.wheeled import WheeledModel
    from bns.hardware.emulators import virtual
    from bns.hardware.excitation import START, commands
    from bns.hardware.world import HardwareWorld

    count = 4 if quick else TRIALS
    rig = virtual.rig([HIDDEN], rate=RATE, noise=NOISE, shake=SHAKE, seed=2)
    world = HardwareWorld(rig=rig, sample_dt=0.05, start=START, recording=True)
    trials = []
    for number in range(count):
        told = commands(COMMANDS, seed=1, number=number // 2)
        trials += world.run([told], trial=number)
    found = diagnose(trials, WheeledModel("khepera3", threads=1), full=False)
    named = [list(names) for names in found.verdict.named]
    hit = any("wheel_gain" in name for names in named for name in names)
    spread = np.concatenate([np.diff(t.times) for t in trials])
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
            "sample step, median [s]": round(float(np.median(spread)), 4),
            "void trials": world.voids,
        },
    )
