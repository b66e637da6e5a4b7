"""The run directory: what is refused, what comes back."""

import json
from pathlib import Path

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.experiment.config import RunConfig
from bns.experiment.record import Step
from bns.storage import arrays, parquet
from bns.storage.store import load, read_table
from bns.worlds.data import dataset
from bns.worlds.trial import Commands, Outcome, Trial
from tests.bns.shared import contents


@pytest.fixture
def begun(fakes, tmp_path) -> Path:
    """A run stopped after two trials."""
    asked = iter([False, False, True])
    fakes.train(tmp_path / "begun", stop=lambda: next(asked))
    return tmp_path / "begun"


def refused(fakes, directory, match, kind=FormatError, **options):
    """Training there is refused with a message, and nothing is changed."""
    before = contents(directory)
    with pytest.raises(kind, match=match):
        fakes.train(directory, **options)
    assert contents(directory) == before


def test_everything_is_where_the_manual_says(run):
    names = {path.name for path in run.iterdir()}
    assert names == {
        "run.json", "config.toml", "state.npz", "timing.jsonl", "dataset",
        "arrays.npz", "record.parquet",
    }  # fmt: skip
    head = json.loads((run / "run.json").read_text())
    assert (head["format"], head["schema"], head["mode"]) == ("bns-run", 1, "eager")
    assert {"bns", "python", "numpy", "machine", "commit"} <= set(head["versions"])
    assert head["conditions"]["damage"] == ["wheel_gain:wheel=left,factor=0.8@2"]


def test_record_has_a_row_per_replicate_and_trial(run):
    import pyarrow.parquet as pq

    table = pq.read_table(run / "record.parquet")
    assert table.num_rows == 3 * 4
    assert table["replicate"].to_pylist() == [0] * 4 + [1] * 4 + [2] * 4
    assert table["damaged"].to_pylist() == [0.0, 0.0, 1.0, 1.0] * 3
    record = load(run)
    assert (record.replicates, record.trials) == (3, 4)
    assert record["fitness"][1, 3] == table["fitness"][1 * 4 + 3].as_py()


@pytest.mark.parametrize("trial", [2**39, -5, 1])
def test_a_table_whose_rows_do_not_count_up_is_refused(tmp_path, trial):
    """And no room is made for as many as it claims."""
    path = tmp_path / "record.parquet"
    rows = {"replicate": np.zeros(2, np.int64), "trial": np.array([0, trial])}
    parquet.write(path, rows | {"fitness": np.zeros(2)})
    if trial == 1:
        assert read_table(path)["fitness"].shape == (1, 2)
        return
    with pytest.raises(FormatError, match="in 2 rows"):
        read_table(path)


def test_dataset_holds_the_recorded_replicates(run):
    found = dataset.read(run / "dataset")
    assert found.replicates == (0, 1) * 4
    assert found.numbers == (0, 0, 1, 1, 2, 2, 3, 3)
    record = load(run)
    trial = found.trials[5]  # replicate 1, trial 2
    np.testing.assert_array_equal(trial.command_poses_world, record.poses[1, 2, :3])


def test_unfinished_run_can_be_read(begun, fakes):
    record = load(begun)
    assert record.trials == 2
    np.testing.assert_array_equal(record.sent, fakes.train(None).sent[:, :2])


def test_run_without_a_trial_can_be_read(fakes, tmp_path):
    fakes.train(tmp_path / "run", stop=lambda: True)
    record = load(tmp_path / "run")
    assert (record.replicates, record.trials) == (3, 0)


def test_existing_run_needs_resume(fakes, run):
    refused(fakes, run, "add --resume", kind=BnsError)


@pytest.mark.parametrize("resume", [False, True])
def test_foreign_directory_is_refused(fakes, tmp_path, resume):
    (tmp_path / "thesis.txt").write_text("mine")
    refused(fakes, tmp_path, r"not empty.*another --out", resume=resume)


