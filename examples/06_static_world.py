"""Make a static-SNN world from the physics world, and see where the two part.

    python examples/06_static_world.py

A static-SNN world is the dissertation's own fake real world: networks that say where
each command takes the robot, trained once on random commands and then left alone. Every
experiment runs in both worlds: `bns run khepera-simple --world.name static-snn`.
"""

import argparse

import numpy as np

from bns import presets
from bns.experiment import static_snn
from bns.worlds import registry
from bns.worlds.trial import Commands, body_displacements

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument(
    "--quick", action="store_true", help="fewer commands, less training"
)
quick = parser.parse_args().quick
lists, epochs, robots = (40, 300, 5) if quick else (200, 3000, 50)

physics = registry.make("mujoco", robot="khepera3")
config = presets.load("khepera-simple")  # for the bounds of the random commands
nets = static_snn.fit(physics, config, lists=lists, epochs=epochs)
forward, left, turn = nets.provenance["held_out_rms"]
print(
    f"{nets.provenance['commands']} random commands, {epochs} epochs; error on unseen "
    f"ones: {1000 * forward:.1f} mm, {1000 * left:.1f} mm, {np.degrees(turn):.1f} deg"
)

rng = np.random.default_rng(0)
commands = [
    Commands(rng.uniform(0.06, 0.12, (8, 2)), rng.uniform(0.3, 3.1, 8))
    for _ in range(robots)
]
damage = ["wheel_gain:wheel=left,factor=0.8@1"]  # from trial 1 on
worlds = {
    "physics": registry.make("mujoco", damage=damage),
    "static SNN": registry.make("static-snn", nets=nets, damage=damage),
    "ideal robot": registry.make("static-snn", damage=damage),  # no lag, no slip
}
poses = {
    (name, trial): np.stack(
        [done.command_poses_world for done in world.run(commands, trial=trial)]
    )
    for name, world in worlds.items()
    for trial in (0, 1)
}

print(f"\nOver {robots} robots       off per command   damage moves the end by")
for name in worlds:
    moved = body_displacements(poses[name, 0])
    off = moved - body_displacements(poses["physics", 0])
    error = 1000 * np.sqrt(np.mean(np.sum(off[..., :2] ** 2, axis=-1)))
    shift = poses[name, 1][:, -1, :2] - poses[name, 0][:, -1, :2]
    distance = np.median(np.linalg.norm(shift, axis=1))
    print(f"{name:14} {error:17.1f} mm {distance:20.2f} m")
