"""The next command: it moves what is tied apart, and says so where nothing can."""

from dataclasses import replace

import numpy as np
import pytest

from bns.cli.gap import after
from bns.errors import FormatError
from bns.gap import store
from bns.gap.models.servo.model import ServoModel
from bns.gap.planning import command_file, excitation, plan, plan_runs, servo_excitation
from bns.gap.records import Diagnosis, Fit, Verdict

FLOOR = {
    "sigma": [1e-3, 1e-3, 1e-2],
    "process": [1e-4, 5e-5, 1e-3],
    "source": "state reset",
    "repeats": 0,
}


def tied(*fits, kind="either"):
    """A diagnosis that could not decide between fits."""
    made = tuple(
        Fit((n,), (t,), (v,), ((v - s, v + s),), ("1",), 10.0, 10.0, 0.0, 10.0)
        for n, t, v, s in fits
    )
    nothing = Fit((), (), (), (), (), 100.0, 100.0, 0.0, 100.0)
    names = tuple(fit.names for fit in made)
    verdict = Verdict(kind, names, names, 1.0, 0.0, 0.5, (), 0.0, "")
    return Diagnosis("khepera3", 3, (), verdict, (nothing, *made), {}, {}, FLOOR, {})


AXLE = ("axle_length", "axle_length:factor=0.9", 0.9, 0.01)
WHEELS = ("wheel_gain[both]", "wheel_gain:wheel=both,factor=1.11", 1.11, 0.01)
LATE = ("command_latency", "command_latency:delay=0.12", 0.12, 0.001)
OLD = ("tracker_latency", "tracker_latency:delay=0.12", 0.12, 0.001)


def test_axle_or_wheels_asks_for_a_straight_drive(model):
    made = plan.plan(tied(AXLE, WHEELS), model)
    turns = [o for o in made.options if "turn in place" in o.excitation.name]
    best = made.options[0]
    assert "turn in place" not in best.excitation.name
    assert best.distances[0] > 10
    assert min(o.distances[0] for o in turns) < 0.3 * best.distances[0]
    assert made.repeats == 1
    assert best.excitation.name in made.sentence


def test_what_no_command_parts_is_said(model):
    made = plan.plan(tied(LATE, OLD), model)
    assert made.repeats == 0
    assert made.alike == ((0, 1),)
    assert "Observe another quantity" in made.sentence
    three = plan.plan(tied(LATE, OLD, WHEELS), model)
    assert three.repeats == 1
    assert "No command parts command_latency from tracker_latency" in three.sentence


def test_nothing_is_tied(model):
    made = plan.plan(tied(AXLE, kind="effect"), model)
    assert not made.options and "Nothing is tied" in made.sentence


def test_magnitudes_that_are_not_known_part_less(model):
    family = [item for item in excitation.wheeled() if "in place" in item.name][:2]
    known, loose = (
        plan.plan(
            tied((*AXLE[:3], spread), ("tracker_scale", OTHER, 1.1, spread)),
            model,
            family=family,
        )
        for spread in (0.001, 0.2)
    )
    assert loose.options[0].distances[0] < 0.7 * known.options[0].distances[0]


OTHER = "tracker_scale:factor=1.1"


def test_drives_stay_on_the_board(model):
    small = plan.plan(tied(AXLE, WHEELS), model, arena=(0.5, 0.5))
    for option in small.options:
        path = plan.blank(option.excitation.commands, model).observed
        assert np.abs(path[:, :2]).max() < 0.25
    assert len(small.options) < len(excitation.wheeled())


def test_how_often_a_command_has_to_be_run():
    assert plan.repeats(10.0, tie=6.0) == 1
    assert plan.repeats(2.0, tie=6.0) == 5  # 20 - 2 * 1.2816 * sqrt(20) = 8.5 >= 6
    assert plan.repeats(0.1, tie=6.0) == 0


TOLD = {"gain": 16.0, "mass": 0.7, "lever": 0.1}


