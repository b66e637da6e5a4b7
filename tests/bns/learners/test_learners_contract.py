"""What every learner keeps to on every task, and every adaptation of the learner bns.

A new one brings no new test.
"""

from dataclasses import replace
from itertools import product
from typing import ClassVar

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError, UnknownNameError
from bns.experiment.batch import Batch
from bns.experiment.config import LearnerSettings, RunConfig
from bns.experiment.loading import from_mapping, to_mapping, with_learner
from bns.experiment.run import train
from bns.experiment.world_factory import make_models
from bns.learners import registry
from bns.learners.base import Curves
from bns.learners.bns import adaptations
from bns.learners.bns.adaptations import Adaptations
from bns.learners.bns.config import AdaptationConfig
from bns.storage import store
from bns.tasks import registry as tasks
from bns.worlds import registry as worlds
from bns.worlds.world import CountedWorld, World
from tests.bns.robots import FakeLightWorld, Slider

LEARNERS = [name for name in registry.names() if name != "fake"]
PRESETS = {
    "navigation": "khepera-simple",
    "light": "khepera-light",
    "walk": "hexapod-walk",
}
THINKING = ("cma", "ite", "neat", "rte", "safe_ite")
"""learners that are tried with a model, too; others are nothing without one"""
FEW = {"population": 4, "situations": 2, "finalists": 2, "judged": 3}
CUT = {
    "domain_randomised": {f"settings.{name}": n for name, n in FEW.items()},
    "neat": {
        "settings.population": 12,
        "settings.generations": 2,
        "settings.add_node": 0.3,
    },
    "practising": {"settings.diagnose": False, "settings.each": 2, "settings.first": 3},
    "pets": {"settings.population": 12, "settings.iterations": 2, "settings.elites": 3},
    "rma": {f"settings.{name}": n for name, n in {**FEW, "steps": 9}.items()},
    "static_snn": {"settings.commands": 1, "settings.generations": 2},
}
"""settings of learners that would take longer than the tests have"""
KNOWN = [
    (name, task)
    for name in LEARNERS
    for task in PRESETS
    if not (task == "light" and registry.get(name).open_loop)
    and task in (registry.get(name).kinds or PRESETS)
]


def _ideal(*, robot, damage, reality, start, **others):
    told = {"robot": robot, "damage": damage, "reality": reality, "start": start}
    return worlds.make("static-snn", **told)


MODELS = {
    "navigation": ("test-ideal", _ideal),
    "light": ("test-light", lambda **told: FakeLightWorld()),
    "walk": ("test-slider", lambda **told: Slider()),
}
GIVEN = {"columns": ("fitness", "fitness_best", "solved", "reached", "commands")}


@pytest.fixture(autouse=True)
def models(monkeypatch):
    """The models are known by name, to the tests of this file alone."""
    monkeypatch.setattr(worlds, "_registered", dict(MODELS.values()))


def small(learner: str, task: str):
    """A preset of a task for a learner, cut down to a second."""
    cut = {"light.cycles": 12, "light.circle_cycles": 5, "light.starts": 2}
    config = presets.load(PRESETS[task]).with_(cut)
    config = with_learner(config, learner) if learner != "bns" else config
    if "snn" in registry.sections(learner):
        config = config.with_({"snn.epochs": 4})
    if "compiled" in registry.sections(learner):
        config = config.with_({"compiled": "no"})
    if "evolution" in registry.sections(learner):
        sizes = {"population": 12, "generations": 2, "tournament": 3}
        config = config.with_({f"evolution.{name}": n for name, n in sizes.items()})
    if registry.get(learner).needs_model:
        prior = {"prior.world": MODELS[task][0], "prior.evaluations": 200}
        if "each" in registry.get(learner).Settings.bounds:
            prior |= {"settings.first": 20, "settings.each": 40}
        config = config.with_(prior)
    config = config.with_(CUT.get(learner, {}))
    return replace(config, trials=4, replicates=2, record_replicates=1, threads=1)


def world(task: str, **settings) -> World:
    if task == "navigation":
        return worlds.make("static-snn", robot="khepera3", **settings)
    return FakeLightWorld() if task == "light" else Slider()


def made(config, task: str, **settings):
    """A learner of the configuration's runs, with a model where it wants one."""
    runs = config.replicates
    models = make_models(config)
    if config.learner in THINKING:
        models = [CountedWorld(world(task), 60) for _ in range(runs)]
    return registry.get(config.learner)(
        [config] * runs,
        replicates=range(runs),
        onsets=[-1] * runs,
        models=models,
        **settings,
    )


def advance(learner, task: str, trials: range) -> list[dict[str, np.ndarray]]:
    """Rows of some trials, all that a batch would ask for asked for."""
    rows, place = [], world(task)
    for trial in trials:
        proposal = learner.propose(trial)
        run = learner.task.execute
        both = [
            run(place, part, trial=trial, seeds=[0, 1]) if part else None
            for part in (proposal.tried, proposal.best)
        ]
        rows.append(learner.observe(trial, *both) | driven(learner, both[0]))
    return rows


