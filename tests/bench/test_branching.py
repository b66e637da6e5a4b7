"""Runs that begin as copies of others: the same bytes as run from the start."""

from dataclasses import replace

import pytest

from bench.learning import branching, experiments
from bns.errors import BnsError
from bns.experiment.run import train
from bns.storage.store import RunStore
from tests.bns.walkers import small

ONSET = 6


def damaged(trunk, onset=ONSET, **changes):
    world = replace(trunk.world, damage=(f"leg_raised:legs=1,blend=1@{onset}",))
    settings = {"preset": "branch", "trials": ONSET + 2, "world": world}
    return replace(trunk, **settings | changes)


@pytest.fixture
def trunk(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments, "RUNS", tmp_path)
    plain = replace(small().world, damage=())
    return small(preset="trunk", trials=ONSET, record_replicates=0, world=plain)


def test_a_branch_has_the_bytes_of_a_run_from_the_start(trunk, tmp_path):
    branch = damaged(trunk)
    train(trunk, experiments.directory(trunk))
    branching.begin(trunk, branch)
    place = experiments.directory(branch)
    assert len(list((place / "steps").iterdir())) == ONSET, "it goes on, not anew"
    train(branch, place, resume=True)
    train(branch, tmp_path / "whole")
    names = {path.name for path in (tmp_path / "whole").iterdir()} - {"timing.jsonl"}
    assert {"record.parquet", "arrays.npz", "state.npz"} <= names
    for name in names:
        if (place / name).is_file():
            wanted = (tmp_path / "whole" / name).read_bytes()
            assert (place / name).read_bytes() == wanted, name


@pytest.mark.parametrize(
    "changes", [{"onset": ONSET - 1}, {"seed": 5}, {"choose": "tournament"}]
)
def test_a_branch_that_differs_earlier_is_refused(trunk, changes):
    with pytest.raises(BnsError, match="branch is no continuation of trunk"):
        branching.begin(trunk, damaged(trunk, **changes))


def test_a_section_that_did_nothing_in_the_trunk_may_differ(trunk):
    branch = damaged(trunk, watch=replace(trunk.watch, forget=True))
    train(trunk, experiments.directory(trunk))
    with pytest.raises(BnsError, match="no continuation"):
        branching.begin(trunk, branch)
    branching.begin(trunk, branch, idle=("watch",))
    place = experiments.directory(branch)
    assert len(list((place / "steps").iterdir())) == ONSET
    assert RunStore.open(place).config.watch.forget
