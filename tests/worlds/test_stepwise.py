"""Worlds one command at a time: as a whole trial, for Gymnasium and for dm_env."""

import numpy as np
import pytest

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.worlds import registry
from bns.worlds.stepwise.core import Stepwise
from bns.worlds.stepwise.episode import Episode, StayByLight
from bns.worlds.trial import Channel, Commands

RNG = np.random.default_rng(0)
ACTIONS = RNG.uniform(-1, 1, (8, 2))
GAIN = "wheel_gain:wheel=left,factor=0.6"


def rolled(episode, actions=ACTIONS, seed=3, start=None):
    """All that an episode gave."""
    return [episode.begin(seed, start), *(episode.act(action) for action in actions)]


@pytest.mark.parametrize("name", ["mujoco", "static-snn", "hexapod", "light"])
def test_steps_make_the_trial_that_all_commands_at_once_make(name):
    stepper = Stepwise(name, damage=["tracker_noise:position_sd=0.01"], cycle=0.4)
    low, high = stepper.bounds
    commands = RNG.uniform(0.3 * low, 0.3 * high, (3, len(low)))
    place = (-0.7, 0.1, 0.5) if name == "light" else None
    first = stepper.reset(seed=5, start=place)
    assert len(first.commands) == 0 and len(first.times) == 1
    steps = [stepper.step(command) for command in commands]
    settings = {"start": place} if place else {}
    world = registry.make(name, damage=stepper.world.damage, **settings)
    channels = tuple(Channel(*item) for item in stepper.model.channels)
    whole = world.run([Commands(commands, np.full(3, 0.4), channels)], seeds=[5])[0]
    assert steps[-1].observed.tobytes() == whole.observed.tobytes()
    assert first.observed[0].tobytes() == whole.observed[0].tobytes()
    for count, step in enumerate(steps, 1):
        seen = step.observed[step.boundaries]
        assert np.array_equal(seen, whole.observed[whole.boundaries[: count + 1]])


@pytest.mark.parametrize("name", ["light", "mujoco"])
def test_the_same_seed_gives_the_same_episode(name):
    same = [rolled(Episode(name)) for _ in range(2)]
    other = rolled(Episode(name), seed=4)
    for one, two in zip(*same, strict=True):
        assert np.array_equal(one.observation, two.observation)
        assert one.reward == two.reward
    if name == "light":  # whose start is drawn
        assert not np.array_equal(same[0][0].observation, other[0].observation)


def test_damage_is_an_option_and_has_an_onset():
    sound, hurt, later = (
        rolled(Episode("light", damage=damage, trial=trial))[-1].trial.observed
        for damage, trial in (((), 0), ([GAIN], 0), ([GAIN + "@2"], 0))
    )
    assert np.array_equal(sound, later)
    assert not np.array_equal(sound, hurt)


def test_the_rewards_of_an_episode_are_the_dissertations_fitness():
    """Equation 5.2, one execution: -sum | |p_j| - r_g | / d over the 100 positions."""
    start = (0.9, 0.0, np.pi)
    ahead = rolled(Episode("light", cycles=12), [[1.0, 1.0]] * 12, start=start)
    path = ahead[-1].trial.command_poses_world[:, :2]
    away = np.hypot(*path.T)
    fitness = -np.abs(away[1:] - 0.3).sum() / 0.9
    assert sum(seen.reward for seen in ahead) == pytest.approx(fitness, rel=1e-9)
    assert ahead[-1].late and not ahead[-1].over


def test_a_stopped_robot_ends_the_episode():
    episode = Episode("light", cycles=40)
    seen = rolled(episode, [[1.0, 1.0]] * 20, start=(0.6, 0.0, np.pi))
    over = [item.over for item in seen]
    assert over[-1] and not over[5]
    assert seen[-1].trial.outcome.lamp_stops == 1


def test_waypoints_are_reached_one_by_one():
    from bns.worlds.stepwise.episode import Waypoints

    episode = Episode("mujoco", reward=Waypoints([(0.1, 0.0), (0.4, 0.0)]))
    seen = rolled(episode, [[1.0, 1.0]] * 6)
    assert [item.reward for item in seen].count(1.0) == 2
    assert seen[-1].over and not seen[2].over
    assert seen[0].observation[3:].tolist() == [0.1, 0.0]
    assert seen[-1].observation[3:].tolist() == [0.4, 0.0]


