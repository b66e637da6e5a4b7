"""A run that was stopped or killed goes on to the same bytes."""

import errno
import os
from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.experiment.config import (
    AdaptationConfig,
    EvolutionConfig,
    RunConfig,
    SnnConfig,
    WorldConfig,
)
from bns.experiment.run import train
from bns.storage import files
from bns.storage.store import load
from tests.bns.contents import contents
from tests.sources import ROOT

FAKES = ROOT / "tests" / "bns" / "fakes.py"
KILLED = -9


@pytest.fixture
def clean(fakes, tmp_path):
    """The contents of a run that nothing disturbed."""
    fakes.train(tmp_path / "clean")
    return contents(tmp_path / "clean")


# Writes of the fake run: config.toml, run.json, four times step and state, arrays, the
# dataset and its three files, record.
@pytest.mark.parametrize(
    ("write", "moment"),
    [(2, "before"), (2, "beside"), (3, "beside"), (4, "before"), (4, "after"),
     (10, "after"), (12, "beside"), (12, "after"), (14, "beside"), (16, "beside"),
     (16, "after")],
)  # fmt: skip
def test_killed_run_resumes_to_the_same_bytes(
    fakes, clean, run_python, tmp_path, write, moment
):
    run_python(FAKES, tmp_path / "run", write, moment, code=KILLED)
    assert contents(tmp_path / "run") != clean
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_stopped_run_resumes_to_the_same_bytes(fakes, clean, tmp_path):
    asked = iter([False, False, True])
    record = fakes.train(tmp_path / "run", stop=lambda: next(asked))
    assert record.trials == 2
    assert load(tmp_path / "run").trials == 2
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_memory_and_directory_hold_the_same_record(fakes, tmp_path):
    inside = fakes.train(None)
    for record in (fakes.train(tmp_path / "run"), load(tmp_path / "run")):
        assert set(record.columns) == set(inside.columns)
        for name, values in inside.columns.items():
            np.testing.assert_array_equal(record[name], values)
        np.testing.assert_array_equal(record.poses, inside.poses)
        np.testing.assert_array_equal(record.damage_onset, [2, 2, 2])


@pytest.mark.parametrize("write", [1, 2, 3, 6, 11, 12])
def test_full_disk_stops_with_a_message_and_loses_nothing(
    fakes, clean, tmp_path, monkeypatch, write
):
    count, sync = 0, os.fsync

    def full(handle):
        nonlocal count
        count += 1
        if count == 2 * write - 1:  # a file and its directory are synchronised
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(handle)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(files.StorageError, match=r"No space left.*--resume"):
            fakes.train(tmp_path / "run")
    assert not list((tmp_path / "run").rglob(f"{files.TEMPORARY}*"))
    if write > 2:
        assert load(tmp_path / "run").trials == (min(write, 10) - 2) // 2
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_other_configuration_is_refused(fakes, tmp_path):
    fakes.train(tmp_path / "run", stop=lambda: True)
    before = contents(tmp_path / "run")
    with pytest.raises(BnsError, match="trials = 4, not 9"):
        fakes.train(tmp_path / "run", resume=True, config=fakes.longer(9))
    assert contents(tmp_path / "run") == before


def test_finished_run_stays_as_it_is(fakes, clean, tmp_path):
    fakes.train(tmp_path / "clean", resume=True)
    assert contents(tmp_path / "clean") == clean


def test_two_processes_cannot_write_one_run(fakes, tmp_path):
    def again(*_):
        with pytest.raises(BnsError, match="written by another process"):
            fakes.train(tmp_path / "run", resume=True)

    fakes.train(tmp_path / "run", on_trial=again)


@pytest.mark.parametrize("kind", ["three", "ensemble"])
def test_real_learner_in_mujoco_resumes_to_the_same_bytes(tmp_path, kind):
    config = RunConfig(
        evolution=EvolutionConfig(population=12, generations=2),
        snn=SnnConfig(kind=kind, epochs=5, members=2),
        adaptation=AdaptationConfig(window=30, population_reset=True),
        world=WorldConfig(damage=("wheel_gain:wheel=left,factor=0.8@3",)),
        choose="random",
        trials=5,
        replicates=2,
        record_replicates=1,
        compiled="no",
        threads=1,
    )
    train(config, tmp_path / "clean")
    asked = iter([False, False, True])
    train(config, tmp_path / "run", stop=lambda: next(asked))
    train(config, tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == contents(tmp_path / "clean")
    other = train(replace(config, seed=1), tmp_path / "other")
    assert not np.array_equal(load(tmp_path / "run").sent, other.sent, equal_nan=True)
