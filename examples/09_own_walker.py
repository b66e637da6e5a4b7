"""A walking robot of your own: check it, hold a leg up, let it learn to walk.

    python examples/09_own_walker.py

The robot is the directory `examples/quad`: four legs of three AX-12A servos each. It is
an example and no product; its legs are those of the PhantomX, its body is assumed.
Legs and joints are named as docs/your_robot.md says, so every effect on legs and servos
finds them.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from bns import models, presets, train
from bns.models import check
from bns.worlds import registry
from bns.worlds.trial import Commands

ROBOT = str(Path(__file__).parent / "quad")

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="learn for two trials only")
quick = parser.parse_args().quick

# 1. Is the directory what the worlds and the learner need?
for point in check.check(models.robot(ROBOT)):
    print("fault" if point.faults else "ok   ", point.says)
    for fault in point.faults:
        print("      ", fault)

# 2. It leans to the front: goals of the front femurs [rad], for at most a second; then
#    the same with one of these legs held up.
channels = models.robot(ROBOT).channels
goals = np.zeros((1, len(channels)))
goals[0, [channel.name.endswith("front_femur") for channel in channels]] = 0.4
lean = Commands(goals, [1.0], channels)
for damage in ([], ["leg_raised:legs=left_front"]):
    world = registry.make("hexapod", robot=ROBOT, damage=damage)
    (trial,) = world.run([lean])
    x, y, yaw = trial.poses_world[-1]
    fell = "fell" if trial.outcome.fell else "stands"
    print(f"{damage or 'whole'}: x {x:.3f} m, y {y:.3f} m, yaw {yaw:.2f} rad, {fell}")

# 3. The learner, from the preset of the hexapod; a leg is lost before the last trials.
config = presets.load("hexapod-walk")
trials = 2 if quick else 16
config = replace(
    config,
    trials=trials,
    threads=1,
    replicates=1 if quick else 2,
    record_replicates=1,
    world=replace(
        config.world, robot=ROBOT, damage=(f"leg_raised:legs=2@{trials - 4}",)
    ),
)
if quick:
    config = replace(
        config,
        evolution=replace(config.evolution, population=20, tournament=5, generations=2),
        snn=replace(config.snn, epochs=20),
        world=replace(config.world, damage=()),
    )
with tempfile.TemporaryDirectory() as directory:
    record = train(config, Path(directory) / "run")
print("distance in each trial [m]:", np.round(record["distance"], 2))
