"""A robot of your own: check it, drive it, damage it, let it learn.

    python examples/08_own_robot.py

The robot is the directory `examples/burger`, a TurtleBot3 Burger as MJCF with a
`robot.toml` beside it. Nothing in the package knows of it: wherever a robot's name is
taken, the path of its directory does. docs/your_robot.md says what is in one.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from bns import models, presets, stats, train
from bns.models import check
from bns.worlds import registry
from bns.worlds.trial import Commands

ROBOT = str(Path(__file__).parent / "burger")

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="learn for three trials only")
quick = parser.parse_args().quick

# 1. Is the directory what the worlds and the learner need?
for point in check.check(models.robot(ROBOT)):
    print("fault" if point.faults else "ok   ", point.says)
    for fault in point.faults:
        print("      ", fault)

# 2. Straight on for three seconds, whole and with a weak left wheel.
straight = Commands(np.full((1, 2), 0.12), [3.0])  # [m/s], [s]
for damage in ([], ["wheel_gain:wheel=left,factor=0.8"]):
    world = registry.make("mujoco", robot=ROBOT, damage=damage)
    (trial,) = world.run([straight])
    x, y, yaw = trial.poses_world[-1]
    print(f"{damage or 'whole'}: x {x:.3f} m, y {y:.3f} m, yaw {yaw:.2f} rad")

# 3. The learner, from the preset of the demo. The robot's limits are read from its
#    directory; what it is told at most while it learns is a setting of the evolution.
config = presets.load("demo")
config = replace(
    config,
    trials=3 if quick else 15,
    replicates=1 if quick else 2,
    world=replace(config.world, robot=ROBOT, damage=()),
)
if quick:
    config = replace(config, evolution=replace(config.evolution, generations=10))
with tempfile.TemporaryDirectory() as directory:
    record = train(config, Path(directory) / "run")
print("trials until solved:", stats.trials_to_solve(record))  # inf: not in these
