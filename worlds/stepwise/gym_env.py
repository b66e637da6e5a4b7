"""Worlds as Gymnasium environments, one command a step.

    import gymnasium
    env = gymnasium.make("bns.worlds.stepwise.gym_env:bns/Light-v0",
                         damage=["wheel_gain:wheel=left,factor=0.8"])

Registered are `bns/Light-v0`, `bns/Navigation-v0` and `bns/Hexapod-v0`; `RobotEnv`
shows any other world. Options of `reset`: `start`, a pose (x, y, yaw), and `trial`, the
number of the trial, for damage with an onset.
"""

from typing import Any

import numpy as np

from bns.errors import BnsError, MissingDependencyError
from bns.worlds.checks import bounded
from bns.worlds.stepwise.episode import Episode, Seen

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError as error:
    raise MissingDependencyError(
        "A Gymnasium environment", "gymnasium", "pip install 'bns-testbed[gym]'"
    ) from error

IDS = {
    "bns/Light-v0": "light",
    "bns/Navigation-v0": "mujoco",
    "bns/Hexapod-v0": "hexapod",
}
"""world of each registered environment"""


class RobotEnv(gymnasium.Env):
    """One robot in a world; a step is a command, an action is from -1 to 1.

    Observations are what the world observes, in its units (`Episode.names`): readings
    of the light sensors in the world "light", else the pose and the next goal. The
    episode is terminated when the task is done or the robot stopped, fell or was lost,
    and truncated when its commands are used up.

    Args:
        world: registered name, or a world.
        render_mode: None or "rgb_array".
        settings: of `Episode` and `Stepwise`: damage, trial, cycles, cycle, reward,
            and those of the world.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 3}  # noqa: RUF012

    def __init__(
        self, world: Any = "light", *, render_mode: str | None = None, **settings: Any
    ):
        if render_mode not in (None, "rgb_array"):
            raise BnsError(f"render_mode = {render_mode!r}: give None or 'rgb_array'.")
        self.episode, self.render_mode = Episode(world, **settings), render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (self.episode.actions,), np.float32)
        self.observation_space = spaces.Box(
            self.episode.low.astype(np.float32),
            self.episode.high.astype(np.float32),
            dtype=np.float32,
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; the same seed gives the same one.

        Args:
            seed: of the episode; None = the generator goes on.
            options: "start", a pose [m, m, rad], and "trial", the number of the trial.

        Returns:
            the observation, like `observation_space`; further values by name.

        Raises:
            BnsError: an option that there is not, or a start that can not be.
        """
        super().reset(seed=seed)
        given = dict(options or {})
        start, trial = given.pop("start", None), given.pop("trial", None)
        if given:
            raise BnsError(f"reset has no option {', '.join(given)}: start, trial.")
        if trial is not None:
            number = bounded("trial", trial, 0, 1e9, "1")
            self.episode.stepper.trial_number = int(number)
        drawn = int(self.np_random.integers(2**31))
        seen = self.episode.begin(drawn, start)
        return self._observation(seen), self._info(seen)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """See `gymnasium.Env.step`: one command; observed as in `reset`."""
        seen = self.episode.act(action)
        return (
            self._observation(seen), seen.reward, seen.over,
            seen.late and not seen.over, self._info(seen),
        )  # fmt: skip

    def render(self) -> np.ndarray | None:
        """The arena, ``(height, width, 3)`` uint8, if `render_mode` is "rgb_array"."""
        return self.episode.stepper.picture() if self.render_mode else None

    def _observation(self, seen: Seen) -> np.ndarray:
        return seen.observation.astype(np.float32)

    def _info(self, seen: Seen) -> dict[str, Any]:
        outcome = seen.trial.outcome
        return {
            "pose_world": self.episode.stepper.pose(),
            "edge_turns": outcome.edge_turns,
            "lamp_stops": outcome.lamp_stops,
            "diverged": outcome.diverged,
        }


def register() -> None:
    """Make the environments known to Gymnasium; done when this module is imported."""
    for name, world in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="bns.worlds.stepwise.gym_env:RobotEnv",
                kwargs={"world": world},
                order_enforce=True,
            )


register()
