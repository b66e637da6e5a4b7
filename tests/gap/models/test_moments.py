"""Commands of which a log tells to a sample only when they began."""

from dataclasses import replace

import numpy as np
import pytest

from bns.gap.bench import mjcf_cases
from bns.gap.decomposition import untold
from bns.gap.diagnose import diagnose
from bns.gap.models.base import Windows
from bns.gap.models.mjcf import log
from bns.gap.models.mjcf.model import OwnModel
from bns.worlds.data.importing import MOMENTS
from bns.worlds.trial import Commands
from tests.sources import ROOT

SAMPLE = mjcf_cases.SAMPLE
COUNT, LENGTH = 4, 30  # trials, commands of each


@pytest.fixture(scope="module")
def arm():
    return OwnModel.read(ROOT / "examples" / "arm" / "arm.toml", threads=1)


def told(arm, rng):
    """Goals that wander, each held for two to five samples."""
    low, high = (np.array([row[k] for row in arm.limits.values()]) for k in (0, 1))
    held = rng.integers(2, 6, LENGTH) * SAMPLE
    wandering = np.cumsum(rng.uniform(-0.3, 0.3, (LENGTH, len(low))), axis=0)
    values = (low + high) / 2 + (high - low) / 2 * np.sin(wandering)
    return Commands(values, held, mjcf_cases.commands(arm, rng, 1)[0].channels)


def recorded(arm, text, seed):
    """Trials whose commands began up to a sample before the log tells them."""
    rng = np.random.default_rng(seed)
    logged = [told(arm, rng) for _ in range(COUNT)]
    effects = [arm.parse(text)] if text else []
    made = []
    for number, item in enumerate(logged):
        ends = np.append(0, np.cumsum(item.durations))
        begun = ends.copy()
        begun[1:-1] -= rng.uniform(0, SAMPLE, LENGTH - 1)
        real = replace(item, durations=np.diff(begun))
        (trial,) = mjcf_cases.record(arm, [real], effects, seed=100 * seed + number)
        times = (np.arange(round(ends[-1] / SAMPLE) + 1) * SAMPLE).round(6)
        made.append(
            trial.replace(
                commands=item,
                times=times,
                observed=trial.observed[np.searchsorted(trial.times, times - 1e-7)],
                boundaries=np.rint(ends / SAMPLE).astype(int),
                conditions={MOMENTS: "sampled"},
            )
        )
    return made


@pytest.mark.parametrize("seed", [11, 13])
def test_commands_that_begin_between_samples_are_no_gap(arm, seed):
    assert diagnose(recorded(arm, "", seed), arm, full=False).verdict.kind == "no gap"


@pytest.mark.parametrize(
    ("text", "name", "value", "tolerance"),
    [
        ("joint_damping:part=elbow,added=0.06", "joint_damping[elbow]", 0.06, 0.015),
        ("command_delay:part=all,delay=0.03", "command_delay[all]", 0.02, 0.006),
    ],
)
def test_an_effect_beside_them_is_named_alone(arm, text, name, value, tolerance):
    """A delay is told from the samples on, half a sample after commands began."""
    found = diagnose(recorded(arm, text, 13), arm, full=False)
    assert found.verdict.kind == "effect"
    assert found.verdict.named == ((name,),)
    assert found.best.magnitudes[0] == pytest.approx(value, abs=tolerance)


def test_commands_are_moved_so_far_apart_that_each_is_felt_by_itself(arm):
    (trial, *_) = recorded(arm, "", 1)
    made = untold.sooner(trial, arm.dt)
    assert sorted(np.concatenate([item.commands for item in made])) == [
        *range(1, LENGTH)
    ]
    begins = np.cumsum(trial.commands.durations) - trial.commands.durations
    for item in made:
        shift = (
            begins[item.commands]
            - np.cumsum(np.append(0, item.trial.commands.durations))[item.commands]
        )
        assert shift == pytest.approx(item.size * SAMPLE / np.sqrt(12))
        assert item.trial.commands.duration == pytest.approx(trial.commands.duration)
        assert (np.diff(begins[item.commands]) > untold.AFTER / 2).all()


def test_each_command_has_the_change_after_it_alone(arm):
    (trial, *_) = recorded(arm, "", 1)
    item = untold.sooner(trial, arm.dt)[0]
    last = np.arange(1, len(trial.times))
    windows = Windows(last - 1, last, trial.times[last], np.full(len(last), SAMPLE))
    made = item.directions(np.ones((len(last), 2)), windows)
    assert made.shape == (len(item.commands), len(last), 2)
    assert (made.any(axis=2).sum(axis=0) <= 1).all()  # no window is of two commands
    assert made.max() == pytest.approx(1 / item.size)


def test_a_trial_whose_moments_are_known_has_none(arm):
    (trial, *_) = recorded(arm, "", 1)
    assert untold.sooner(trial.replace(conditions={}), arm.dt) == []


@pytest.mark.parametrize(
    ("held", "sent", "unknown"),
    [(4, False, True), (1, False, False), (20, False, False), (4, True, False)],
)
def test_a_log_without_command_time_tells_them_to_a_sample(
    arm, tmp_path, held, sent, unknown
):
    """But not where each sample has a command of its own, or commands are steps."""
    names = ["time", "shoulder_goal", "elbow_goal", "shoulder", "elbow"]
    count = 40
    times = np.arange(count) * SAMPLE
    goal = np.repeat(np.linspace(0.1, 0.9, count // held), held)
    columns = [times, goal, goal, 0 * times, 0 * times]
    if sent:
        names.append("command_time")
        columns.append(np.repeat(times[::held], held) - 0.003)
    path = tmp_path / "log.csv"
    np.savetxt(
        path, np.stack(columns, 1), delimiter=",", header=",".join(names), comments=""
    )
    (trial,) = log.read(str(path), arm.config)
    assert (trial.conditions.get(MOMENTS) == "sampled") is unknown
