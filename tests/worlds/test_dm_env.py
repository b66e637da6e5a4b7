"""Worlds as dm_env environments, under dm-control's wrappers and viewer."""

import numpy as np
import pytest

from bns.errors import BnsError

dm_env = pytest.importorskip("dm_env")


def make(world="light", **settings):
    from bns.worlds.stepwise.dm_env_view import RobotEnvironment

    return RobotEnvironment(world, **settings)


@pytest.mark.parametrize("name", ["light", "mujoco", "static-snn"])
def test_time_steps_keep_to_their_specs(name):
    env = make(name, cycles=3)
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
    first, again, other = make(seed=1), make(seed=1), make(seed=2)
    for _ in range(2):
        seen = [env.reset().observation["light_left"] for env in (first, again, other)]
        assert seen[0] == seen[1] != seen[2]


def test_damage_changes_what_is_seen():
    env = make(damage=["sensor_stuck_min:sensor=left,blend=1"])
    seen = env.reset().observation
    assert seen["light_left"] == 0 and seen["light_right"] > 0


def test_bad_seeds_are_refused():
    with pytest.raises(BnsError, match="seed = -1"):
        make(seed=-1)


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
        env = make(cycles=5)
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

        scaled = action_scale.Wrapper(make(cycles=3), minimum=-5.0, maximum=5.0)
        plain = make(cycles=3)
        scaled.reset(), plain.reset()
        one, other = scaled.step(np.array([5.0, 0.0])), plain.step(np.array([1.0, 0.0]))
        assert one.observation == other.observation and one.reward == other.reward

    def test_the_wrapper_of_pixels(self, run_python):
        """In a process of its own: dm-control chooses OpenGL when it is imported."""
        assert "seen" in run_python("-c", PIXELS, MUJOCO_GL="egl")

    def test_the_viewers_runtime_steps_it(self, run_python):
        """In a process of its own: the viewer takes OpenGL for a display."""
        assert "at 1.20 s" in run_python("-c", VIEWER)