def driven(learner, tried) -> dict[str, np.ndarray]:
    """What a task measures of trials, as columns that no learner has."""
    found = learner.task.measured(tried)
    return {f"world.{name}": np.asarray(value) for name, value in found.items()}


def differ(row, other) -> bool:
    """Whether two rows differ in anything; unknown numbers do not."""
    return any(
        not np.array_equal(value, other[column], equal_nan=True)
        for column, value in row.items()
    )


def test_seeds_differ_in_what_is_tried_where_columns_are_alike(monkeypatch):
    class Steady(registry.get("random")):
        columns: ClassVar = {"step": "size"}

        def observe(self, trial, tried, best):
            return {"step": np.ones(self.runs)}

    monkeypatch.setattr(registry, "_registered", {"steady": Steady})
    config = small("steady", "navigation")
    one, again, other = (
        advance(made(replace(config, seed=seed), "navigation"), "navigation", range(1))
        for seed in (0, 0, 1)
    )
    assert not differ(one[-1], again[-1])
    assert differ(one[-1], other[-1])


@pytest.mark.parametrize(("name", "task"), KNOWN)
class TestEveryLearnerOnEveryTask:
    def test_the_same_seed_gives_the_same_and_another_one_another(self, name, task):
        first, again = (
            advance(made(small(name, task), task), task, range(2)) for _ in range(2)
        )
        other = replace(small(name, task), seed=1)
        differing = advance(made(other, task), task, range(2))
        for column, value in first[-1].items():
            np.testing.assert_array_equal(value, again[-1][column])
        assert differ(first[-1], differing[-1])

    def test_restored_it_goes_on_to_the_same_bytes(self, name, task):
        whole, cut = made(small(name, task), task), made(small(name, task), task)
        wanted = advance(whole, task, range(4))[2:]
        advance(cut, task, range(2))
        kept = {key: value.copy() for key, value in cut.state().items()}
        assert all(
            isinstance(array, np.ndarray) and not array.dtype.hasobject
            for array in kept.values()
        )
        again = made(small(name, task), task)
        again.restore(kept)
        for one, other in zip(wanted, advance(again, task, range(2, 4)), strict=True):
            for column, value in one.items():
                np.testing.assert_array_equal(value, other[column])
        for key, array in whole.state().items():
            assert array.tobytes() == again.state()[key].tobytes(), key

    def test_it_is_told_nothing_of_damage_and_truth(self, name, task, monkeypatch):
        kind, heard = registry.get(name), []
        observe = kind.observe

        def listen(self, trial, tried, best):
            heard.extend([*tried, *(best or ())])
            return observe(self, trial, tried, best)

        monkeypatch.setattr(kind, "observe", listen)
        config = small(name, task)
        batch = Batch([config], [Telling(world(task))], models=make_models(config))
        batch.advance(0)
        batch.advance(1)
        assert len(heard) >= 4
        assert not any(trial.conditions or trial.truth for trial in heard)

    def test_columns_and_figures_are_as_declared_and_stored(self, name, task, tmp_path):
        config, kind = small(name, task), registry.get(name)
        record = train(config, tmp_path / "run", world=world(task))
        declared = {*GIVEN["columns"], *kind.columns, *tasks.of(config).columns}
        assert declared <= set(record.columns)
        for column in ("fitness", "fitness_best", "solved"):
            assert np.isfinite(record[column]).all()
        shown = [f for f in kind.figures if isinstance(f, Curves)]
        assert {p.column for f in shown for p in f.panels} <= set(record.columns)
        read = store.load(tmp_path / "run")
        assert read.config == config
        for column, values in record.columns.items():
            np.testing.assert_array_equal(values, read[column])

    def test_a_report_and_a_recording_can_be_made(self, name, task, tmp_path):
        from bns.viz import recording, report

        record = train(small(name, task), world=world(task))
        page = report.write(record, tmp_path / "r.html").read_text()
        assert page.count("<figcaption>") >= 4
        assert recording.write(record, {}, tmp_path / "r.rrd").stat().st_size > 1000

    def test_its_configuration_is_read_back(self, name, task):
        config = small(name, task)
        assert from_mapping(to_mapping(config)) == replace(config, preset=config.preset)


class Telling:
    """A world whose trials say more than a learner may know."""

    def __init__(self, inner):
        self.inner, self.name, self.robot = inner, inner.name, inner.robot

    def run(self, commands, **settings):
        return self._told(self.inner.run(commands, **settings))

    def drive(self, policy, **settings):
        return self._told(self.inner.drive(policy, **settings))

    def _told(self, trials):
        secret = {"conditions": {"damage": ["x"]}, "truth": {"qpos": np.zeros(3)}}
        return [trial.replace(**secret) for trial in trials]


@pytest.mark.parametrize("name", LEARNERS)
def test_says_what_it_is_and_what_its_settings_may_be(name):
    assert len(registry.describe(name)) > 20
    kind = registry.get(name)
    assert issubclass(kind.Settings, LearnerSettings)
    usual = kind.Settings()
    for setting, (low, high, _) in kind.Settings.bounds.items():
        assert low <= getattr(usual, setting) <= high


