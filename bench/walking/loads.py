"""What a walking robot stands on: its weight on feet, shins, thighs and belly."""

from collections.abc import Sequence

import numpy as np

PARTS = ("foot", "tibia", "femur", "belly")
EVERY = 4  # steps of the physics


def shares(lists: Sequence[np.ndarray]) -> np.ndarray:
    """Share of the floor's push on each of `PARTS` over whole trials, ``(N, 4)``.

    Args:
        lists: goals, each ``(K, 18)`` [rad], walked undamaged.
    """
    from bench.walking import runs

    world, commands = runs.standing_by(lists)
    return np.array([_shares(world, plan) for plan in world.plan(commands)])


def _shares(world, plan) -> np.ndarray:
    import mujoco

    (done,) = world.motions([plan])
    model = plan.job.pieces[0].compiled.model
    data, total = mujoco.MjData(model), np.zeros(len(PARTS))
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS
    for state, control in zip(
        done.states[::EVERY], done.control[::EVERY], strict=False
    ):
        mujoco.mj_setState(model, data, state, whole)
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        total += _pushes(model, data)
    return total / total.sum()


def _pushes(model, data) -> np.ndarray:
    """Normal force of the floor on each of `PARTS` [N]."""
    import mujoco

    found, force = np.zeros(len(PARTS)), np.zeros(6)
    for number, contact in enumerate(data.contact):
        bodies = model.geom_bodyid[contact.geom]
        if bodies.min() > 0:
            continue
        mujoco.mj_contactForce(model, data, number, force)
        name = model.geom(int(contact.geom[bodies.argmax()])).name
        found[[part in name for part in PARTS].index(True)] += force[0]
    return found
