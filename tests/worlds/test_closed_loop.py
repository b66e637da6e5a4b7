"""Closed loops: sessions equal open loops, watched robots, bad policies."""

import numpy as np
import pytest

from bns.errors import BnsError, FormatError, OutOfBoundsError
from bns.worlds import registry
from bns.worlds.damage import Damage, Event
from bns.worlds.data import dataset, dataset_checks
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.light.closed_loop import Supervisor
from bns.worlds.trial import Commands, Trial
from tests.sources import ROOT

BURGER = str(ROOT / "examples" / "burger")


class Replay:
    """Tells every robot the same list of commands; remembers where it is."""

    def __init__(self, commands):
        self.commands = np.asarray(commands, dtype=float)

    def memory(self, n):
        return np.zeros((n, 1))

    def act(self, readings, memory):
        at = int(memory[0, 0])
        return np.tile(self.commands[at], (len(readings), 1)), memory + 1


class Seek:
    """Turns towards the brighter side; stops when all is dark."""

    def memory(self, n):
        return np.zeros((n, 0))

    def act(self, readings, memory):
        bright = 1 - readings / 4095
        turn = 0.12 * (bright[:, 0] - bright[:, 1])
        turn = np.where(bright.sum(axis=1) < 0.1, 0.04, turn)
        speeds = 0.06 + np.outer(turn, [-1, 1])
        return np.clip(speeds, -0.12, 0.12), memory


COMMANDS = np.random.default_rng(5).uniform(-0.1, 0.12, (12, 2))
DAMAGES = [
    (),
    ("wheel_gain:wheel=left,factor=0.8",),
    ("motor_lag:time_constant=0.1",),
    ("wheel_intermittent:every=3", "battery_sag:per_second=0.01"),
    ("wheel_diameter:wheel=left,factor=0.9@0:1.3s..0:2.55s",),
    ("rolling_drag:wheel=left,breakaway=0.002@0:1.3s..0:2.55s",),
    ("rolling_drag:torque=0.0005,breakaway=0.001",),
    ("payload:mass=0.2", "command_latency:delay=0.07"),
]


def same(one, other):
    return (
        one.observed.tobytes() == other.observed.tobytes()
        and one.times.tobytes() == other.times.tobytes()
        and one.commands.values.tobytes() == other.commands.values.tobytes()
        and one.outcome == other.outcome
        and (one.handled == other.handled).all()
    )


@pytest.mark.parametrize("damage", DAMAGES, ids=str)
def test_a_loop_that_ignores_its_sensors_is_an_open_loop_bit_for_bit(damage):
    world = registry.make(
        "mujoco", damage=damage, reality=["tracker_noise:position_sd=0.01"]
    )
    open_loop = world.run([Commands(COMMANDS, np.full(12, 0.4))], seeds=[3])[0]
    loop = world.drive(Replay(COMMANDS), cycles=12, seeds=[3])[0]
    assert same(loop, open_loop)
    assert (loop.boundaries == open_loop.boundaries).all()
    assert not loop.handled.any()


def test_a_batch_equals_single_robots_and_threads_change_no_bit():
    starts = np.array([[0.8, 0.2, 1.0], [-0.6, 0.5, 0.0], [0.5, -0.6, 2.0]])
    damage = [(), ("wheel_gain:wheel=left,factor=0.8",), ("payload:mass=0.2",)]
    kept = {"cycles": 20, "trial": 2}
    batches = [
        registry.make("light", damage=damage, threads=threads).drive(
            Seek(), seeds=[4, 5, 6], starts=starts, **kept
        )
        for threads in (1, 3)
    ]
    for robot in range(3):
        alone = registry.make("light", damage=damage[robot]).drive(
            Seek(), seeds=[4 + robot], starts=starts[robot : robot + 1], **kept
        )[0]
        assert all(same(batch[robot], alone) for batch in batches)


def test_what_is_observed_is_the_pose_then_the_sensors():
    trial = registry.make("light").drive(Seek(), cycles=10, seeds=[1])[0]
    names = [(channel.name, channel.unit) for channel in trial.channels]
    assert names[3:] == [("light_left", "count"), ("light_right", "count")]
    assert trial.commands.durations == pytest.approx(0.4)
    assert len(trial.commands) == 10
    readings = trial.observed[trial.boundaries, 3:]
    assert (readings >= 0).all() and (readings <= 4095).all()
    told, _ = Seek().act(readings[:-1], np.zeros((10, 0)))
    assert np.array_equal(told, trial.commands.values)


