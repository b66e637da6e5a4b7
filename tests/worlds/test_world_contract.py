"""Every registered world keeps the contract of `bns.worlds.world.World`.

A model world counts what is executed in it, and ends where its budget does.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.worlds import registry
from bns.worlds.trial import WHEEL_CHANNELS, Channel, Commands, Trial
from bns.worlds.world import BudgetSpentError, CountedWorld, World

STRIDE = np.tile([1.0, 0.0, 0.0], 6)  # all coxae forward [1]
LIFTED = np.array([0, 0.5, 0.2] * 6)  # femur up, tibia out [rad]
ONE_SET = np.repeat([1, 0, 1, 0, 0, 1], 3).astype(float)  # legs 1, 3, 6


class Kind(NamedTuple):
    """Commands and damages that suit a kind of robot.

    Attributes:
        channels: what it is told.
        lists: so many random lists of commands, of different lengths, from a seed.
        ahead: commands that move it ahead (1) or back (-1).
        damage: an effect as text that ahead shows.
        sides: two effects that mirror each other.
        shows: whether a trial of `ahead` is one with `damage`.
        beyond: commands of which the second one cannot be told, and what says so.
    """

    channels: tuple[Channel, ...]
    lists: Callable[[int, int], list[Commands]]
    ahead: Callable[[int], Commands]
    damage: str
    sides: tuple[str, str]
    shows: Callable[[Trial], bool]
    beyond: tuple[Commands, str]


def of(world: str) -> Kind:
    """The kind of robot of a registered world."""
    return KINDS[models.robot(registry.make(world).robot).kind]


def _lists(
    channels: tuple[Channel, ...], most: float, longest: int
) -> Callable[..., list[Commands]]:
    """Draws lists of at most so many commands, each up to so large."""

    def drawn(count: int, seed: int = 0) -> list[Commands]:
        rng = np.random.default_rng(seed)
        return [
            Commands(
                rng.uniform(-most, most, (k, len(channels))),
                rng.uniform(0.2, 1.5, k),
                channels,
            )
            for k in rng.integers(1, longest + 1, count)
        ]

    return drawn


def _steps(way: int) -> Commands:
    """Four steps of a simple tripod gait."""
    goals = []
    for swing in (ONE_SET, 1 - ONE_SET) * 2:
        placed = 0.3 * way * STRIDE * (2 * swing - 1)
        goals += [placed + LIFTED * swing, placed]
    return Commands(np.array(goals), np.full(len(goals), 1.0), LEGS)


LEGS = tuple(Channel(*item) for item in models.robot("phantomx").channels)
KINDS = {
    "wheeled": Kind(
        channels=WHEEL_CHANNELS,
        lists=_lists(WHEEL_CHANNELS, 0.12, 6),
        ahead=lambda way: Commands([[0.1 * way, 0.1 * way]], [1.5]),
        damage="wheel_gain:wheel=left,factor=0.8",
        sides=(
            "wheel_gain:wheel=left,factor=0.8",
            "wheel_gain:wheel=right,factor=0.8",
        ),
        shows=lambda trial: trial.poses_world[-1, 2] > 0.1,  # it turns left
        beyond=(
            Commands([[0, 0], [0.1, 0.5]], [1, 1]),
            r"command 1: right_speed = 0\.5",
        ),
    ),
    "legged": Kind(
        channels=LEGS,
        lists=_lists(LEGS, 0.4, 4),
        ahead=_steps,
        damage="leg_raised:legs=5,blend=1",
        sides=("leg_raised:legs=5,blend=1", "leg_raised:legs=6,blend=1"),
        shows=lambda trial: trial.channel("left_middle_femur_position")[-1] > 1.0,
        beyond=(
            Commands([[0.0] * 18, [0.0] * 17 + [1.5]], [1, 1], LEGS),
            r"command 1: right_middle_tibia = 1\.5 rad .* from -1\.8",
        ),
    ),
}


REAL = {"hardware"}  # one robot, in real time: tests/hardware
NAMES = [name for name in registry.names() if name not in REAL]
NOISE = "tracker_noise:position_sd=0.01"


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


@pytest.fixture
def kind(name):
    """What the world's robot can be told."""
    return of(name)


def test_it_has_one_line_of_description(name):
    line = registry.describe()[name]
    assert line and "\n" not in line


def test_it_is_a_world_and_gives_whole_trials(name, kind):
    world = registry.make(name)
    assert isinstance(world, World)
    commands = kind.lists(4)
    trials = world.run(commands, trial=2, seeds=[1, 2, 3, 4])
    assert len(trials) == 4
    for trial, sent in zip(trials, commands, strict=True):
        assert trial.commands is sent
        assert (trial.robot, trial.world) == (world.robot, world.name)
        assert trial.boundaries[0] == 0
        assert trial.boundaries[-1] == len(trial.times) - 1
        assert trial.times[0] == 0
        ends = trial.times[trial.boundaries[1:]]
        late = ends - np.cumsum(sent.durations)
        assert late.max() <= 0.005 * len(sent)
        if kind is not KINDS["legged"]:  # whose commands end when it rests
            assert late.min() >= -0.005 * len(sent)
        assert np.isfinite(trial.observed).all()
        assert trial.poses_world[0] == pytest.approx([0, 0, 0], abs=1e-9)
        assert trial.outcome.usable
        assert trial.conditions["trial"] == 2


