"""Recordings are checked and read: faults are repaired, left out or refused."""

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.recordings import check, segments
from bns.gap.recordings.stuck import without_stuck
from bns.gap.recordings.trial_conditions import as_number
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"


def test_faults_are_repaired_and_listed(model, told):
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told, seeds=range(4))
    broken = list(trials)
    wrapped = trials[0].observed.copy()
    wrapped[:, 2] = np.angle(np.exp(1j * (wrapped[:, 2] + 3.0)))
    broken[0] = trials[0].replace(observed=wrapped)
    spiked = trials[1].observed.copy()
    spiked[20, 0] += 0.5
    broken[1] = trials[1].replace(observed=spiked)
    broken.append(trials[2])
    made, notes = check.check(broken, model)
    assert len(made) == 4
    text = " ".join(notes)
    assert "spike" in text and "the same samples" in text
    assert np.abs(np.diff(made[0].observed[:, 2])).max() < 3
    assert np.isnan(made[1].observed[20]).all()


def test_a_stuck_channel_and_a_wrong_clock_are_left_out(model, told):
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told, seeds=range(4))
    stuck = trials[1].observed.copy()
    stuck[:, 1] = stuck[0, 1]
    half = trials[2].observed.copy()
    half[30:50, 2] = half[30, 2]
    broken = [
        trials[0].replace(times=trials[0].times * 1.2),
        trials[1].replace(observed=stuck),
        trials[2].replace(observed=half),
        trials[3],
        MujocoWorld(reality=[NOISE], threads=1).run(told[:1], seeds=[9])[0],
    ]
    made, notes = check.check(broken, model)
    text = "\n".join(notes)
    assert len(made) == 3
    assert "trial 0: its clock runs 1.2 times as fast" in text
    assert "trial 1: y is stuck" in text and "are needed, left out" in text
    assert np.isnan(made[0].observed[30:50]).all()
    assert np.isfinite(made[0].observed[:30]).all()
    # all clocks alike: a drift, which is for the diagnosis to find
    slow = [trial.replace(times=trial.times * 1.2) for trial in trials]
    assert len(check.check(slow, model)[0]) == 4


def test_a_robot_that_stands_still_is_no_stuck_channel(model):
    there = Commands([[0.1, 0.1], [0.0, 0.0]], [1.0, 1.0])
    dead = "wheel_gain:wheel=both,factor=0"
    trials = MujocoWorld(reality=[dead], threads=1).run([there])
    ((_, notes),) = without_stuck(trials[:1], model)
    assert not notes


def test_a_motion_that_turns_back_is_no_spike(model):
    there = Commands([[-0.1, 0.1], [0.1, -0.1]], [1.0, 1.0])
    trials = MujocoWorld(threads=1).run([there, there])
    _, notes = check.check(trials[:1], model)
    assert "spike" not in " ".join(notes)


def test_drives_without_noise_have_no_spikes(model):
    rng = np.random.default_rng(0)
    told = [
        Commands(rng.uniform(-0.12, 0.12, (12, 2)), rng.uniform(0.4, 2.0, 12))
        for _ in range(8)
    ]
    trials = MujocoWorld(threads=1).run(told)
    made, notes = check.check(trials, model)
    assert len(made) == 8 and not [note for note in notes if "spike" in note]


def test_a_wrong_unit_is_refused(model, told):
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told, seeds=range(4))
    large = [t.replace(observed=t.observed * [1000, 1000, 1]) for t in trials]
    with pytest.raises(FormatError, match=r"x moves 1.* times as far"):
        check.check(large, model)


@pytest.mark.parametrize("value", [0.1, np.float64(0.1), "0.1"])
def test_a_condition_is_read_as_a_number(value):
    assert as_number({"gain": value}, "gain") == 0.1


def test_a_condition_that_is_missing_has_its_default():
    assert as_number({}, "speed", 2.0) == 2.0


@pytest.mark.parametrize("value", ["fast", None, [1.0]])
def test_a_condition_that_is_no_number_is_named(value):
    with pytest.raises(FormatError, match="'speed'"):
        as_number({"speed": value}, "speed")


def test_degrees_told_as_radians_are_refused_and_a_turn_in_a_gap_is_not(model, told):
    (trial,) = MujocoWorld(reality=[NOISE], threads=1).run(told[:1], seeds=[0])
    turned = trial.observed.copy()
    turned[:, 2] = np.linspace(0, 12, len(turned))
    turned[20:, 2] += 4.5  # more than half a turn between two samples
    assert check.check([trial.replace(observed=turned)], model)
    turned[:, 2] = (np.rad2deg(np.linspace(0, 12, len(turned))) + 180) % 360 - 180
    with pytest.raises(FormatError, match="in degrees, told as rad"):
        check.check([trial.replace(observed=turned)], model)
    turned[:, 2] = 60 * np.sin(np.linspace(0, 40, len(turned)))  # and never wrapped
    with pytest.raises(FormatError, match="in degrees, told as rad"):
        check.check([trial.replace(observed=turned)], model)


