"""Drive the Khepera III through a list of commands and print where it went.

python examples/01_drive_a_robot.py
"""

import argparse

import numpy as np

from bns.worlds import registry
from bns.worlds.trial import Commands

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="one side of the square only")
quick = parser.parse_args().quick

SPEED = 0.12  # m/s, about the top speed of the dissertation's experiments
SIDE = 0.30  # m
AXLE = 0.0885  # m, distance between the wheels
turn = np.pi / 2 * AXLE / 2 / SPEED  # s, a quarter turn on the spot

# Left and right wheel [m/s]; each command is held for its own duration [s].
side = [(SPEED, SPEED), (-SPEED, SPEED)]
times = [SIDE / SPEED, turn]
sides = 1 if quick else 4
commands = Commands(np.array(side * sides), np.array(times * sides))

world = registry.make("mujoco", robot="khepera3")
(trial,) = world.run([commands])

print(
    f"{len(commands)} commands, {commands.duration:.1f} s, {len(trial.times)} samples"
)
print("after command    x [m]    y [m]   yaw [deg]")
for number, (x, y, yaw) in enumerate(trial.command_poses_world):
    print(f"{number:13d} {x:8.3f} {y:8.3f} {np.degrees(yaw):11.1f}")

# The square does not close: the wheels lag behind their commands.
missing = 90 * sides - np.degrees(trial.poses_world[-1, 2])
print(f"At the end {missing:.1f} deg are missing to {sides} quarter turns.")