def test_seekers_find_the_lamp_and_are_stopped_at_the_boundary():
    world = registry.make("light")
    trials = world.drive(Seek(), cycles=100, seeds=range(8))
    assert sum(trial.outcome.stopped for trial in trials) >= 6
    for trial in trials:
        path = trial.poses_world
        near = np.hypot(path[:, 0], path[:, 1])
        if trial.outcome.stopped:
            assert trial.outcome.lamp_stops == 1
            assert near[-1] == pytest.approx(0.14, abs=0.015)
            after = np.flatnonzero(trial.handled)[0] + 1
            assert (
                trial.handled[after:].all() and not trial.commands.values[after:].any()
            )
            assert np.ptp(path[trial.boundaries[after + 1] :], axis=0).max() < 1e-3
        else:
            assert near.min() > 0.14


def test_a_robot_is_turned_at_the_edge_and_goes_on():
    world = registry.make("light")
    trial = world.drive(
        Replay(np.full((60, 2), 0.1)), cycles=60, starts=[[1.1, 0.5, 0.0]], seeds=[2]
    )[0]
    assert trial.outcome.edge_turns >= 2
    assert not trial.outcome.left_arena and not trial.outcome.stopped
    hit = np.flatnonzero(trial.handled)
    assert len(hit) == trial.outcome.edge_turns
    pose = trial.command_poses_world[hit[0] + 1]
    inward = np.arctan2(-pose[1], -pose[0])
    assert abs((pose[2] - inward + np.pi) % (2 * np.pi) - np.pi) <= np.pi / 4 + 1e-6
    steps = np.hypot(*np.diff(trial.command_poses_world[:, :2], axis=0).T)
    assert steps[hit[0] + 2] == pytest.approx(0.04, abs=0.004)


def test_a_robot_may_be_turned_away_from_the_lamp_instead():
    world = registry.make("light", supervisor=Supervisor(at_lamp="turn"))
    trials = world.drive(Seek(), cycles=100, seeds=range(4))
    assert sum(trial.outcome.lamp_stops for trial in trials) > 4
    assert not any(trial.outcome.stopped for trial in trials)


def test_a_stopped_robot_stays_whatever_is_broken():
    world = registry.make("light", damage=["wheel_stuck_max:blend=1"])
    trial = world.drive(
        Replay(np.full((30, 2), 0.1)), cycles=30, starts=[[-0.6, 0.0, 0.0]]
    )[0]
    assert trial.outcome.stopped
    assert np.hypot(*trial.poses_world[-1, :2]) == pytest.approx(0.14, abs=0.02)


BAD_COMMANDS = {
    "NaN": (
        lambda n: np.full((n, 2), np.nan),
        BnsError,
        "robot 0 .nan, nan. in cycle 0",
    ),
    "shape": (lambda n: np.zeros((n, 3)), BnsError, r"shape \(2, 3\) in cycle 0"),
    "text": (lambda n: [["a", "b"]] * n, BnsError, "needs"),
    "too fast": (lambda n: np.full((n, 2), 9.0), OutOfBoundsError, "left_speed = 9.0"),
}


@pytest.mark.parametrize("case", BAD_COMMANDS)
def test_bad_commands_are_refused(case):
    make, error, says = BAD_COMMANDS[case]

    class Bad:
        def memory(self, n):
            return np.zeros((n, 0))

        def act(self, readings, memory):
            return make(len(readings)), memory

    with pytest.raises(error, match=says):
        registry.make("light").drive(Bad(), seeds=[0, 1])


BAD_LIGHT = {
    "no light": ({"lights": ()}, {}, "one Lamp or more"),
    "no lamp": ({"lights": (3,)}, {}, "3 is no lamp"),
    "slip": ({"lights": ({"hight": 1},)}, {}, "Did you mean 'height'"),
    "below": ({"lights": ({"height": -1},)}, {}, "lamp height = -1 m"),
    "robot": ({"robot": BURGER}, {}, "no light sensors"),
    "legs": ({"robot": "phantomx"}, {}, "is legged, .* or the world 'hexapod'"),
    "servo": ({"robot": "servo_pendulum"}, {}, "is servo, this world is for wheeled"),
    "table": ({"sensors": "mine"}, {}, "public, thesis"),
    "supervisor": ({"supervisor": {"saftey": 1}}, {}, "Did you mean 'safety'"),
    "no supervisor": ({"supervisor": 3}, {}, "3 is no supervisor"),
    "at lamp": ({"supervisor": {"at_lamp": "run"}}, {}, "Did you mean 'turn'"),
    "boundary": ({}, {"starts": [[0.1, 0.0, 0.0]]}, "inside its safety boundary"),
    "inside": ({}, {"starts": [[0.01, 0.0, 0.0]]}, "inside the robot"),
    "outside": ({}, {"starts": [[5.0, 0.0, 0.0]]}, "start x = 5"),
    "shape": ({}, {"starts": [[0.5, 0.0]]}, "starts has shape"),
    "numbers": ({}, {"starts": [[0.5, 0.5, 0.0]], "seeds": [1, 2]}, "seeds has 2"),
    "cycles": ({}, {"cycles": 0}, "cycles = 0"),
    "cycle": ({}, {"cycle": 1e-6}, "cycle = 1e-06"),
}


