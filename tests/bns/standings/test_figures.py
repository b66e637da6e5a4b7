"""The standings: their cells, what runs say, and the page, on answers known before."""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError, UnknownNameError
from bns.experiment.batch import check_world
from bns.prior import mismatch, repertoire
from bns.standings import design, figures, page
from bns.standings.design import Wanted
from bns.standings.figures import Cell
from bns.standings.run import hours, jobs

WALK = Wanted(tasks=("walk",), kinds=("inside",), runs=4)


class TestCells:
    @pytest.mark.parametrize("task", design.DESIGNS)
    def test_each_is_a_configuration_that_can_run(self, task):
        found = design.entries(Wanted(tasks=(task,)))
        for entry in found:
            check_world(entry.member.config)
        assert len({entry.member.identity for entry in found}) == len(found)

    def test_with_a_prior_the_damage_comes_sooner_and_trials_after_it_are_alike(self):
        for entry in design.entries(WALK):
            config = entry.member.config
            onset = int(config.world.damage[0].rpartition("@")[2])
            assert onset == (100 if entry.prior == "P0" else 10)
            assert config.trials - onset == 50
            assert bool(config.world.reality) == (entry.prior == "P2")
            prior = config.prior.world or config.prior.repertoire
            assert bool(prior) == (entry.prior in ("P1", "P2"))
            assert config.walk.nominal == (entry.prior == "PG")
            assert not config.prior.reality  # the model is nominal

    def test_any_learner_takes_part_by_its_name(self, monkeypatch):
        monkeypatch.delitem(design.RIVALS, "random")
        found = design.entries(replace(WALK, rivals=("random",), priors=("P0",)))
        assert {entry.member.config.learner for entry in found} == {"random"}

    @pytest.mark.parametrize(
        ("wanted", "said"),
        [
            ({"tasks": ("wlk",)}, "Did you mean 'walk'"),
            ({"rivals": ("nobody",)}, "Unknown rival"),
            ({"priors": ("P3",)}, "Unknown prior"),
            ({"damages": ("type99",)}, "Unknown damage"),
            ({"damages": ("axle",)}, "Nothing is left"),
            ({"runs": 0}, "nothing to run"),
        ],
    )
    def test_what_cannot_be_is_refused(self, wanted, said):
        with pytest.raises((UnknownNameError, BnsError), match=said):
            design.entries(replace(WALK, **wanted))


class TestPlan:
    def test_the_trials_before_the_damage_count_once(self):
        one, two = (
            hours(design.entries(replace(WALK, rivals=("random",), damages=names)), 10)
            for names in (("type0",), ("type0", "type1"))
        )
        first, both = one["walk", "random", "P0"], two["walk", "random", "P0"]
        assert both - first == pytest.approx(first / 3)  # 50 trials more than 150

    def test_sides_of_a_trunk_have_its_seed_and_what_is_done_is_not_run(self, tmp_path):
        cells = design.entries(replace(WALK, rivals=("random",)))
        made = jobs(cells, 4, {}, tmp_path)
        assert [job.grows for job in made] == [True] + [False] * 8
        assert (
            len({job.seed for job in made}) == 1 and len({j.trunk for j in made}) == 1
        )
        done = {cells[0].member.identity: 4}
        assert len(jobs(cells, 4, done, tmp_path)) == 8


def cells(rival, values, damage="type0", tried=None, prior="P0"):
    """A cell whose runs deploy some distances, the same in all trials of a run."""
    part = replace(WALK, rivals=(rival,), damages=(damage,), priors=(prior,))
    (entry,) = design.entries(part)
    far = np.asarray(values, float)
    return Cell(entry, far, far if tried is None else tried, 1.0, 2.0,
                np.zeros(len(far)), np.zeros(len(far)))  # fmt: skip