@pytest.mark.parametrize(
    ("fits", "wanted"),
    [
        (
            (("servo_delay", "delay", 0.03), ("servo_lag", "time_constant", 0.03)),
            "step",
        ),
        (
            (("servo_payload", "mass", 0.03), ("servo_lever", "factor", 1.04)),
            "let fall",
        ),
        (
            (("servo_gain", "factor", 1.05), ("servo_voltage", "factor", 1.05)),
            "0.8 rad",
        ),
    ],
)
def test_a_servo_gets_the_command_that_is_known_to_part(fits, wanted):
    rows = [(name, f"{name}:{par}={x}", x, 0.02 * x) for name, par, x in fits]
    found = replace(tied(*rows), model="servo_pendulum", provenance={"told": TOLD})
    floor = {**FLOOR, "sigma": [1e-3], "process": [5e-3]}
    found = replace(found, floor=floor)
    servo = ServoModel()
    family = [item for item in servo.excitations(told=TOLD) if "gain" not in item.name]
    made = plan.plan(found, servo, family=family)
    assert wanted in made.options[0].excitation.name
    assert made.repeats >= 1


def test_commands_for_servos_are_bounded_and_softer_ones_are_offered():
    family = servo_excitation.servo(told=TOLD)
    assert {item.conditions["gain"] for item in family} == {16.0, 4.0}
    for item in family:
        goals = item.commands.values[:, 0]
        assert np.abs(goals).max() <= servo_excitation.REACH + 1e-9
        assert item.commands.duration == pytest.approx(servo_excitation.LENGTH)
        if "steps" not in item.name and "stairs" not in item.name:
            fastest = np.abs(np.diff(goals)).max() / servo_excitation.HELD
            assert fastest <= servo_excitation.SWIFT
    assert len(servo_excitation.servo()) == len(family) / 2


def test_general_commands_keep_to_the_limits():
    limits = {"a": (-1.0, 3.0, "N"), "b": (0.5, 2.0, "rad")}
    for item in excitation.general(limits):
        low, high = item.commands.values.min(axis=0), item.commands.values.max(axis=0)
        assert (low >= [-1.0, 0.5]).all() and (high <= [3.0, 2.0]).all(), item.name
        assert item.commands.duration == pytest.approx(10.0, abs=0.6)


def test_commands_survive_their_file(tmp_path):
    told = excitation.wheeled()[5].commands
    read = command_file.read(command_file.write(told, tmp_path / "next.csv"))
    np.testing.assert_array_equal(read.values, told.values)
    np.testing.assert_allclose(read.durations, told.durations)
    assert read.channels == told.channels
    (tmp_path / "bad.csv").write_text("left,right\n1,2\n")
    with pytest.raises(FormatError, match="left_speed"):
        command_file.read(tmp_path / "bad.csv")


def test_two_commands_are_asked_for_where_one_leaves_a_pair():
    def runs(*rows):
        return plan_runs.runs(np.array(rows))

    assert runs([9.0, 0.1], [0.1, 9.0], [3.0, 0.5]) == {0: 1, 1: 1}
    assert runs([9.0, 3.0], [0.1, 9.0]) == {0: 1, 1: 1}
    assert runs([9.0, 7.0], [7.0, 8.0]) == {0: 1}
    assert runs([9.0, 4.0], [0.0, 4.5]) == {0: 2}  # one command, if that does
    assert sum(runs([9.0, 4.0, 0.0], [0.0, 4.5, 0.1]).values()) == 2  # the last never


def test_each_command_of_a_plan_gets_a_file(tmp_path, monkeypatch, capsys):
    family = plan._family
    monkeypatch.setattr(plan, "_family", lambda *given: family(*given)[:4])
    monkeypatch.setattr(plan, "runs", lambda table: {0: 1, 3: 2})
    store.save(tied(AXLE, WHEELS), tmp_path)
    assert after.main("plan", [str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "Run once: " in said and ", and twice: " in said
    first, second = (
        command_file.read(tmp_path / f"next_command{more}.csv") for more in ("", "_2")
    )
    wanted = excitation.wheeled()
    assert np.allclose(first.values, wanted[0].commands.values)
    assert np.allclose(second.values, wanted[3].commands.values)
