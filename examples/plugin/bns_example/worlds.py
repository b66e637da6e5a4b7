"""A world: the board of the testbed, of ice."""

from collections.abc import Sequence
from typing import Any

from bns.worlds import registry
from bns.worlds.world import World

GRIP = 0.2
"""friction of the floor over that of the model [1]"""


def ice(*, reality: Sequence[str] = (), **settings: Any) -> World:
    """MuJoCo, with a floor that hardly grips.

    Args:
        reality: effects that always hold, besides the ice.
        settings: as the world "mujoco" takes them.

    Raises:
        BnsError: a setting that the world "mujoco" refuses.
    """
    slippery = f"floor_friction:factor={GRIP}"
    return registry.make("mujoco", reality=[slippery, *reality], **settings)
