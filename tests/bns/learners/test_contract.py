"""What a learner's mistakes are told as."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.loading import with_learner
from bns.experiment.run import train
from bns.learners import registry
from bns.learners.base import Proposal
from bns.learners.random import RandomSearch
from bns.worlds import registry as worlds


class Right(RandomSearch):
    columns: ClassVar = {"a": "one", "b": "two"}

    def observe(self, trial, tried, best):
        super().observe(trial, tried, best)
        return {"a": np.ones(self.runs), "b": np.ones(self.runs)}


class Omits(Right):
    def observe(self, trial, tried, best):
        row = super().observe(trial, tried, best)
        return {"a": row["a"]}


class Adds(Right):
    def observe(self, trial, tried, best):
        wide = np.zeros((self.runs, 2))
        return super().observe(trial, tried, best) | {"c": self.cost, "wide": wide}


class Few(Right):
    def propose(self, trial):
        return Proposal(super().propose(trial).tried[:1])


class Many(Right):
    def propose(self, trial):
        proposal = super().propose(trial)
        return Proposal(proposal.tried, proposal.tried * 2)


def trained(kind, monkeypatch):
    monkeypatch.setattr(registry, "_registered", {"mine": kind})
    config = with_learner(presets.load("khepera-simple"), "mine")
    config = replace(config, trials=2, replicates=2, record_replicates=0, threads=1)
    return train(config, world=worlds.make("static-snn", robot="khepera3"))


def test_what_is_right_is_recorded(monkeypatch):
    assert trained(Right, monkeypatch)["b"].tolist() == [[1.0, 1.0]] * 2


def test_a_subclass_completes_what_it_has_from_the_class_above(monkeypatch):
    class Completes(Omits):
        def observe(self, trial, tried, best):
            return super().observe(trial, tried, best) | {"b": np.zeros(self.runs)}

    assert trained(Completes, monkeypatch)["b"].tolist() == [[0.0, 0.0]] * 2


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (Omits, "Learner 'mine': observe gave no 'b', and `columns` declares a, b:"),
        (Adds, "Learner 'mine': observe gave the column 'c', and `columns` declares a"),
        (Few, "'mine': propose gave 1 controllers as `tried` for 2 runs: give one for"),
        (Many, "'mine': propose gave 4 controllers as `best` for 2 runs: give one"),
    ],
)
def test_a_mistake_names_learner_and_what_is_wanted(kind, says, monkeypatch):
    with pytest.raises(BnsError) as error:
        trained(kind, monkeypatch)
    assert says in str(error.value)