class TestFigures:
    def test_trials_to_a_bar_are_counted_from_the_damage(self):
        cell = cells("random", [[0.5, 1.0, 0.2], [0.1, 0.2, 0.3], [2.0, 0, 0]])
        assert cell.waits(1.0).tolist() == [2.0, np.inf, 1.0]
        assert np.isnan(cell.waits(np.nan)).all()

    def test_a_row_has_the_share_of_the_ceiling_and_who_never_got_there(self):
        found = figures.row("random", [cells("random", [[0.5, 1.5], [0.0, 0.0]])])
        assert found.deployed == pytest.approx(0.25)  # mean 0.5 of 2 m
        middle, never, runs = found.waits["50% of the ceiling"]
        assert (never, runs) == (1, 2) and np.isinf(middle.value)

    def test_metres_are_never_averaged_with_shares_of_a_ceiling(self):
        far = np.full((2, 5), 1.0)
        known, metres = cells("random", far), cells("random", far, damage="weak")
        metres = replace(metres, ceiling=np.nan)
        assert figures.row("random", [known, metres]).deployed == pytest.approx(0.5)
        assert np.isnan(figures.row("random", [metres]).deployed)
        assert figures.measure("walk", "outside") == "distance [m]"
        assert figures.measure("navigate", "inside") == "share solved"

    def test_wins_are_those_that_chance_does_not_explain(self):
        rng = np.random.default_rng(0)
        low, high = (base + rng.uniform(0, 0.1, (12, 5)) for base in (0.2, 1.0))
        (match,) = figures.matches([cells("random", low), cells("cma", high)])
        assert (match.won, match.tied, match.lost) == (0, 0, 1)
        assert match.better == 0.0
        (match,) = figures.matches([cells("random", low), cells("cma", low)])
        assert (match.won, match.tied, match.lost) == (0, 1, 0)
        assert match.better == 0.5

    def test_three_runs_are_too_few_to_win(self):
        low, high = np.full((3, 5), 0.2), np.full((3, 5), 1.0)
        (match,) = figures.matches([cells("random", low), cells("cma", high)])
        assert match.tied == 1 and match.better == 0.0

    def test_runs_that_are_all_alike_are_one_run(self):
        low, high = np.full((30, 5), 0.2), np.full((30, 5), 1.0)
        (match,) = figures.matches([cells("random", low), cells("cma", high)])
        assert match.tied == 1 and match.better == 0.0
        assert figures.row("random", [cells("random", low)]).runs == (30, 1, 1)


def test_the_page_says_n_and_what_was_not_run():
    held = [cells("random", np.full((3, 50), 0.2)), cells("cma", np.full((3, 50), 1.5))]
    text = page.page(held)
    assert "3 x 1, 1 that differ" in text and "not run: type1, type3" in text
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    assert lines[2].startswith("| cma") and lines[3].startswith("| random")
    assert "never [-, never], 3 of 3" in lines[3]
    assert text.count("images/standings-walk.png") == 1
    assert "Nothing has been run" in page.page([])


def test_the_page_keeps_what_it_says_of_other_tasks():
    walked = page.page([cells("random", np.full((3, 50), 0.2))])
    other = walked.replace("walk", "navigate").replace("random", "somebody")
    both = page.page([cells("cma", np.full((3, 50), 0.4))], other)
    assert "| somebody" in both and "| cma" in both and "| random" not in both
    assert both.index("| cma") < both.index("| somebody") < both.index("## How")
    assert page.page([cells("random", np.full((3, 50), 0.2))], walked) == walked
    assert page.page([], walked) == walked


def test_the_page_says_what_a_repertoire_could_do(monkeypatch):
    walked = [cells("ite", np.full((3, 50), 0.2), prior="P1")]
    text = page.page(walked)
    assert "Repertoire `phantomx-1`" in text and "0.98 m in the undamaged model" in text
    assert "less than the 1.00 m of the task" in text
    ships = repertoire.read("phantomx-1")
    able = replace(ships, worth=ships.worth * 2)
    monkeypatch.setattr(page.repertoire, "read", lambda name: able)
    assert "less than" not in page.page(walked)


class TestGap:
    def test_it_is_fixed_by_its_seed_and_grows_with_its_size(self):
        one, again = (mismatch.drawn(1, 0.5) for _ in range(2))
        assert one == again != mismatch.drawn(2, 0.5)
        assert mismatch.drawn(1, 0.0) == ()
        with pytest.raises(UnknownNameError, match="fixed gap"):
            mismatch.reality("khepera3")

    def test_a_hexapod_can_have_it(self):
        config = design.entries(replace(WALK, rivals=("ite",), priors=("P2",)))[0]
        check_world(config.member.config)
        assert len(mismatch.reality("phantomx")) == 8
