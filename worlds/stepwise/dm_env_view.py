"""Worlds as dm_env environments, one command a step; for dm-control as well.

    from bns.worlds.stepwise.dm_env_view import RobotEnvironment
    env = RobotEnvironment("light", damage=["sensor_stuck_min:blend=1"], seed=1)

Where dm-control is installed, `env.physics` is its physics of the scene as it is, so
that its wrappers (pixels) and its viewer work:

    from dm_control import viewer
    viewer.launch(env)
"""

from functools import cached_property
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError, MissingDependencyError, install
from bns.worlds.stepwise import look
from bns.worlds.stepwise.episode import Episode, Seen

try:
    import dm_env
    from dm_env import specs
except ModuleNotFoundError as error:
    raise MissingDependencyError(
        "A dm_env environment", "dm-env", install("dm")
    ) from error


class RobotEnvironment(dm_env.Environment):
    """One robot in a world; a step is a command, an action is from -1 to 1.

    Observations are a mapping from name to number, see `Episode`. An episode ends with
    a discount of 0 when the task is done or the robot stopped, fell or was lost, and
    with 1 when its commands are used up.

    Args:
        world: registered name, or a world.
        seed: of the episodes, one after another.
        settings: of `Episode` and `Stepwise`: damage, trial, cycles, cycle, reward,
            and those of the world.
    """

    def __init__(self, world: Any = "light", *, seed: int = 0, **settings: Any):
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise BnsError(f"seed = {seed!r}: give a whole number from 0 on.")
        self.episode = Episode(world, **settings)
        self._seed, self._count, self._running = seed, 0, False

    def reset(self) -> dm_env.TimeStep:
        """Begin the next episode."""
        drawn = seeding.integer(self._seed, "episode", self._count)
        self._count, self._running = self._count + 1, True
        return dm_env.restart(self._observation(self.episode.begin(drawn)))

    def step(self, action: Any) -> dm_env.TimeStep:
        """Do one command; after the last one, begin the next episode."""
        if not self._running:
            return self.reset()
        seen = self.episode.act(action)
        self._running = not (seen.over or seen.late)
        observation = self._observation(seen)
        if seen.over:
            return dm_env.termination(seen.reward, observation)
        if seen.late:
            return dm_env.truncation(seen.reward, observation)
        return dm_env.transition(seen.reward, observation)

    def action_spec(self) -> specs.BoundedArray:
        """From -1 to 1, one number for each command channel."""
        count = self.episode.actions
        return specs.BoundedArray((count,), np.float64, -1.0, 1.0, name="command")

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        """A number for each name."""
        limits = zip(
            self.episode.names, self.episode.low, self.episode.high, strict=True
        )
        return {
            name: specs.BoundedArray((1,), np.float64, low, high, name=name)
            for name, low, high in limits
        }

    def _observation(self, seen: Seen) -> dict[str, np.ndarray]:
        if "physics" in self.__dict__:
            self._show()
        pairs = zip(self.episode.names, seen.observation, strict=True)
        return {name: np.array([value]) for name, value in pairs}

    @cached_property
    def physics(self) -> Any:
        """A `dm_control.mujoco.Physics` of the scene as it is; for looking at.

        Raises:
            MissingDependencyError: dm-control is not installed (there is none for
                Python 3.13).
        """
        try:
            from dm_control import mujoco
            from dm_control.mujoco import wrapper
        except ModuleNotFoundError as error:
            raise MissingDependencyError(
                "env.physics", "dm-control", install("dm")
            ) from error
        model = look.scene(self.episode.stepper.world).compile()
        physics = mujoco.Physics.from_model(wrapper.MjModel(model))
        look.place(self.episode.stepper, physics.model.ptr, physics.data.ptr)
        return physics

    def _show(self) -> None:
        physics = self.physics
        look.place(self.episode.stepper, physics.model.ptr, physics.data.ptr)
