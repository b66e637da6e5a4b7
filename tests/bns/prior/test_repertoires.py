"""Repertoires, their grid, gaits and Gaussian process against answers known before."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError, FormatError, UnknownNameError
from bns.models.phantomx import gait
from bns.prior import gaussian, maker, repertoire
from bns.prior.archive import Archive
from bns.storage import arrays
from bns.tasks import registry as tasks
from bns.tasks import walk
from bns.worlds import registry as worlds
from bns.worlds.trial import Commands
from tests.bns.robots import Slider

WALK = replace(presets.load("hexapod-walk"), threads=1)
PLAN = maker.Plan(config=WALK, behaviour="told", step=0.0)


def made(generations: int = 1) -> maker.Maker:
    found = maker.Maker(PLAN, Slider())
    for _ in range(generations):
        found.advance()
    return found


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("repertoire") / "r.npz"
    made(2).write(path, "bns repertoire make r --evaluations 128")
    return path


class TestGrid:
    def test_each_cell_keeps_its_best_and_no_other_is_touched(self):
        grid = Archive(1, 1, bins=2)
        first = grid.add(
            np.array([[0.1], [0.2], [0.3]]),
            np.array([[0.1], [0.4], [0.9]]),
            np.array([1.0, 2.0, 3.0]),
        )
        assert first.tolist() == [True, True, True]
        assert grid.worth.tolist() == [2.0, 3.0] and grid.quality == 5.0
        kept = grid.add(
            np.array([[0.7], [0.8]]), np.full((2, 1), 0.6), np.array([2, 4])
        )
        assert kept.tolist() == [False, True]
        assert grid.genes.ravel().tolist() == [0.2, 0.8]
        assert grid.worth.tolist() == [2.0, 4.0]

    def test_what_is_not_finite_is_left_out(self):
        grid = Archive(1, 1, bins=2)
        grid.add(np.zeros((2, 1)), np.array([[np.nan], [0.5]]), np.array([1.0, np.inf]))
        assert len(grid) == 0

    def test_the_edge_of_a_behaviour_is_in_the_last_cell(self):
        assert Archive(1, 2, bins=5).cells(
            np.array([[1.0, 0.0], [0.0, 1.0]])
        ).tolist() == [4, 20]

    def test_elites_that_share_a_cell_are_no_grid(self):
        grid = Archive(1, 1, bins=2)
        held = {
            "genes": np.zeros((2, 1)),
            "behaviours": np.zeros((2, 1)),
            "worth": np.ones(2),
        }
        with pytest.raises(FormatError, match="no grid"):
            grid.restore(held)


class TestProcess:
    def test_one_observation_is_the_textbook_formula(self):
        far = np.sqrt(5) * 0.3 / 0.4
        like = (1 + far + far**2 / 3) * np.exp(-far)
        mean, spread = gaussian.posterior(
            np.zeros((1, 2)),
            np.array([2.0]),
            np.array([[0.3, 0.0]]),
            reach=0.4,
            noise=0.1,
        )
        assert mean[0] == pytest.approx(like * 2.0 / 1.1)
        assert spread[0] == pytest.approx(np.sqrt(1 - like**2 / 1.1))

    def test_it_passes_through_what_is_seen_and_knows_nothing_far_away(self):
        known = np.random.default_rng(0).uniform(size=(6, 3))
        values = np.arange(6.0)
        mean, spread = gaussian.posterior(
            known,
            values,
            np.vstack([known, np.full((1, 3), 99.0)]),
            reach=0.4,
            noise=1e-9,
        )
        np.testing.assert_allclose(mean[:6], values, atol=1e-5)
        assert spread[:6].max() < 1e-3
        assert mean[6] == pytest.approx(0.0, abs=1e-9) and spread[6] == pytest.approx(
            1.0
        )


class TestGaits:
    def test_a_duty_cycle_of_one_holds_still_and_of_a_half_goes_to_and_fro(self):
        genes = np.zeros((1, 6, 2, 3))
        genes[0, 0, 0] = (1.0, 0.0, 1.0)  # coxa of leg 1 always forward
        genes[0, 1, 1] = (0.5, 0.1, 0.5)  # femur of leg 2, between the edges
        found = walk.goals(genes.reshape(1, 36), 8).reshape(8, 6, 3)
        np.testing.assert_allclose(found[:, 0, 0], 0.6)
        np.testing.assert_allclose(found[:4, 1, 1], [0.3, 0.3, -0.3, -0.3])
        np.testing.assert_allclose(found[:4], found[4:])  # four commands a period
        np.testing.assert_allclose(found[:, 1, 2], -found[:, 1, 1])

    def test_a_leg_that_is_told_up_is_not_down(self):
        genes = np.zeros((1, 6, 2, 3))
        genes[0, 2, 1] = (1.0, 0.0, 1.0)
        task = tasks.of(WALK)
        (controller,) = task.genotypes["gait"].controllers(genes.reshape(1, 36))
        (trial,) = Slider().run([controller])
        assert task.behaviour([trial]).tolist() == [[1, 1, 0, 1, 1, 1]]


@pytest.fixture(scope="module")
def hexapod():
    return worlds.make("hexapod", threads=1, truth=True, step=0.008)


class TestContact:
    def test_standing_feet_are_down_and_a_raised_one_is_up(self, hexapod):
        still = Commands(np.zeros((3, 18)), np.full(3, 1.0), hexapod._channels)
        raised = worlds.make(
            "hexapod", threads=1, truth=True, damage="leg_raised:legs=5,blend=1"
        )
        trials = [*hexapod.run([still]), *raised.run([still])]
        found = maker.duty(trials)
        assert found[0].tolist() == [1.0] * 6
        assert found[1][4] < 0.35  # until it has been raised
        assert found[1][[0, 1, 2, 3, 5]].min() > 0.9

    def test_without_the_hidden_states_it_says_so(self):
        (trial,) = Slider().run([made().space.controllers(np.zeros((1, 36)))[0]])
        with pytest.raises(BnsError, match="--behaviour told"):
            maker.duty([trial])


def test_steps_twice_as_long_walk_as_far(hexapod):
    tripod = Commands(gait.tripod(), np.full(11, 2.0), hexapod._channels)
    exact = worlds.make("hexapod", threads=1).run([tripod])[0]
    ways = [
        np.hypot(*trial.poses_world[-1, :2])
        for trial in (exact, *hexapod.run([tripod]))
    ]
    assert hexapod.dt == 0.008
    assert ways[1] == pytest.approx(ways[0], rel=0.02) and ways[1] != ways[0]


class TestMaking:
    def test_stopped_and_resumed_it_is_the_same_file(self, tmp_path):
        whole, cut = tmp_path / "whole.npz", tmp_path / "cut.npz"
        say = {"evaluations": 20 * maker.BATCH, "command": "c"}
        maker.make(made(0), whole, **say)
        asked = iter([False] * 10 + [True])
        assert not maker.make(made(0), cut, **say, stop=lambda: next(asked))
        head = repertoire.read(cut).head
        assert head.evaluations == head.growth[-1][0] == 11 * maker.BATCH
        again = made(0)
        again.restore(repertoire.read(cut))
        assert maker.make(again, cut, **say)
        assert cut.read_bytes() == whole.read_bytes()

    def test_it_gets_better_with_what_is_spent(self, tmp_path):
        grown = made(48)
        rows = np.array(grown.growth)
        assert len(rows) == 3 and (np.diff(rows, axis=0) > 0)[:, [0, 1, 3]].all()

    def test_what_is_read_does_in_the_model_what_it_says(self, file):
        found = repertoire.read(file)
        task = tasks.of(WALK)
        tried = found.space(task).controllers(found.vectors(task))
        trials = Slider().run(tried)
        np.testing.assert_allclose(task.worth(trials), found.worth, rtol=1e-5)
        np.testing.assert_allclose(task.behaviour(trials), found.behaviours, atol=1e-6)

    def test_a_budget_of_nothing(self, tmp_path):
        with pytest.raises(BnsError, match="holds nothing"):
            maker.make(made(0), tmp_path / "r.npz", evaluations=0, command="c")
        assert not (tmp_path / "r.npz").exists()

    def test_to_go_on_otherwise_is_refused(self, file):
        other = maker.Maker(replace(PLAN, seed=2), Slider())
        with pytest.raises(BnsError, match="made with seed = 1, not 2"):
            other.restore(repertoire.read(file))

    @pytest.mark.parametrize("what", [{"genotype": "gaits"}, {"behaviour": "feet"}])
    def test_an_unknown_name(self, what):
        with pytest.raises(UnknownNameError, match=r"Did you mean|Available"):
            maker.Maker(replace(PLAN, **what), Slider())


class TestRefused:
    def test_one_changed_byte(self, file, tmp_path):
        held = arrays.read_npz(file)
        held["worth"][0] += 1e-6
        arrays.write_npz(tmp_path / "r.npz", held, compressed=True)
        with pytest.raises(FormatError, match=r"damaged.*bns repertoire make r"):
            repertoire.read(tmp_path / "r.npz")

    def test_a_file_that_is_none(self, tmp_path):
        arrays.write_npz(tmp_path / "r.npz", {"genes": np.zeros(3)})
        with pytest.raises(FormatError, match="no repertoire"):
            repertoire.read(tmp_path / "r.npz")
        (tmp_path / "t.npz").write_bytes(b"PK")
        with pytest.raises(FormatError, match="cannot be read"):
            repertoire.read(tmp_path / "t.npz")

    def test_a_name_that_none_has(self):
        with pytest.raises(UnknownNameError, match="repertoire"):
            repertoire.read("phantomx-99")

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ({"world.robot": "quad"}, "is of 'phantomx', not of 'quad'"),
            ({"walk.reach": 0.5}, r"made with walk.reach = 0.6, not 0.5"),
            ({"task.name": "simple", "world.robot": "khepera3"}, "of the task 'walk'"),
        ],
    )
    def test_another_robot_task_or_controllers(self, file, change, said):
        with pytest.raises(BnsError, match=said):
            repertoire.check(repertoire.read(file), WALK.with_(change))

    def test_another_model_of_the_robot(self, file, monkeypatch):
        found = repertoire.read(file)
        assert repertoire.check(found, WALK) is found
        monkeypatch.setattr(repertoire.robots, "digest", lambda name: "0" * 16)
        with pytest.raises(BnsError, match="another model of 'phantomx'"):
            repertoire.check(found, WALK)


@pytest.mark.parametrize("name", repertoire.names())
def test_those_that_ship_are_of_the_robots_here_and_small(name):
    found = repertoire.read(name)
    assert repertoire.path(name).stat().st_size <= 1_000_000
    preset = {"walk": "hexapod-walk"}[found.head.task]
    repertoire.check(found, presets.load(preset))
    assert found.head.growth[-1][1] <= len(found)
    assert len(found) <= found.head.evaluations


def test_several_processes_at_the_same_places_are_each_as_alone():
    rng = np.random.default_rng(0)
    known, wanted, values = rng.random((9, 3)), rng.random((5, 3)), rng.random((9, 2))
    rule = {"reach": 0.5, "noise": 0.02, "kernel": gaussian.exponential}
    mean, spread = gaussian.posterior(known, values, wanted, **rule)
    for column in range(2):
        alone, same = gaussian.posterior(known, values[:, column], wanted, **rule)
        np.testing.assert_allclose(mean[:, column], alone)
        np.testing.assert_array_equal(spread, same)
    none, one = gaussian.posterior(known[:0], values[:0], wanted, **rule)
    assert none.shape == (5, 2) and (one == 1).all()


def test_the_exponential_kernel_is_the_textbook_formula():
    found = gaussian.exponential(np.zeros((1, 2)), np.array([[0.3, 0.4]]), 0.5)
    assert found[0, 0] == pytest.approx(np.exp(-0.5))
    with pytest.raises(np.linalg.LinAlgError):  # the same place twice, and no noise
        twice = np.zeros((2, 1))
        gaussian.posterior(twice, np.ones(2), twice, reach=1.0, noise=-1e-3)