@pytest.mark.parametrize("case", BAD_LIGHT)
def test_bad_light_and_bad_drives_are_refused(case):
    settings, arguments, says = BAD_LIGHT[case]
    with pytest.raises(BnsError, match=says):
        registry.make("light", **settings).drive(Seek(), **arguments)


def test_a_session_ends():
    session = registry.make("mujoco").session(cycles=1)
    assert session.readings.shape == (1, 0)
    session.step([[0.1, 0.1]])
    with pytest.raises(BnsError, match="1 cycles of this trial are over"):
        session.step([[0.1, 0.1]])


class Ahead:
    """Drives straight on at a speed."""

    def __init__(self, speed=0.12):
        self.speed = speed

    def memory(self, n):
        return np.zeros((n, 0))

    def act(self, readings, memory):
        return np.full((len(readings), 2), self.speed), memory


class Wild(BodyEffect):
    """Gravity that no solver survives."""

    name = "test_wild"
    doc = "gravity is scaled"
    parameters = (Parameter("factor", "1", 1.0, -1e30, 1e30, "", 2.0),)

    def edit(self, spec):
        spec.option.gravity = [0, 0, spec.option.gravity[2] * self["factor"]]


def test_a_dataset_keeps_readings_counters_and_handled_commands(tmp_path):
    world = registry.make("light", singles=True)
    trials = world.drive(Ahead(), cycles=30, seeds=[1, 2])
    assert sum(trial.handled.sum() for trial in trials) > 0
    dataset.write(tmp_path / "kept", trials)
    for kept, trial in zip(dataset.read(tmp_path / "kept").trials, trials, strict=True):
        assert kept.observed.tobytes() == trial.observed.tobytes()
        assert kept.outcome == trial.outcome
        assert np.array_equal(kept.handled, trial.handled)
        assert kept.conditions["lights"] == trial.conditions["lights"]


@pytest.mark.parametrize("given", [[3], [-1], ["0"], 1, [True]])
def test_handled_commands_that_there_are_not_are_refused(given, tmp_path):
    with pytest.raises(FormatError, match=r"handled .* indices of the 3 commands"):
        dataset_checks.handled({"handled": given}, 3, tmp_path)


def test_handled_needs_an_entry_for_each_command():
    with pytest.raises(BnsError, match=r"handled has shape \(1,\), it needs \(2,\)"):
        Trial(
            commands=Commands(np.zeros((2, 2)), [1.0, 1.0]),
            times=np.arange(3.0),
            observed=np.zeros((3, 3)),
            boundaries=[0, 1, 2],
            handled=[True],
        )


def test_a_robot_that_diverges_is_flagged_and_leaves_the_others_alone():
    wild = Damage((Event(Wild({"factor": -1e30}), onset_time=1.0),))
    starts = np.array([[0.8, 0.0, 2.0], [0.8, 0.0, 2.0]])
    world = registry.make("light", damage=[wild, Damage.none()])
    bad, good = world.drive(Ahead(0.05), cycles=6, seeds=[1, 1], starts=starts)
    sound = registry.make("light").drive(
        Ahead(0.05), cycles=6, seeds=[1], starts=starts[:1]
    )[0]
    assert bad.outcome.diverged and not bad.outcome.usable
    assert not good.outcome.diverged
    assert good.observed.tobytes() == sound.observed.tobytes()
    assert np.isnan(bad.poses_world[-1]).all()
    assert np.isfinite(bad.observed[:, 3:]).all()  # its last readings are held
    early = bad.times <= 1.0
    assert bad.observed[early].tobytes() == good.observed[early].tobytes()


def test_no_robots_give_no_trials():
    assert registry.make("light").drive(Ahead(), starts=np.zeros((0, 3))) == []
    with pytest.raises(BnsError, match="There is no robot"):
        registry.make("light").session(starts=np.zeros((0, 3)))


def test_starts_are_drawn_by_seed_and_trial_and_keep_clear():
    world = registry.make("light")
    starts = [
        trial.poses_world[0]
        for number in (0, 1)
        for trial in world.drive(Ahead(), cycles=1, seeds=[1, 2, 3], trial=number)
    ]
    assert len({tuple(start) for start in starts}) == 6
    assert min(np.hypot(x, y) for x, y, _ in starts) >= 0.5
    again = world.drive(Ahead(), cycles=1, seeds=[2])[0]
    assert np.array_equal(again.poses_world[0], starts[1])