def test_file_in_the_place_of_a_directory_is_refused(fakes, tmp_path):
    (tmp_path / "run").write_text("mine")
    with pytest.raises(BnsError, match="is a file"):
        fakes.train(tmp_path / "run")


def test_empty_directory_is_used(fakes, tmp_path):
    assert fakes.train(tmp_path).trials == 4


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ('{"format": "bns-', "cannot be read as JSON"),
        ("[]", "holds no JSON object"),
        ('{"format": "other", "schema": 1}', "is not a run of bns"),
        ('{"format": "bns-run", "schema": 2}', "schema 2, this version reads up to 1"),
        ('{"format": "bns-run", "schema": 1}', "not as it should be"),
    ],
)
def test_bad_head_is_refused(fakes, begun, text, match):
    (begun / "run.json").write_text(text)
    refused(fakes, begun, match, resume=True)
    with pytest.raises(FormatError, match=match):
        load(begun)


def test_torn_state_is_refused(fakes, begun):
    state = begun / "state.npz"
    state.write_bytes(state.read_bytes()[:100])
    refused(fakes, begun, "state.npz cannot be read", resume=True)


def test_torn_and_missing_steps_are_refused(begun):
    step = begun / "steps" / "00000.npz"
    whole = step.read_bytes()
    step.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FormatError, match=r"00000.npz cannot be read"):
        load(begun)
    step.unlink()
    with pytest.raises(FormatError, match=r"00000.npz is missing"):
        load(begun)


def test_torn_record_is_refused(run):
    (run / "record.parquet").write_bytes(b"PAR1")
    with pytest.raises(FormatError, match=r"record.parquet cannot be read"):
        load(run)


def test_directory_without_a_run_is_refused(tmp_path):
    with pytest.raises(FormatError, match=r"not a run directory.*no run.json"):
        load(tmp_path)


def test_step_comes_back_from_arrays_as_it_was():
    trial = Trial(
        Commands(np.array([[0.1, 0.2]]), np.array([0.5])),
        np.array([0.0, 0.2, 0.5]),
        np.array([[0, 0, 0], [np.nan] * 3, [1, 2, 3]]),
        np.array([0, 2]),
        handled=np.array([True]),
        outcome=Outcome(left_arena=True, edge_turns=2),
        robot="khepera3",
        world="fake",
        conditions={"damage": ["a"], "mass": np.float64(2.5)},
        truth={"qpos": np.arange(6.0).reshape(3, 2)},
    )
    arrays = {"sent": np.ones((1, 2, 3)), "poses": np.ones((1, 3, 3))}
    step = Step({"fitness": np.array([3.0])}, arrays, [trial])
    back = Step.from_arrays(step.to_arrays())
    assert back.columns["fitness"] == [3.0]
    np.testing.assert_array_equal(back.arrays["sent"], arrays["sent"])
    other = back.trials[0]
    np.testing.assert_array_equal(other.observed, trial.observed)
    np.testing.assert_array_equal(other.truth["qpos"], trial.truth["qpos"])
    assert other.outcome == trial.outcome
    assert other.handled.tolist() == [True]
    assert other.conditions == {"damage": ["a"], "mass": 2.5}
    assert (other.robot, other.world, other.channels) == (
        trial.robot, trial.world, trial.channels,
    )  # fmt: skip


def test_arrays_of_objects_are_never_stored(tmp_path):
    with pytest.raises(TypeError, match="cannot be stored: \\['a'\\]"):
        arrays.write_npz(tmp_path / "x.npz", {"a": np.array([None])})


def test_unwritable_place_is_one_message(fakes, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BnsError, match="Cannot write"):
        fakes.train(tmp_path / "file" / "run", config=RunConfig(trials=1))


def test_what_else_a_learner_keeps_comes_back(fakes, run, begun):
    finished, going_on = load(run), load(begun)
    assert finished.extra["felt"].shape == (3, 4, 2)
    np.testing.assert_array_equal(finished.extra["felt"][:, :2], going_on.extra["felt"])
