"""The arena with its lamps and objects, to be looked at."""

from typing import Any

from bns import models
from bns.models.arena import lamps
from bns.worlds import objects
from bns.worlds.light.world import LightWorld


def spec(world: LightWorld) -> Any:
    """The world's robot on the board, with lamps, their boundaries and objects.

    Args:
        world: whose lamps are shown.

    Returns:
        A `mujoco.MjSpec` for pictures and recordings; physics has its own model.
    """
    made = models.scene_spec(world.robot)
    places = [tuple(place) for place in world.field.positions.tolist()]
    lamps.add(made, places, safety=world.supervisor.safety)
    objects.stand(made, world.posts)
    return made
