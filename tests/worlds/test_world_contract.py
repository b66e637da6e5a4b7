"""Every registered world keeps the contract of `bns.worlds.world.World`."""

import numpy as np
import pytest

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.worlds import registry
from bns.worlds.trial import WHEEL_CHANNELS, Channel, Commands, Trial
from bns.worlds.world import World

NAMES = registry.names()
GAIN = "wheel_gain:wheel=left,factor=0.8@3"
NOISE = "tracker_noise:position_sd=0.01"


def lists(count, seed=0):
    """Random lists of commands, of different lengths."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 7, count)
    return [
        Commands(rng.uniform(-0.12, 0.12, (k, 2)), rng.uniform(0.2, 1.5, k))
        for k in lengths
    ]


def same(one: Trial, other: Trial) -> bool:
    """Whether two trials are equal to the last bit."""
    return (
        one.times.tobytes() == other.times.tobytes()
        and one.observed.tobytes() == other.observed.tobytes()
        and (one.boundaries == other.boundaries).all()
        and one.outcome == other.outcome
        and one.conditions == other.conditions
    )


@pytest.fixture(scope="module", params=NAMES)
def name(request):
    """Name of a world."""
    return request.param


def test_it_has_one_line_of_description(name):
    line = registry.describe()[name]
    assert line and "\n" not in line


def test_it_is_a_world_and_gives_whole_trials(name):
    world = registry.make(name)
    assert isinstance(world, World)
    commands = lists(4)
    trials = world.run(commands, trial=2, seeds=[1, 2, 3, 4])
    assert len(trials) == 4
    for trial, sent in zip(trials, commands, strict=True):
        assert trial.commands is sent
        assert (trial.robot, trial.world) == (world.robot, world.name)
        assert trial.boundaries[0] == 0
        assert trial.boundaries[-1] == len(trial.times) - 1
        assert trial.times[0] == 0
        ends = trial.times[trial.boundaries[1:]]
        assert np.abs(ends - np.cumsum(sent.durations)).max() <= 0.005 * len(sent)
        assert np.isfinite(trial.observed).all()
        assert trial.poses_world[0] == pytest.approx([0, 0, 0], abs=1e-9)
        assert trial.outcome.usable
        assert trial.conditions["trial"] == 2


def test_a_batch_equals_single_trials_and_order_does_not_matter(name):
    commands = lists(5)
    seeds = [3, 1, 4, 1, 5]
    world = registry.make(name, reality=[NOISE], damage=[GAIN])
    batch = world.run(commands, trial=3, seeds=seeds)
    for item, seed, trial in zip(commands, seeds, batch, strict=True):
        assert same(world.run([item], trial=3, seeds=[seed])[0], trial)
    backwards = world.run(commands[::-1], trial=3, seeds=seeds[::-1])
    assert all(map(same, backwards[::-1], batch))


def test_seed_and_trial_decide_what_is_random(name):
    world = registry.make(name, reality=[NOISE])
    (commands,) = lists(1)
    first = world.run([commands], seeds=[7])[0]
    assert same(world.run([commands], seeds=[7])[0], first)
    other_seed = world.run([commands], seeds=[8])[0]
    other_trial = world.run([commands], seeds=[7], trial=1)[0]
    assert not np.array_equal(first.observed, other_seed.observed)
    assert not np.array_equal(first.observed, other_trial.observed)


def test_damage_sets_in_at_its_trial_and_is_in_the_record(name):
    commands = [Commands([[0.1, 0.1]], [1.0])]
    sound, damaged = registry.make(name), registry.make(name, damage=[GAIN])
    for trial in (0, 2):
        assert same(
            sound.run(commands, trial=trial)[0], damaged.run(commands, trial=trial)[0]
        )
    hit = damaged.run(commands, trial=3)[0]
    assert hit.poses_world[-1, 2] > 0.1  # the left wheel lags: it turns left
    assert hit.conditions["damage"] == ["wheel_gain:wheel=left,factor=0.8"]


def test_each_robot_may_have_its_own_damage(name):
    commands = [Commands([[0.1, 0.1]], [1.0])] * 3
    left, right = (
        "wheel_gain:wheel=left,factor=0.8",
        "wheel_gain:wheel=right,factor=0.8",
    )
    world = registry.make(name, damage=[(), (left,), (right,)])
    turns = [trial.poses_world[-1, 2] for trial in world.run(commands)]
    assert turns[1] > 0.1
    assert turns[2] < -0.1
    assert abs(turns[0]) < 0.01


def test_an_effect_added_does_not_move_the_noise_of_another(name):
    commands = [Commands([[0.1, 0.05]], [1.0])]
    drift = "clock_drift:rate=0.01"
    alone = registry.make(name, reality=[NOISE]).run(commands)[0]
    beside = registry.make(name, reality=[drift, NOISE]).run(commands)[0]
    assert np.array_equal(alone.observed, beside.observed)
    assert not np.array_equal(alone.times, beside.times)


def test_it_starts_where_told_and_flags_leaving_the_arena(name):
    world = registry.make(name, start=(1.3, 0.2, 0.0))
    trial = world.run([Commands([[0.1, 0.1]], [1.5])])[0]
    assert trial.poses_world[0] == pytest.approx([1.3, 0.2, 0], abs=1e-9)
    assert trial.outcome.left_arena
    assert trial.poses_world[-1, 0] > 1.4  # and goes on
    back = world.run([Commands([[-0.1, -0.1]], [1.5])])[0]
    assert not back.outcome.left_arena


BAD = {
    "unknown robot": (dict(robot="khepera4"), UnknownNameError, "khepera3"),
    "unknown setting": (dict(strat=(0, 0, 0)), UnknownNameError, "start"),
    "unknown effect": (dict(damage=["wheel_gian"]), UnknownNameError, "wheel_gain"),
    "start outside": (dict(start=(0, 1, 0)), OutOfBoundsError, "0.9 m"),
    "start NaN": (dict(start=(float("nan"), 0, 0)), OutOfBoundsError, "m"),
    "no effect": (dict(damage=[3.0]), BnsError, "is no effect"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings_are_refused(name, case):
    settings, error, says = BAD[case]
    with pytest.raises(error, match=says):
        registry.make(name, **settings)


def test_bad_runs_are_refused(name):
    world = registry.make(name)
    good = Commands([[0.1, 0.1]], [0.1])
    swapped = Commands([[0.1, 0.1]], [0.1], WHEEL_CHANNELS[::-1])
    in_mm = Commands(
        [[1, 1]], [0.1], tuple(Channel(n, "mm/s") for n, _ in WHEEL_CHANNELS)
    )
    with pytest.raises(BnsError, match="left_speed"):
        world.run([swapped])
    with pytest.raises(BnsError, match="mm/s"):
        world.run([in_mm])
    with pytest.raises(OutOfBoundsError, match=r"command 1: right_speed = 0\.5"):
        world.run([Commands([[0, 0], [0.1, 0.5]], [1, 1])])
    with pytest.raises(OutOfBoundsError, match="trial"):
        world.run([Commands([[0, 0]], [1e9])])
    with pytest.raises(BnsError, match="2 entries for 1 robots"):
        world.run([good], seeds=[1, 2])
    with pytest.raises(BnsError, match="non-negative"):
        world.run([good], seeds=[-1])
    with pytest.raises(BnsError, match="2 damages were given for 1 robots"):
        registry.make(name, damage=[(), ()]).run([good])


def test_no_robots_give_no_trials(name):
    assert registry.make(name).run([]) == []


def test_unknown_world():
    with pytest.raises(UnknownNameError, match="Did you mean 'mujoco'"):
        registry.make("mujocco")


def test_a_script_can_add_a_world(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})

    def still(**settings):
        """Nothing moves."""
        return settings

    registry.register("still", still)
    registry.register("still", still)
    assert "still" in registry.names()
    assert registry.describe()["still"] == "Nothing moves."
    assert registry.make("still", a=1) == {"a": 1}
    with pytest.raises(BnsError, match="exists already"):
        registry.register("mujoco", still)
