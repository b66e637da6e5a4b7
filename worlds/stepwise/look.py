"""Pictures of a robot that is stepped."""

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bns import models
from bns.models import arena
from bns.worlds import objects
from bns.worlds.light.world import LightWorld

if TYPE_CHECKING:
    from bns.worlds.stepwise.core import Stepwise


def scene(world: Any) -> Any:
    """The world's arena with its robot, as a `mujoco.MjSpec` to look at."""
    if hasattr(world, "field"):
        return spec(world)
    return models.scene_spec(world.robot)


@cache
def _compiled(world: Any) -> tuple[Any, Any]:
    import mujoco

    model = scene(world).compile()
    return model, mujoco.MjData(model)


def place(stepper: "Stepwise", model: Any, data: Any) -> None:
    """Put a model for pictures where the stepped robot is.

    Args:
        stepper: whose robot it is.
        model: a compiled `mujoco.MjModel` of `scene`.
        data: its `mujoco.MjData`; changed.
    """
    import mujoco

    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    state = stepper.state()
    if state is not None and np.isfinite(state).all():
        data.time = state[0]
        data.qpos[:] = state[1 : 1 + model.nq]
        data.qvel[:] = state[1 + model.nq : 1 + model.nq + model.nv]
    else:
        x, y, yaw = stepper.pose()
        free = data.qpos[:7]
        data.qpos[:7] = [x, y, free[2], np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]
    mujoco.mj_forward(model, data)


def picture(stepper: "Stepwise", size: tuple[int, int]) -> np.ndarray:
    """The arena as it is, ``(height, width, 3)``, uint8."""
    from bns.models import render

    model, data = _compiled(stepper.world)
    place(stepper, model, data)
    return render.photograph(
        model, data, camera="perspective", size=size, shadows=False
    )


def spec(world: LightWorld) -> Any:
    """The world's robot on the board, with lamps, their boundaries and objects.

    Args:
        world: whose lamps are shown.

    Returns:
        A `mujoco.MjSpec` for pictures and recordings; physics has its own model.
    """
    made = models.scene_spec(world.robot)
    places = [tuple(place) for place in world.field.positions.tolist()]
    arena.add(made, places, safety=world.supervisor.safety)
    objects.stand(made, world.posts)
    return made