def test_a_single_count_of_a_coarse_encoder_is_no_spike(model):
    ahead = Commands([[0.1, 0.1]], [6.0])
    (trial,) = MujocoWorld(threads=1).run([ahead])
    count, coarse = 2 * np.pi / 1024, trial.observed.copy()
    coarse[:, 2] = 0.0
    coarse[10:40:5, 2] = count
    _, notes = check.check([trial.replace(observed=coarse)], model)
    assert "spike" not in " ".join(notes)
    coarse[25, 2] = 50 * count
    (made,), notes = check.check([trial.replace(observed=coarse)], model)
    assert notes[-1] == "trial 0: 1 spike, dropped" and np.isnan(made.observed[25, 0])


@pytest.mark.parametrize("resumed", [True, False])
def test_what_goes_on_from_where_it_rested_was_held_and_not_stuck(model, resumed):
    turning = Commands([[0.1, 0.02]], [8.0])
    (trial,) = MujocoWorld(reality=[NOISE], threads=1).run([turning], seeds=[0])
    held = trial.observed.copy()
    missed = held[50, 2] - held[30, 2]
    held[30:51, 2] = held[30, 2]
    held[51:, 2] -= missed if resumed else 0.0
    ((made, notes),) = without_stuck([trial.replace(observed=held)], model)
    assert any("yaw is stuck" in note for note in notes) == (not resumed)
    assert np.isnan(made.observed[30:51]).any() == (not resumed)


@pytest.mark.parametrize(("since", "stuck"), [(25, False), (45, True)])
def test_what_comes_to_rest_and_stays_is_not_stuck(model, since, stuck):
    there = Commands([[0.1, 0.02], [0.1, 0.1], [0.1, 0.02]], [2.0, 2.0, 4.0])
    (trial,) = MujocoWorld(reality=[NOISE], threads=1).run([there], seeds=[0])
    held = trial.observed.copy()
    held[since:, 2] = held[since, 2]  # while it goes straight, or as it turns again
    ((_, notes),) = without_stuck([trial.replace(observed=held)], model)
    assert any("yaw is stuck" in note for note in notes) == stuck


def test_moments_at_which_commands_began_are_no_lost_samples(model, told):
    (trial,) = MujocoWorld(reality=[NOISE], threads=1).run(told[:1], seeds=[0])
    begun, seen = trial.boundaries[1:-1], trial.observed.copy()
    assert len(begun) > 1 and 20 not in begun
    seen[begun] = np.nan
    _, notes = check.check([trial.replace(observed=seen)], model)
    assert "lost" not in " ".join(notes)
    seen[20] = np.nan
    _, notes = check.check([trial.replace(observed=seen)], model)
    assert f"1 of {len(seen) - len(begun)} samples lost" in " ".join(notes)


def test_a_trial_of_more_commands_than_samples_is_used(model, told):
    (trial,) = MujocoWorld(reality=[NOISE], threads=1).run(told[:1], seeds=[0])
    inner = np.arange(1, len(trial.times) - 1)
    begun = np.array([0, *inner[inner % 3 > 0], len(trial.times) - 1])
    which = np.searchsorted(trial.boundaries, begun[:-1], side="right") - 1
    commands = Commands(
        trial.commands.values[which],
        np.diff(trial.times[begun]),
        trial.commands.channels,
    )
    seen = trial.observed.copy()
    seen[begun[1:-1]] = np.nan
    streamed = trial.replace(
        observed=seen, commands=commands, boundaries=begun, handled=()
    )
    kept, notes = check.check([streamed], model)
    assert len(kept) == 1 and "left out" not in " ".join(notes)


def test_a_robot_that_stays_has_no_places():
    noise = np.random.default_rng(0).normal(0, 1e-3, (50, 3))
    coarse = segments.coarse(noise + np.array([0.4, -0.2, 3.1]))
    assert np.ptp(coarse, axis=0).max() < 1e-12
    along = np.linspace(0, 1, 50)[:, None] * [0.5, 0.0, 0.0]
    assert len(np.unique(segments.coarse(along)[:, 0].round(9))) == 17  # 0.5 m / 3 cm


def test_what_rests_in_one_trial_is_no_fault_of_a_channel_in_another(
    model, told, monkeypatch
):
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told[:2], seeds=range(2))
    held = []
    for trial in trials:
        observed = trial.observed.copy()
        observed[:, 1] = 0.1
        held.append(trial.replace(observed=observed))
    assert any(notes for _, notes in without_stuck(held, model))
    rests = frozenset({"y"})
    monkeypatch.setattr(
        type(model),
        "at_rest",
        lambda _, trial, __: rests if trial is held[1] else frozenset(),
    )
    assert not any(notes for _, notes in without_stuck(held, model))