BAD = {
    "NaN": (lambda: Episode("light").act([np.nan, 0]), BnsError, "2 finite numbers"),
    "shape": (lambda: Episode("light").act([0.0]), BnsError, "2 finite numbers"),
    "world": (lambda: Stepwise("lihgt"), UnknownNameError, "Did you mean 'light'"),
    "setting": (lambda: Stepwise("light", lamp=1), UnknownNameError, "lamp"),
    "cycles": (lambda: Stepwise("light", cycles=0), OutOfBoundsError, "cycles = 0"),
    "seed": (lambda: Stepwise("light").reset(-1), OutOfBoundsError, "seed = -1"),
    "made": (
        lambda: Stepwise(registry.make("light"), damage=[GAIN]),
        BnsError,
        "made already",
    ),
    "early": (lambda: Stepwise("light").step([0, 0]), BnsError, "call reset first"),
    "start": (
        lambda: Stepwise("static-snn").reset(0, (0, 0, 0)),
        BnsError,
        "takes no start",
    ),
    "radius": (lambda: StayByLight((0, 0), -1), OutOfBoundsError, "goal radius"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused(case):
    call, error, says = BAD[case]
    with pytest.raises(error, match=says):
        call()


def test_a_world_by_replay_ends_as_well():
    stepper = Stepwise("static-snn", cycles=1)
    stepper.reset()
    stepper.step([0.1, 0.1])
    with pytest.raises(BnsError, match="1 cycles of this trial are over"):
        stepper.step([0.1, 0.1])


def dm_environment(world="light", **settings):
    """A dm_env environment."""
    pytest.importorskip("dm_env")
    from bns.worlds.stepwise.dm_env_view import RobotEnvironment

    return RobotEnvironment(world, **settings)


@pytest.mark.parametrize("name", ["light", "mujoco", "static-snn"])
def test_time_steps_keep_to_their_specs(name):
    env = dm_environment(name, cycles=3)
    action = env.action_spec()
    step = env.reset()
    assert step.first() and step.reward is None
    for _ in range(3):
        step = env.step(np.full(action.shape, 0.3))
        assert set(step.observation) == set(env.observation_spec())
        for key, spec in env.observation_spec().items():
            spec.validate(step.observation[key])
        assert isinstance(step.reward, float)
    assert step.last() and step.discount == 1.0  # out of commands, not at an end
    assert env.step(np.zeros(2)).first()


def test_episodes_follow_the_seed():
    first, again, other = (
        dm_environment(seed=1),
        dm_environment(seed=1),
        dm_environment(seed=2),
    )
    for _ in range(2):
        seen = [env.reset().observation["light_left"] for env in (first, again, other)]
        assert seen[0] == seen[1] != seen[2]


def test_damage_changes_what_is_seen():
    env = dm_environment(damage=["sensor_stuck_min:sensor=left,blend=1"])
    seen = env.reset().observation
    assert seen["light_left"] == 0 and seen["light_right"] > 0


def test_bad_seeds_are_refused():
    with pytest.raises(BnsError, match="seed = -1"):
        dm_environment(seed=-1)


PIXELS = """
from dm_control.suite.wrappers import pixels
from bns.worlds.stepwise.dm_env_view import RobotEnvironment
env = RobotEnvironment("light", cycles=3)
env.reset()
options = {"width": 60, "height": 40, "camera_id": "perspective"}
seen = pixels.Wrapper(env, pixels_only=False, render_kwargs=options).reset()
assert seen.observation["pixels"].shape == (40, 60, 3)
assert seen.observation["pixels"].std() > 5
assert "light_left" in seen.observation
print("seen")
"""

VIEWER = """
import numpy as np
from dm_control.viewer import runtime
from bns.worlds.stepwise.dm_env_view import RobotEnvironment
env = RobotEnvironment("light", cycles=3)
player = runtime.Runtime(env, policy=lambda step: np.ones(2))
times = []
for _ in range(6):
    player.tick(time_elapsed=0.5, paused=False)
    times.append(env.physics.time())
print(f"at {max(times):.2f} s")
"""


class TestWithDmControl:
    """What dm-control's own tools need."""

    @pytest.fixture(autouse=True)
    def installed(self):
        pytest.importorskip("dm_control")

    def test_physics_shows_the_scene_as_it_is(self):
        env = dm_environment(cycles=5)
        env.reset()
        lamp = env.physics.named.data.site_xpos["lamp_0"]
        assert lamp == pytest.approx([0, 0, 0.2])
        before = env.physics.named.data.xpos["khepera3"].copy()
        for _ in range(3):
            env.step(np.ones(2))
        after = env.physics.named.data.xpos["khepera3"]
        assert np.hypot(*(after - before)[:2]) == pytest.approx(0.13, abs=0.03)
        assert env.physics.time() == pytest.approx(1.2)

    def test_the_wrapper_of_actions(self):
        from dm_control.suite.wrappers import action_scale

        scaled = action_scale.Wrapper(
            dm_environment(cycles=3), minimum=-5.0, maximum=5.0
        )
        plain = dm_environment(cycles=3)
        scaled.reset(), plain.reset()
        one, other = scaled.step(np.array([5.0, 0.0])), plain.step(np.array([1.0, 0.0]))
        assert one.observation == other.observation and one.reward == other.reward

    def test_the_wrapper_of_pixels(self, run_python):
        """In a process of its own: dm-control chooses OpenGL when it is imported."""
        assert "seen" in run_python("-c", PIXELS, MUJOCO_GL="egl")

    def test_the_viewers_runtime_steps_it(self, run_python):
        """In a process of its own: the viewer takes OpenGL for a display."""
        assert "at 1.20 s" in run_python("-c", VIEWER)