def test_a_batch_equals_single_trials_and_order_does_not_matter(name, kind):
    commands = kind.lists(5)
    seeds = [3, 1, 4, 1, 5]
    world = registry.make(name, reality=[NOISE], damage=[f"{kind.damage}@3"])
    batch = world.run(commands, trial=3, seeds=seeds)
    for item, seed, trial in zip(commands, seeds, batch, strict=True):
        assert same(world.run([item], trial=3, seeds=[seed])[0], trial)
    backwards = world.run(commands[::-1], trial=3, seeds=seeds[::-1])
    assert all(map(same, backwards[::-1], batch))


def test_seed_and_trial_decide_what_is_random(name, kind):
    world = registry.make(name, reality=[NOISE])
    (commands,) = kind.lists(1)
    first = world.run([commands], seeds=[7])[0]
    assert same(world.run([commands], seeds=[7])[0], first)
    other_seed = world.run([commands], seeds=[8])[0]
    other_trial = world.run([commands], seeds=[7], trial=1)[0]
    assert not np.array_equal(first.observed, other_seed.observed)
    assert not np.array_equal(first.observed, other_trial.observed)


def test_without_seeds_each_robot_has_noise_of_its_own(name, kind):
    world = registry.make(name, reality=[NOISE])
    (commands,) = kind.lists(1)
    told = world.run([commands] * 3, trial=1, seeds=[0, 1, 2])
    found = world.run([commands] * 3, trial=1)
    assert all(map(same, found, told))
    assert not same(found[0], found[1])


def test_damage_sets_in_at_its_trial_and_is_in_the_record(name, kind):
    commands, damage = [kind.ahead(1)], [f"{kind.damage}@3"]
    sound, damaged = registry.make(name), registry.make(name, damage=damage)
    for trial in (0, 2):
        before = sound.run(commands, trial=trial)[0]
        assert same(before, damaged.run(commands, trial=trial)[0])
        assert not kind.shows(before)
    hit = damaged.run(commands, trial=3)[0]
    assert kind.shows(hit)
    assert hit.conditions["damage"] == [kind.damage]


def test_each_robot_may_have_its_own_damage(name, kind):
    left, right = kind.sides
    world = registry.make(name, damage=[(), (left,), (right,)])
    trials = world.run([kind.ahead(1)] * 3)
    turns = [trial.poses_world[-1, 2] for trial in trials]
    assert [kind.shows(trial) for trial in trials] == [False, True, False]
    assert turns[1] - turns[0] == pytest.approx(turns[0] - turns[2], rel=0.5)
    assert abs(turns[1] - turns[0]) > 0.05


def test_an_effect_added_does_not_move_the_noise_of_another(name, kind):
    commands = [kind.ahead(1)]
    drift = "clock_drift:rate=0.01"
    alone = registry.make(name, reality=[NOISE]).run(commands)[0]
    beside = registry.make(name, reality=[drift, NOISE]).run(commands)[0]
    assert np.array_equal(alone.observed, beside.observed)
    assert not np.array_equal(alone.times, beside.times)


def test_it_starts_where_told_and_flags_leaving_the_arena(name, kind):
    world = registry.make(name, start=(1.3, 0.2, 0.0))
    trial = world.run([kind.ahead(1)])[0]
    assert trial.poses_world[0] == pytest.approx([1.3, 0.2, 0], abs=1e-9)
    assert trial.outcome.left_arena
    assert trial.poses_world[-1, 0] > 1.4  # and goes on
    back = world.run([kind.ahead(-1)])[0]
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


def test_bad_runs_are_refused(name, kind):
    world = registry.make(name)
    size, first = len(kind.channels), kind.channels[0]
    good = Commands(np.zeros((1, size)), [0.1], kind.channels)
    swapped = Commands(good.values, [0.1], kind.channels[::-1])
    in_mm = tuple(Channel(name, "mm/s") for name, _ in kind.channels)
    with pytest.raises(BnsError, match=first.name):
        world.run([swapped])
    with pytest.raises(BnsError, match="mm/s"):
        world.run([Commands(good.values, [0.1], in_mm)])
    commands, says = kind.beyond
    with pytest.raises(OutOfBoundsError, match=says):
        world.run([commands])
    with pytest.raises(OutOfBoundsError, match="trial"):
        world.run([Commands(good.values, [1e9], kind.channels)])
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


COMMANDS = [Commands([[0.1, 0.05]], [0.5]), Commands([[0.05, 0.1]], [0.5])]


@pytest.fixture
def inner():
    return registry.make("static-snn", robot="khepera3")


def test_it_is_a_world_and_gives_what_the_world_gives(inner):
    model = CountedWorld(inner, 5)
    assert isinstance(model, World)
    wanted, found = (w.run(COMMANDS, seeds=[1, 2]) for w in (inner, model))
    for one, other in zip(wanted, found, strict=True):
        np.testing.assert_array_equal(one.observed, other.observed)
    assert (model.spent, model.left) == (2, 3)


def test_more_than_what_is_left_is_refused_and_not_charged(inner):
    model = CountedWorld(inner, 3)
    model.run(COMMANDS)
    with pytest.raises(BudgetSpentError, match=r"2 evaluations .* 1 of 3 left"):
        model.run(COMMANDS)
    assert model.left == 1
    model.run(COMMANDS[:1])
    assert model.left == 0


def test_runs_that_share_a_world_count_for_themselves(inner):
    one, other = CountedWorld(inner, 4), CountedWorld(inner, 4)
    one.run(COMMANDS)
    assert (one.spent, other.spent) == (2, 0)


def test_a_world_without_closed_loops_says_so(inner):
    with pytest.raises(BnsError, match="no closed loops"):
        CountedWorld(inner, 4).drive(object())
