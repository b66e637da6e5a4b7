"""Damage schedules: when what is on, and how it is written."""

import math

import pytest

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.worlds.damage import ActiveEffect, Damage, Event
from bns.worlds.effects import registry

SLOW = "wheel_gain:wheel=left,factor=0.8"


def trials_on(text, trials=80) -> list[int]:
    damage = Damage.parse([text])
    return [trial for trial in range(trials) if damage.is_on(trial)]


@pytest.mark.parametrize(
    "schedule, expected",
    [
        ("", range(80)),
        ("@0", range(80)),
        ("@30", range(30, 80)),
        ("@30..60", range(30, 60)),
        ("@30:2.5s", range(30, 80)),
        ("@30:2.5s..30:4s", [30]),
        ("@30..31:1s", [30, 31]),
        ("@70%4/2", [70, 71, 74, 75, 78, 79]),
        ("@70..76%4/2", [70, 71, 74, 75]),
        ("@77~10", [77, 78, 79]),
    ],
)
def test_it_is_on_in_the_trials_that_the_text_says(schedule, expected):
    assert trials_on(SLOW + schedule) == list(expected)
    assert Damage.parse([SLOW + schedule]).first_trial == next(iter(expected))


def test_times_within_a_trial_are_start_and_stop():
    damage = Damage.parse([SLOW + "@30:2.5s..32:1.5s"])
    slow = registry.parse(SLOW)
    assert damage.at(29) == ()
    assert damage.at(30) == (ActiveEffect(slow, 2.5, math.inf),)
    assert damage.at(31) == (ActiveEffect(slow, 0.0, math.inf),)
    assert damage.at(32) == (ActiveEffect(slow, 0.0, 1.5),)
    assert damage.at(33) == ()


def test_an_onset_after_the_end_of_the_trial_is_left_out():
    damage = Damage.parse([SLOW + "@30:2.5s"])
    assert damage.at(30, duration=2.5) == ()
    assert len(damage.at(30, duration=2.6)) == 1
    assert len(damage.at(31, duration=0.1)) == 1


def test_a_ramp_grows_linearly_to_full_severity():
    damage = Damage.parse(["wheel_gain:wheel=left,factor=0.5@30~5"])
    factors = [damage.at(trial)[0].effect["factor"] for trial in range(30, 37)]
    assert factors == pytest.approx([0.9, 0.8, 0.7, 0.6, 0.5, 0.5, 0.5])


def test_a_ramp_leaves_places_and_wheels_alone():
    damage = Damage.parse(["payload:mass=0.4,x=0.03@0~2"])
    first = damage.at(0)[0].effect
    assert (first["mass"], first["x"]) == (0.2, 0.03)


def test_events_compose_in_order():
    lag = Damage.parse(["motor_lag:time_constant=0.1@40"])
    both = Damage.parse([SLOW + "@30"]) + lag
    assert [active.effect.name for active in both.at(50)] == ["wheel_gain", "motor_lag"]
    assert [active.effect.name for active in both.at(35)] == ["wheel_gain"]
    assert both.first_trial == 30
    assert both + Damage.none() == both


def test_no_damage_is_never_on():
    assert not Damage.none().is_on(0)
    assert Damage.none().first_trial == -1
    assert Damage.none().texts() == ()


def test_an_effect_at_its_nominal_is_no_damage():
    damage = Damage.parse(["wheel_gain:factor=1@5"])
    assert not damage.is_on(10)
    assert damage.first_trial == -1


def test_first_trial_waits_for_a_ramp_that_rounds_to_nothing():
    damage = Damage.parse(["wheel_intermittent:every=900@10~3"])
    assert damage.first_trial == 12


@pytest.mark.parametrize(
    "text",
    [
        SLOW,
        SLOW + "@30",
        SLOW + "@30:2.5s",
        SLOW + "@0:1e-05s",
        SLOW + "@30..60:0.25s~10%5/2",
        "command_latency:delay=0.1@0..3",
        "payload:mass=0.123456789012345,x=-0.01,y=0,z=0.1~4",
    ],
)
def test_texts_read_back(text):
    damage = Damage.parse([text])
    assert Damage.parse(damage.texts()) == damage
    assert Damage.parse(damage.texts()).texts() == damage.texts()


def test_spaces_are_allowed_and_one_text_is_one_event():
    assert Damage.parse(f" {SLOW} @ 30 .. 60 ") == Damage.parse([SLOW + "@30..60"])


def test_a_table_says_the_same_as_the_text():
    table = {"effect": "wheel_gain", "wheel": "left", "factor": 0.8}
    schedule = {"onset": 30, "onset_time": 2.5, "end": 60, "ramp": 10}
    recurrence = {"period": 5, "on_for": 2}
    event = Event.from_table({**table, **schedule, **recurrence})
    assert event == Event.parse(SLOW + "@30:2.5s..60~10%5/2")
    assert Event.from_table(table) == Event.parse(SLOW)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "@30",
        SLOW + "@",
        SLOW + "@-1",
        SLOW + "@30..",
        SLOW + "~",
        SLOW + "%5",
        SLOW + "@30:s",
        SLOW + "%5/2@30",
        SLOW + "@1.5",
    ],
)
def test_bad_syntax_says_what_was_given_the_grammar_and_an_example(text):
    with pytest.raises(BnsError) as caught:
        Damage.parse([text])
    message = str(caught.value)
    assert repr(text) in message
    assert "NAME[:parameter=value,...][@ONSET[..END]][~RAMP][%PERIOD/ON]" in message
    assert f"{SLOW}@30" in message


@pytest.mark.parametrize(
    "text, match",
    [
        (SLOW + "@30..30", "give an end after the onset"),
        (SLOW + "@30:2s..30:1s", "give an end after the onset"),
        (SLOW + "@30%5/0", "0 < ON < PERIOD"),
        (SLOW + "@30%5/5", "0 < ON < PERIOD"),
        ("wheel_gain:wheel=left@30", "give for example factor=0.8"),
    ],
)
def test_schedules_without_sense_are_refused(text, match):
    with pytest.raises(BnsError, match=match):
        Damage.parse([text])


@pytest.mark.parametrize(
    "values",
    [
        {"onset": -1},
        {"onset": 1.5},
        {"onset": True},
        {"onset_time": math.nan},
        {"onset_time": "2"},
        {"end_time": 1.0},
        {"ramp": -2},
    ],
)
def test_bad_values_in_tables_are_refused(values):
    table = {"effect": "wheel_gain", "factor": 0.8, **values}
    with pytest.raises(BnsError, match="is not allowed: give"):
        Event.from_table(table)


def test_errors_of_the_effect_come_through():
    with pytest.raises(UnknownNameError, match="wheel_gain"):
        Damage.parse(["wheel_gan:factor=0.8@30"])
    with pytest.raises(OutOfBoundsError, match="0 to 2"):
        Damage.parse(["wheel_gain:factor=3@30"])
    with pytest.raises(UnknownNameError, match="onsett"):
        Event.from_table({"effect": "wheel_gain", "factor": 0.8, "onsett": 3})
