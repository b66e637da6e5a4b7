"""Worlds as Gymnasium environments, one command a step.

    import gymnasium
    env = gymnasium.make("bns.worlds.stepwise.gym_env:bns/Light-v0",
                         damage=["wheel_gain:wheel=left,factor=0.8"])

Registered are `bns/Light-v0`, `bns/Navigation-v0` and `bns/Hexapod-v0`; `RobotEnv`
shows any other world. `gymnasium.make_vec(..., num_envs=64)` steps many robots in one
batch on all cores (`RobotVectorEnv`). Options of `reset`: `start`, a pose (x, y, yaw),
and `trial`, the number of the trial, for damage with an onset.
"""

import os
from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from bns.errors import BnsError, MissingDependencyError, install
from bns.worlds import registry
from bns.worlds.checks import bounded
from bns.worlds.stepwise.core import reset_all, step_all
from bns.worlds.stepwise.episode import Episode, Reward, Seen

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as error:
    raise MissingDependencyError(
        "A Gymnasium environment", "gymnasium", install("gym")
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
        start = _options(options, [self.episode])
        seen = self.episode.begin(_drawn(self.np_random), start)
        return _observation(seen), _info(self.episode, seen)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """See `gymnasium.Env.step`: one command; observed as in `reset`."""
        seen = self.episode.act(action)
        return (
            _observation(seen), seen.reward, seen.over,
            seen.late and not seen.over, _info(self.episode, seen),
        )  # fmt: skip

    def render(self) -> np.ndarray | None:
        """The arena, ``(height, width, 3)`` uint8, if `render_mode` is "rgb_array"."""
        return self.episode.stepper.picture() if self.render_mode else None


class RobotVectorEnv(VectorEnv):
    """N robots in a world, stepped in one batch; each as `RobotEnv` has one.

    `gymnasium.make_vec` gives it for the registered names. With the same seeds it gives
    what N single environments give. An episode that ended begins anew at the next step,
    whose action is not used (`AutoresetMode.NEXT_STEP`).

    Args:
        num_envs: N.
        world: registered name, or a world.
        reward: what is rewarded; None = what the world is for. Each robot has a copy.
        render_mode: None or "rgb_array".
        settings: as of `RobotEnv`.
    """

    metadata = {  # noqa: RUF012
        **RobotEnv.metadata,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        world: Any = "light",
        *,
        reward: Reward | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ):
        self.num_envs = int(bounded("num_envs", num_envs, 1, 1e6, "1"))
        if isinstance(world, str) and "threads" in registry.settings(world):
            settings = {"threads": os.cpu_count() or 1, **settings}
        one = RobotEnv(world, reward=reward, render_mode=render_mode, **settings)
        self.render_mode = one.render_mode
        self.episodes = [one.episode] + [
            one.episode.another(deepcopy(reward)) for _ in range(self.num_envs - 1)
        ]
        self.single_action_space = one.action_space
        self.single_observation_space = one.observation_space
        self.action_space = batch_space(one.action_space, self.num_envs)
        self.observation_space = batch_space(one.observation_space, self.num_envs)
        self._rngs = [seeding.np_random()[0] for _ in self.episodes]
        self._ended = np.zeros(self.num_envs, bool)
        self._seen: list[Seen] = []

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode of each robot; the same seeds give the same ones.

        Args:
            seed: of the first robot, those of others follow it; or one for each; None
                = the generators go on.
            options: as of `RobotEnv.reset`, for all; "reset_mask": which robots begin
                one, ``(N,)`` of bool, while the others are as they were.

        Returns:
            observations ``(N, O)``; further values by name, ``(N, ...)``.

        Raises:
            BnsError: another number of seeds, a mask of another shape or that leaves a
                robot without its first episode; as `RobotEnv.reset`.
        """
        seeds = [seed] * self.num_envs if seed is None else seed
        if isinstance(seeds, int | np.integer):
            seeds = [int(seeds) + robot for robot in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise BnsError(f"{len(seeds)} seeds for {self.num_envs} robots: one each.")
        options = dict(options or {})
        chosen = self._mask(options.pop("reset_mask", None))
        start = _options(options, self.episodes)
        robots = np.flatnonzero(chosen).tolist()
        for robot in robots:
            if seeds[robot] is not None:
                self._rngs[robot] = seeding.np_random(seeds[robot])[0]
        self._begin(robots, start)
        self._ended[robots] = False
        return self._observed(), self._told(robots)

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One command of each robot.

        Args:
            actions: shape ``(N, C)``, from -1 to 1.

        Returns:
            observations ``(N, O)``; rewards, terminated and truncated, each ``(N,)``;
            further values by name, ``(N, ...)``.

        Raises:
            BnsError: another shape, NaN, or no episode.
        """
        actions = np.asarray(actions)
        if len(actions) != self.num_envs:
            raise BnsError(f"{len(actions)} actions for {self.num_envs} robots.")
        if not self._seen:
            raise BnsError("There is no episode to go on with; call reset first.")
        going = np.flatnonzero(~self._ended).tolist()
        if len(going) < self.num_envs:
            self._begin(np.flatnonzero(self._ended).tolist(), None)
        if going:
            episodes = [self.episodes[robot] for robot in going]
            commands = [
                e.command(actions[r]) for e, r in zip(episodes, going, strict=True)
            ]
            trials = step_all([e.stepper for e in episodes], commands)
            for robot, trial in zip(going, trials, strict=True):
                self._seen[robot] = self.episodes[robot].acted(trial)
        acted = ~self._ended
        over = np.array([seen.over for seen in self._seen]) & acted
        late = np.array([seen.late for seen in self._seen]) & acted & ~over
        rewards = np.where(acted, [seen.reward for seen in self._seen], 0.0)
        self._ended = over | late
        return self._observed(), rewards, over, late, self._told(range(self.num_envs))

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The arena of each robot, ``(height, width, 3)`` uint8, see `RobotEnv`."""
        if not self.render_mode:
            return None
        return tuple(episode.stepper.picture() for episode in self.episodes)

    def _mask(self, given: Any) -> np.ndarray:
        """Which robots begin an episode, ``(N,)`` bool.

        Args:
            given: the same; None = all.

        Raises:
            BnsError: another shape or type, or not all at the first reset.
        """
        everyone = np.ones(self.num_envs, bool)
        mask = everyone if given is None else np.asarray(given)
        if mask.shape != everyone.shape or mask.dtype != everyone.dtype:
            raise BnsError(
                f"reset_mask has shape {mask.shape} of {mask.dtype}: give shape "
                f"({self.num_envs},) of bool."
            )
        if not self._seen and not mask.all():
            raise BnsError(
                "No robot has an episode yet: reset all of them first, without a "
                "reset_mask."
            )
        return mask

    def _begin(self, robots: Sequence[int], start: Any) -> None:
        """Begin episodes of some robots."""
        if not robots:
            return
        seeds = [_drawn(self._rngs[robot]) for robot in robots]
        steppers = [self.episodes[robot].stepper for robot in robots]
        trials = reset_all(steppers, seeds, start)
        begun = [
            self.episodes[robot].begun(trial)
            for robot, trial in zip(robots, trials, strict=True)
        ]
        self._seen = self._seen or begun  # the first are of all robots
        for robot, seen in zip(robots, begun, strict=True):
            self._seen[robot] = seen

    def _observed(self) -> np.ndarray:
        return np.stack([_observation(seen) for seen in self._seen])

    def _told(self, robots: Sequence[int]) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for robot in robots:
            info = _info(self.episodes[robot], self._seen[robot])
            infos = self._add_info(infos, info, robot)
        return infos


def _options(options: dict[str, Any] | None, episodes: Sequence[Episode]) -> Any:
    """The start among the options of `reset`; the number of the trial is set.

    Raises:
        BnsError: an option that there is not.
    """
    given = dict(options or {})
    start, trial = given.pop("start", None), given.pop("trial", None)
    if given:
        raise BnsError(f"reset has no option {', '.join(given)}: start, trial.")
    if trial is not None:
        number = int(bounded("trial", trial, 0, 1e9, "1"))
        for episode in episodes:
            episode.stepper.trial_number = number
    return start


def _drawn(rng: np.random.Generator) -> int:
    """The seed of an episode."""
    return int(rng.integers(2**31))


def _observation(seen: Seen) -> np.ndarray:
    return seen.observation.astype(np.float32)


def _info(episode: Episode, seen: Seen) -> dict[str, Any]:
    outcome = seen.trial.outcome
    return {
        "pose_world": episode.stepper.pose(),
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
                vector_entry_point="bns.worlds.stepwise.gym_env:RobotVectorEnv",
                kwargs={"world": world},
                order_enforce=True,
            )


register()
