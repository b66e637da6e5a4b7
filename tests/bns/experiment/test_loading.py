"""Configurations: what is read, refused, comes back; what `from bns import` gives."""

import inspect
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import bns
from bns import presets
from bns.errors import BnsError, FormatError, OutOfBoundsError, UnknownNameError
from bns.experiment import config, loading
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.record import RunRecord
from bns.experiment.validate import BOUNDS, check, leaves
from bns.worlds.damage import Damage


def test_every_number_has_bounds_and_every_bound_a_number():
    numbers = {
        name
        for name, value in leaves(RunConfig())
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    assert numbers == set(BOUNDS)


def test_defaults_are_allowed():
    assert check(RunConfig()) == RunConfig()


def _changed(tree, name, value):
    head, _, rest = name.partition(".")
    inner = _changed(getattr(tree, head), rest, value) if rest else value
    return replace(tree, **{head: inner})


@pytest.mark.parametrize("name", BOUNDS)
def test_values_out_of_bounds_name_bound_and_unit(name):
    low, high, unit = BOUNDS[name]
    given = dict(leaves(RunConfig()))[name]
    step = 1 if isinstance(given, int) else 1e-3
    bad = [low - step, high + max(step, high * 1e-3), float("nan"), float("inf")]
    for value in bad:
        with pytest.raises(OutOfBoundsError) as caught:
            check(_changed(RunConfig(), name, value))
        said = str(caught.value)
        most = f"{high}" if isinstance(high, int) else f"{high:g}"
        assert said.startswith(f"{name} = ") and f"to {most}" in said
        assert unit == "1" or unit in said


def test_settings_that_contradict_each_other():
    wrong = {"controller": {"initial_max": 12, "initial_min": 13}}
    with pytest.raises(BnsError, match=r"initial_min = 13 is larger than .* = 12"):
        loading.from_mapping(wrong)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ({"evolution": {"populatoin": 3}}, "setting 'evolution.populatoin'.*mean 'evo"),
        ({"evolutoin": {}}, "setting 'evolutoin'. Did you mean 'evolution'"),
        ({"choose": "bset"}, "choose 'bset'. Did you mean 'best'"),
        ({"trials": 3.5}, "trials = 3.5 is not allowed: give a whole number"),
        ({"trials": True}, "trials = True is not allowed: give a whole number"),
        ({"task": 3}, "task = 3 is not allowed: it is a table"),
        ({"task": {"radius": "wide"}}, "radius = 'wide' is not .*: give a number"),
        ({"snn": {"warm_start": 1}}, "warm_start = 1 is not allowed: give true or"),
        ({"world": {"damage": [3]}}, "world.damage: 3 is not allowed"),
        ({"world": {"damage": 3}}, "world.damage = 3 is not allowed: give a list"),
        ({"world": {"name": 3}}, "world.name = 3 is not allowed: give text"),
    ],
)
def test_wrong_content_is_one_message(content, match):
    with pytest.raises(BnsError, match=match):
        loading.from_mapping(content)


def test_unknown_key_is_an_unknown_name():
    with pytest.raises(UnknownNameError):
        loading.from_mapping({"tirals": 3})


def test_toml_there_and_back(tmp_path):
    given = replace(
        RunConfig(seed=2**60, trials=7),
        world=WorldConfig(damage=('wheel_gain:wheel="left"', "ö\\n"), sample_dt=0.05),
    )
    (tmp_path / "x.toml").write_text(loading.to_toml(given), encoding="utf-8")
    assert loading.from_file(tmp_path / "x.toml") == given
    assert loading.from_mapping(loading.to_mapping(given)) == given


def test_file_may_start_from_a_preset(tmp_path):
    text = 'description = "mine"\npreset = "khepera-simple"\ntrials = 45\n'
    (tmp_path / "mine.toml").write_text(text)
    found = loading.from_file(tmp_path / "mine.toml")
    assert found == replace(presets.load("khepera-simple"), trials=45)


def test_damage_may_be_a_table(tmp_path):
    text = '[[world.damage]]\neffect = "wheel_gain"\nfactor = 0.8\nonset = 30\n'
    (tmp_path / "mine.toml").write_text(text)
    damage = loading.from_file(tmp_path / "mine.toml").world.damage
    assert damage == ("wheel_gain:wheel=both,factor=0.8@30",)


@pytest.mark.parametrize("text", ["trials = ", None])
def test_files_that_are_none(tmp_path, text):
    if text is not None:
        (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(FormatError, match="cannot be read"):
        loading.from_file(tmp_path / "mine.toml")


def test_differences_name_the_key():
    one, other = RunConfig(), loading.from_mapping({"task": {"radius": 0.1}})
    assert loading.differences(one, other) == {"task.radius": (0.09, 0.1)}


@pytest.mark.parametrize("name", presets.names())
def test_presets_are_valid_and_described(name):
    assert presets.load(name).preset == name
    assert 20 <= len(presets.describe(name)) <= 100
    Damage.parse(presets.load(name).world.damage)


def test_unknown_preset_is_suggested():
    with pytest.raises(UnknownNameError, match="mean 'khepera-simple'"):
        presets.load("kephera-simple")


def test_every_setting_is_documented():
    """The text under each field is the manual that `bns run --help` prints."""
    lines = inspect.getsource(config).splitlines()
    for line, after in pairwise(lines):
        if re.match(r"    [a-z_]+: .* = ", line) and "default_factory" not in line:
            assert after.startswith('    """'), line


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
