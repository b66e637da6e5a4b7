"""What `from bns import ...` gives, and what a configuration and a record can do."""

import numpy as np
import pytest

import bns
from bns import presets
from bns.errors import BnsError, UnknownNameError
from bns.experiment.record import RunRecord


@pytest.mark.parametrize("name", bns.__all__)
def test_every_name_is_there(name):
    assert getattr(bns, name) is not None


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'trian'"):
        getattr(bns, "trian")  # noqa: B009 (the attribute is what is tested)


def test_a_world_by_name():
    assert bns.make("static-snn", robot="khepera3").robot == "khepera3"


class TestWith:
    CONFIG = presets.load("demo")

    def test_settings_are_changed_by_dotted_name_and_nothing_else_is(self):
        made = self.CONFIG.with_({"snn.epochs": 50, "seed": 3, "task.radius": 0.1})
        assert (made.snn.epochs, made.seed, made.task.radius) == (50, 3, 0.1)
        assert made.snn.hidden == self.CONFIG.snn.hidden
        assert made.with_({"snn.epochs": 400, "seed": 0, "task.radius": 0.09}) == (
            self.CONFIG
        )

    def test_tables_of_damage_are_read_as_in_files(self):
        made = self.CONFIG.with_({"world.damage": ["payload:mass=0.3@4"]})
        assert made.world.damage == ("payload:mass=0.3@4",)

    def test_an_unknown_name_and_a_bad_value(self):
        with pytest.raises(UnknownNameError, match=r"snn\.epochs"):
            self.CONFIG.with_({"snn.epoch": 50})
        with pytest.raises(BnsError, match="whole number"):
            self.CONFIG.with_({"snn.epochs": 1.5})

    def test_another_learner_brings_its_own_settings(self):
        made = self.CONFIG.with_({"learner": "cma", "settings.sigma": 0.3})
        assert made.settings.sigma == 0.3
        assert made.adaptation.window == 0  # of bns, which the preset had set
        assert made.with_({"learner": "bns"}).settings == self.CONFIG.settings


def test_a_record_as_a_table():
    pytest.importorskip("pandas")
    values = np.arange(6.0).reshape(2, 3)
    empty = np.zeros((2, 3, 0, 3))
    record = RunRecord(
        config=presets.load("demo"),
        versions={},
        columns={"fitness": values},
        sent=empty,
        poses=empty,
        predicted=empty,
        damage_onset=np.full(2, -1),
    )
    table = record.to_pandas()
    assert list(table) == ["replicate", "trial", "fitness"]
    assert table.query("replicate == 1 and trial == 2").fitness.item() == 5.0
