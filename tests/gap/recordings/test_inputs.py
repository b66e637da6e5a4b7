"""What a user gives: models and recordings by name, and what is refused."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap import store, warnings
from bns.gap.decomposition import rest
from bns.gap.diagnose import diagnose
from bns.gap.models.unicycle import UnicycleModel
from bns.gap.recordings import load_recordings, trial_conditions
from bns.worlds import registry
from bns.worlds.data import dataset
from bns.worlds.effects import registry as effects
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Channel, Commands, Trial


@pytest.fixture(scope="module")
def drive():
    told = Commands(np.array([[0.1, 0.05], [-0.05, 0.1]]), [0.5, 0.5])
    (trial,) = MujocoWorld(threads=1).run([told])
    return trial


def test_recordings_are_pooled_chosen_and_of_one_robot(model, drive, tmp_path):
    for name, load in (("a", "light"), ("b", "heavy")):
        dataset.write(tmp_path / name, [drive.replace(conditions={"load": load})])
    both = [str(tmp_path / "a"), str(tmp_path / "b")]
    assert len(load_recordings.trials(both, model)) == 2
    (kept,) = load_recordings.trials(both, model, only=["load=heavy"])
    assert kept.conditions["load"] == "heavy"
    for only, said in (
        ("load=none", "Available: heavy, light"),
        ("mass=1", "'mass=1'"),
    ):
        with pytest.raises(BnsError, match=said):
            load_recordings.trials(both, model, only=[only])
    dataset.write(tmp_path / "c", [drive.replace(robot="rover")])
    with pytest.raises(BnsError, match="recording is of rover, the model is 'khep"):
        load_recordings.trials([str(tmp_path / "c")], model)
    moved = f"/elsewhere/{model.name}"  # a directory of robots, on another machine
    dataset.write(tmp_path / "d", [drive.replace(robot=moved)])
    assert len(load_recordings.trials([str(tmp_path / "d")], model)) == 1


def test_trials_are_chosen_by_their_numbers_of_a_run_too(model, drive, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    marked = [drive.replace(conditions={"n": n}) for n in range(6)]
    dataset.write(run / "dataset", marked, replicates=[0, 0, 0, 1, 1, 1])

    def numbers(text):
        found = load_recordings.trials([str(run)], model, numbers=text)
        return [trial.conditions["n"] for trial in found]

    assert numbers("") == [0, 1, 2, 3, 4, 5]
    assert numbers("1-") == [1, 2, 4, 5]  # 1 and 2 of both replicates
    assert numbers("-0") == [0, 3] and numbers("0, 2") == [0, 2, 3, 5]
    with pytest.raises(BnsError, match="--trials drop all"):
        numbers("7-9")
    for wrong in ("a", "1..2", "1,", "-1-2"):
        with pytest.raises(BnsError, match="is no number of a trial"):
            numbers(wrong)


def test_commands_that_the_robot_can_not_be_told_are_refused(model, drive):
    load_recordings.tellable([drive], model)
    fast = drive.commands.values * 20
    told = Commands(fast, drive.commands.durations)
    with pytest.raises(BnsError, match=r"trial 0: left_speed = -1\.0 m/s"):
        load_recordings.tellable([drive.replace(commands=told)], model)
    loose = SimpleNamespace(name="own", limits=model.limits, leeway=1.0)
    more = Commands(drive.commands.values * 5, drive.commands.durations)
    load_recordings.tellable([drive.replace(commands=more)], loose)
    with pytest.raises(BnsError, match=r"trial 0: left_speed = -1\.0 m/s"):
        load_recordings.tellable([drive.replace(commands=told)], loose)
    other = (Channel("forward_speed", "m/s"), Channel("turning_rate", "rad/s"))
    told = Commands(drive.commands.values, drive.commands.durations, other)
    with pytest.raises(BnsError, match="'forward_speed'; model 'khepera3' is told"):
        load_recordings.tellable([drive.replace(commands=told)], model)


def test_a_model_that_does_not_move_is_noticed(model, drive):
    warnings.reproducible([drive], model)
    still = Commands(0 * drive.commands.values, drive.commands.durations)
    with pytest.raises(BnsError, match="does not move on the recorded commands"):
        warnings.reproducible([drive.replace(commands=still)], model)


def test_rounding_to_the_grid_does_not_add_up():
    count = 300
    told = Commands(np.ones((count, 2)) * 0.1, np.full(count, 1 / 30))
    times = np.arange(count + 1) / 30
    trial = Trial(told, times, np.zeros((count + 1, 3)), np.arange(count + 1))
    made = load_recordings.on_grid(trial, 0.005)
    ends = np.cumsum(made.commands.durations)
    assert np.abs(ends - np.cumsum(told.durations)).max() <= 0.0025 + 1e-9
    np.testing.assert_allclose(ends / 0.005, np.rint(ends / 0.005), atol=1e-6)
    coarse = load_recordings.on_grid(trial, 0.1)
    assert len(coarse.commands) == 100
    assert coarse.commands.duration == pytest.approx(10.0)
    assert coarse.boundaries[-1] == count


def test_what_mujoco_recorded_keeps_its_commands():
    """There each command was rounded by itself, and so does the model."""
    told = Commands(np.ones((9, 2)) * 0.1, np.full(9, 0.5024))
    (trial,) = registry.make("mujoco", threads=1).run([told])
    assert trial.times[-1] == pytest.approx(9 * 0.5)
    assert load_recordings.on_grid(trial, 0.005) is trial
    assert load_recordings.on_grid(trial.replace(conditions={}), 0.005) is not trial


def test_many_samples_are_thinned():
    count = 5000
    times = np.arange(count) * 0.01
    told = Commands(np.ones((3, 2)) * 0.1, [10.0, 20.0, 19.99])
    at = np.array([0, 1000, 3000, count - 1])
    made = load_recordings.thinned(Trial(told, times, np.zeros((count, 3)), at))
    assert len(made.times) <= load_recordings.SAMPLES + 4
    np.testing.assert_array_equal(made.times[made.boundaries], times[at])


def test_noise_is_that_of_all_samples():
    """At 5 Hz a motion of 1 Hz is rough; at 200 Hz its measurement alone is."""
    rng = np.random.default_rng(0)
    times = np.arange(5000) * 0.005
    noise = np.array([1e-3, 2e-3, 5e-3])
    seen = np.sin(2 * np.pi * times)[:, None] + noise * rng.standard_normal((5000, 3))
    told = Commands(np.ones((1, 2)) * 0.1, [times[-1]])
    made = load_recordings.thinned(Trial(told, times, seen, np.array([0, 4999])), 120)
    sizes = trial_conditions.third_differences(made)
    assert trial_conditions.sample_step(made) == pytest.approx(0.005)
    median = 0.6745 * rest.THIRD * noise
    np.testing.assert_allclose(np.median(sizes, axis=0), median, rtol=0.05)


def driven(model, text, seed):
    """A recording of a robot told speed and rate, with noise."""
    rng = np.random.default_rng(seed)
    channels = (Channel("forward_speed", "m/s"), Channel("turning_rate", "rad/s"))
    values = np.column_stack([rng.uniform(0, 0.3, 10), rng.uniform(-0.8, 0.8, 10)])
    told = Commands(values, np.full(10, 2.0), channels)
    times = np.arange(201) * 0.1
    blank = Trial(told, times, np.zeros((201, 3)), np.arange(0, 201, 20))
    ((seen,),) = model.simulate([blank], [[effects.parse(t) for t in text]])
    noise = rng.normal(0, [1e-3, 1e-3, 5e-3], seen.shape)
    return blank.replace(observed=seen + noise, robot="irobot_create")


@pytest.mark.parametrize(
    ("text", "names", "value"),
    [
        ("command_gain:part=turning_rate,factor=0.93", "command_gain", 0.93),
        ("command_delay:part=all,delay=0.2", "command_delay", 0.2),
    ],
)
def test_a_robot_told_speed_and_rate(text, names, value):
    model = UnicycleModel(process=(1e-4, 1e-4, 1e-3))  # nothing scatters here
    trials = [driven(model, [text], seed) for seed in range(4)]
    found = diagnose(trials, model, full=False)
    assert found.verdict.named[0][0].startswith(names)
    assert found.best.magnitudes[0] == pytest.approx(value, abs=0.02)
    again = store.parse(found.best.effects[0], model)
    assert again.name == names


def test_unknown_models_say_what_there_is():
    with pytest.raises(BnsError, match="Did you mean 'khepera3'"):
        load_recordings.model("khepera4")
    with pytest.raises(BnsError, match="gap_your_robot"):
        load_recordings.model("arm.xml")


def test_trials_keep_their_numbers_in_what_is_said(model, tmp_path):
    rng = np.random.default_rng(2)
    told = [
        Commands(rng.uniform(-0.12, 0.12, (6, 2)), np.full(6, 0.8)) for _ in range(8)
    ]
    world = MujocoWorld(
        damage=["wheel_gain:wheel=left,factor=0.9@4"],
        reality=["tracker_noise:position_sd=0.001,heading_sd=0.005"],
    )
    recorded = [
        world.run([item], trial=number, seeds=[run])[0]
        for run in range(2)
        for number, item in enumerate(told)
    ]
    recorded[2] = recorded[1]
    place = str(
        dataset.write(tmp_path / "runs", recorded, replicates=[0] * 8 + [1] * 8)
    )
    names = [f"wheel_gain[{side}]" for side in ("left", "right", "both")]
    trials = load_recordings.trials([place], model)
    found = diagnose(trials, model, rows=names)
    assert (found.change["trial"], found.change["direction"]) == (4, "sets in")
    notes = warnings.warnings(found, model.rows(trials))
    assert "wheel_gain[left] sets in at trial 4" in found.verdict.sentence
    assert not any("sets in" in note for note in notes)  # it was dated
    same = "trial 2 of run 0: the same samples as trial 1 of run 0, left out"
    assert same in found.faults
    after = load_recordings.trials([place], model, numbers="4-")
    later = diagnose(after, model, rows=names)
    assert later.change == {}
    assert later.verdict.named == (("wheel_gain[left]",),)
