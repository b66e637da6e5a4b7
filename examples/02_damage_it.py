"""Damage the robot in two ways and compare the paths it then takes.

    python examples/02_damage_it.py

One batch holds all robots: each carries its own damage, and all are given the same
commands.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("agg")  # no display needed

import matplotlib.pyplot as plt
import numpy as np

from bns.worlds import registry
from bns.worlds.trial import Commands

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="fewer commands")
parser.add_argument("--out", type=Path, default=Path("damage.png"))
given = parser.parse_args()

DAMAGES = {
    "undamaged": [],
    "left wheel 20 % slower": ["wheel_gain:wheel=left,factor=0.8"],
    "small right wheel, payload": [
        "wheel_diameter:wheel=right,factor=0.9",
        "payload:mass=0.3,y=0.04",
    ],
}

# An arc to the left, a straight, an arc to the right; wheel speeds [m/s], times [s].
speeds = np.array([(0.08, 0.12), (0.12, 0.12), (0.12, 0.08)])
durations = np.array([2.0, 1.5, 2.0])
repeats = 1 if given.quick else 2
commands = Commands(np.tile(speeds, (repeats, 1)), np.tile(durations, repeats))

world = registry.make("mujoco", robot="khepera3", damage=list(DAMAGES.values()))
trials = world.run([commands] * len(DAMAGES))

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
healthy = trials[0].poses_world
for name, trial in zip(DAMAGES, trials, strict=True):
    x, y, _ = trial.poses_world.T
    off = np.linalg.norm(trial.poses_world[-1, :2] - healthy[-1, :2])
    axes.plot(x, y, label=name)
    axes.plot(x[-1], y[-1], "o", color=axes.lines[-1].get_color())
    print(f"{name:28} ends at ({x[-1]:.3f}, {y[-1]:.3f}) m, {off:.3f} m off")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="The same commands")
axes.legend(frameon=False)
figure.savefig(given.out, dpi=150)
print(f"Figure: {given.out}")
