"""Worlds as Gymnasium environments, and a public algorithm that learns on one."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.worlds.stepwise import episode

gymnasium = pytest.importorskip("gymnasium")
checker = pytest.importorskip("gymnasium.utils.env_checker")

MODULE = "bns.worlds.stepwise.gym_env"
GAIN = "wheel_gain:wheel=left,factor=0.6"


def make(name="Light", **settings):
    """A registered environment."""
    return gymnasium.make(f"{MODULE}:bns/{name}-v0", **settings)


@pytest.mark.parametrize("name", ["Light", "Navigation", "Hexapod"])
@pytest.mark.filterwarnings("error")
def test_gymnasium_finds_nothing_wrong(name):
    checker.check_env(make(name, cycles=3).unwrapped, skip_render_check=True)


@pytest.mark.filterwarnings("error")
def test_gymnasium_finds_nothing_wrong_with_pictures(opengl):
    checker.check_env(make(render_mode="rgb_array", cycles=3).unwrapped)


def test_any_other_world_can_be_shown():
    from bns.worlds.stepwise.gym_env import RobotEnv

    checker.check_env(RobotEnv("static-snn"), skip_render_check=True)


def test_an_episode_is_truncated_when_its_commands_are_used_up():
    env = make(cycles=3)
    env.reset(seed=1)
    ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_the_scene_is_drawn(opengl):
    env = make(cycles=3, render_mode="rgb_array")
    env.reset(seed=1)
    env.step(np.zeros(2, np.float32))
    picture = env.render()
    assert picture.shape == (320, 480, 3) and picture.std() > 10


def test_damage_start_and_trial_are_options():
    start = (0.8, 0.1, 0.3)
    plain, hurt = make(cycles=4), make(cycles=4, damage=[GAIN + "@3"])
    ahead = np.ones(2, np.float32)

    def end(env, **options):
        env.reset(seed=1, options={"start": start, **options})
        for _ in range(4):
            *_, info = env.step(ahead)
        return info["pose_world"]

    assert np.array_equal(end(hurt), end(plain))
    assert end(hurt, trial=3)[2] > end(plain)[2] + 0.2  # the left wheel lags
    with pytest.raises(BnsError, match="no option colour"):
        plain.reset(options={"colour": 1})
    from bns.worlds.stepwise.gym_env import RobotEnv

    with pytest.raises(BnsError, match="'human'"):
        RobotEnv(render_mode="human")


def test_observations_are_the_sensors_in_counts():
    env = make()
    assert env.unwrapped.episode.names == ("light_left", "light_right")
    assert env.observation_space.high.tolist() == [4095, 4095]
    seen, _ = env.reset(seed=1, options={"start": (0.5, 0.0, np.pi)})
    assert seen.max() < 3000  # the lamp is ahead
    away, _ = env.reset(seed=1, options={"start": (0.5, 0.0, 0.0)})
    assert away.min() > 3900


def test_environments_run_side_by_side():
    both = gymnasium.make_vec(
        f"{MODULE}:bns/Light-v0", num_envs=2, vectorization_mode="sync", cycles=3
    )
    seen, _ = both.reset(seed=[1, 2])
    assert seen.shape == (2, 2) and not np.array_equal(*seen)
    assert both.step(np.zeros((2, 2), np.float32))[1].shape == (2,)


@pytest.mark.parametrize("name", ["Light", "Navigation", "Hexapod"])
@pytest.mark.filterwarnings("error")
def test_a_batch_gives_what_single_environments_give(name):
    """Observations, rewards, ends and infos, over the begin of new episodes."""
    count = {"num_envs": 3, "cycles": 3}
    native = gymnasium.make_vec(f"{MODULE}:bns/{name}-v0", **count)
    single = gymnasium.make_vec(
        f"{MODULE}:bns/{name}-v0", vectorization_mode="sync", **count
    )
    assert type(native).__name__ == "RobotVectorEnv"
    assert native.observation_space == single.observation_space
    assert native.action_space == single.action_space
    native.action_space.seed(5)
    assert checker.data_equivalence(native.reset(seed=5), single.reset(seed=5))
    for _ in range(9):
        action = native.action_space.sample()
        seen, other = native.step(action), single.step(action)
        assert checker.data_equivalence(seen, other)
        assert seen[0] in native.observation_space


def test_robots_of_a_batch_end_at_different_times():
    settings = {"num_envs": 3, "cycles": 4, "damage": [GAIN + "@3"]}
    goals = {"reward": episode.Waypoints([(0.05, 0.0), (0.12, 0.0)])}
    native = gymnasium.make_vec(f"{MODULE}:bns/Navigation-v0", **settings, **goals)
    native.reset(seed=1, options={"trial": 3})
    ahead = np.array([[1, 1], [-1, -1], [0, 0]], np.float32)
    steps = [native.step(ahead) for _ in range(6)]
    over, late = (np.array([step[at] for step in steps]) for at in (2, 3))
    assert over[:, 0].any() and not over[:, 1:].any()
    assert late[3, 1:].all() and not late[:3].any()
    first = int(over[:, 0].argmax())
    assert np.abs(steps[first + 1][0][0, :3]).max() < 1e-6
    assert steps[first + 1][1][0] == 0.0  # it began anew, the others went on
    assert steps[1][4]["pose_world"].shape == (3, 3)


def test_some_robots_of_a_batch_begin_anew():
    native = gymnasium.make_vec(f"{MODULE}:bns/Light-v0", num_envs=2, cycles=5)
    with pytest.raises(BnsError, match="call reset first"):
        native.step(np.zeros((2, 2)))
    with pytest.raises(BnsError, match="3 seeds for 2 robots"):
        native.reset(seed=[1, 2, 3])
    some = {"reset_mask": np.array([True, False])}
    with pytest.raises(BnsError, match="reset all of them first"):
        native.reset(options=some)
    with pytest.raises(BnsError, match="reset first"):
        native.step(np.ones((2, 2)))
    native.reset(seed=[1, 2], options={"start": (0.8, 0.1, 0.3)})
    for wrong in ([True], [1, 0], "both"):
        with pytest.raises(BnsError, match="reset_mask has shape"):
            native.reset(options={"reset_mask": wrong})
    seen = native.step(np.ones((2, 2)))[0]
    again, _ = native.reset(options=some)
    assert np.array_equal(again[1], seen[1]) and not np.array_equal(again[0], seen[0])
    native.step(np.ones((2, 2)))
    with pytest.raises(BnsError, match="finite"):
        native.step(np.full((2, 2), np.nan))


def test_cma_es_learns_to_come_near_the_lamp():
    """A linear controller of six weights, by a public algorithm, in a few steps."""
    cma = pytest.importorskip("cma")
    env = make(cycles=15)
    starts = [(0.8, 0.2, 1.5), (-0.7, -0.4, -2.0)]

    def cost(weights):
        total = 0.0
        for start in starts:
            seen, _ = env.reset(seed=1, options={"start": start})
            over = False
            while not over:
                bright = np.append(1 - seen / 4095, 1.0)
                action = np.tanh(np.reshape(weights, (2, 3)) @ bright)
                seen, reward, done, late, _ = env.step(action.astype(np.float32))
                total, over = total - reward, done or late
        return total

    search = cma.CMAEvolutionStrategy(
        np.zeros(6), 1.0, {"seed": 2, "popsize": 5, "verbose": -9}
    )
    means = []
    for _ in range(4):
        weights = search.ask()
        costs = [cost(item) for item in weights]
        search.tell(weights, costs)
        means.append(np.mean(costs))
    assert search.result.fbest < 0.8 * cost(np.zeros(6))
    assert np.mean(means[2:]) < np.mean(means[:2])