@pytest.mark.parametrize("task", PRESETS)
def test_what_a_run_of_bns_resets_moves_no_draw_of_the_others(task):
    config = replace(small("bns", task), evolve_from=0)
    resets = replace(config, adaptation=AdaptationConfig(restart=True))
    told = {"replicates": [0, 1], "onsets": [0, 0]}
    sound, mine = (
        registry.get("bns")([config, side], **told) for side in (config, resets)
    )
    for trial in range(3):
        sound.propose(trial)
        mine.propose(trial)
    one, other = (made.population.genes.numpy() for made in (sound, mine))
    half = len(one) // 2
    np.testing.assert_array_equal(one[:half], other[:half])
    assert not np.array_equal(one[half:], other[half:])


class TestRefused:
    def test_an_unknown_learner(self):
        with pytest.raises(UnknownNameError, match="learner"):
            train(replace(small("bns", "navigation"), learner="bsn"))

    @pytest.mark.parametrize(
        "name", [name for name in LEARNERS if registry.get(name).needs_model]
    )
    def test_no_model_where_one_is_needed(self, name):
        task = next(task for learner, task in KNOWN if learner == name)
        config = small(name, task).with_({"prior.world": ""})
        with pytest.raises(BnsError, match=r"give --prior\.world"):
            made(config, task)

    @pytest.mark.parametrize(
        ("name", "task"), [o for o in product(LEARNERS, PRESETS) if o not in KNOWN]
    )
    def test_a_task_that_it_does_not_know(self, name, task):
        with pytest.raises(BnsError, match="take another learner"):
            made(small(name, task), task)

    def test_a_task_in_the_place_of_a_learner(self):
        with pytest.raises(BnsError, match=r"give --task\.name"):
            registry.get("simple")

    def test_settings_of_another_learner(self):
        config = small("random", "navigation")
        with pytest.raises(BnsError, match="belongs to the learner 'bns'"):
            config.with_({"snn.epochs": 3})
        with pytest.raises(UnknownNameError, match=r"settings\.sigma"):
            config.with_({"settings.sigma": 0.1})

    def test_a_number_out_of_its_bounds(self):
        with pytest.raises(BnsError, match=r"settings\.sigma"):
            small("cma", "navigation").with_({"settings.sigma": -1.0})


@pytest.mark.parametrize(("task", "name"), [("walk", "walk"), ("light", "light")])
def test_configurations_of_version_0_1_are_read(task, name):
    old = to_mapping(presets.load(PRESETS[task]))
    old["learner"], old["task"]["name"] = name, "simple"
    assert from_mapping(old) == presets.load(PRESETS[task])
    assert from_mapping({"learner": "navigation"}).learner == "bns"


def test_cma_does_better_than_random_search_where_it_may_think():
    """Floor and ceiling: with a model of the robot, and without anything."""
    config = small("cma", "walk").with_({"settings.population": 10})
    model = CountedWorld(Slider(), 600)
    told = {"replicates": [0], "onsets": [-1]}
    one = registry.get("cma")([config], **told, models=[model])
    tried = one.propose(0).tried
    ceiling = one.task.fitness(Slider().run(tried))
    assert model.spent == 600
    floor = registry.get("random")([small("random", "walk")], **told)
    seen = [floor.task.fitness(Slider().run(floor.propose(t).tried)) for t in range(99)]
    assert ceiling[0] < 2 * np.min(seen) < 0  # twice the square of the distance


@pytest.mark.parametrize("name", adaptations.names())
class TestEveryAdaptation:
    def test_says_what_it_is(self, name):
        assert len(adaptations.describe(name)) > 20

    def test_resets_known_parts_and_is_deterministic(self, name):
        extra = adaptations.parse(name)
        seen = [extra.resets(t, onset) for t in range(60) for onset in (-1, 30)]
        again = [extra.resets(t, onset) for t in range(60) for onset in (-1, 30)]
        assert seen == again
        assert any(seen)
        assert all(part in adaptations.PARTS for parts in seen for part in parts)

    def test_acts_on_its_own_run_only(self, name):
        config = RunConfig()
        mine = replace(config, adaptation=AdaptationConfig(extra=(name,)))
        made = Adaptations([mine, config], [30, 30])
        resets = [made.resets(trial) for trial in range(60)]
        parts = [(r.population, r.simulator, r.data) for r in resets]
        assert any(part[0] for three in parts for part in three)
        assert not any(part[1] for three in parts for part in three)

    def test_unknown_parameter_is_refused(self, name):
        with pytest.raises(UnknownNameError, match=f"parameter of {name}"):
            adaptations.parse(f"{name}:nonsense=1")


def test_population_reset_every():
    extra = adaptations.parse("population_reset_every:trials=7")
    assert [t for t in range(22) if extra.resets(t, -1)] == [7, 14, 21]


def test_bad_text_is_refused():
    with pytest.raises(UnknownNameError, match="Unknown adaptation"):
        adaptations.parse("population_reset_evry")
    with pytest.raises(BnsError, match="positive number"):
        adaptations.parse("population_reset_every:trials=nan")
