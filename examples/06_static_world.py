"""Run the same commands in the physics world and in a static-SNN world.

    python examples/06_static_world.py

A static-SNN world is the dissertation's own fake real world: networks that say where
each command takes the robot, trained once and then left alone. Without any given, the
networks are those of an ideal two-wheeled robot, with neither lag nor slip: what the
two worlds disagree on is then what an ideal robot lacks. Every experiment runs in both:
`bns run khepera-simple --world.name static-snn`.
"""

import argparse

import numpy as np

from bns.worlds import registry
from bns.worlds.trial import Commands, body_displacements

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="fewer robots")
robots = 5 if parser.parse_args().quick else 50

rng = np.random.default_rng(0)
commands = [
    Commands(rng.uniform(0.05, 0.12, (8, 2)), rng.uniform(0.3, 3.1, 8))
    for _ in range(robots)
]

DAMAGE = ["wheel_gain:wheel=left,factor=0.8@1"]  # from trial 1 on
ends = {}
for name in ("mujoco", "static-snn"):
    world = registry.make(name, robot="khepera3", damage=DAMAGE)
    for trial in (0, 1):
        done = world.run(commands, trial=trial)
        ends[name, trial] = np.stack([one.command_poses_world for one in done])

print("Where the two worlds part, over", robots, "robots, root mean square:")
for trial in (0, 1):
    moved = [body_displacements(ends[name, trial]) for name in ("mujoco", "static-snn")]
    off = np.sqrt(np.mean((moved[0] - moved[1]) ** 2, axis=(0, 1)))
    print(
        f"trial {trial} ({'damaged' if trial else 'undamaged'}): per command "
        f"{1000 * off[0]:.1f} mm forward, {1000 * off[1]:.1f} mm left, "
        f"{np.degrees(off[2]):.1f} deg turn"
    )

shift = {
    name: np.linalg.norm(ends[name, 1][:, -1, :2] - ends[name, 0][:, -1, :2], axis=1)
    for name in ("mujoco", "static-snn")
}
for name, distance in shift.items():
    print(
        f"{name:10}: the damage moves the end by {np.median(distance):.2f} m (median)"
    )
