"""Claims as data, the rule of verdicts, and what runs say of them."""

import csv
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from bench import experiments
from bns import presets, stats
from bns.campaign.engines.inline import InlineEngine
from bns.campaign.identity import identity
from bns.campaign.part import Block
from bns.claims import measures, report, runner, sides, verdict
from bns.claims.claim import Cell, claims, content, find
from bns.errors import BnsError
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.run import train
from bns.stats import Interval
from tests.sources import ROOT

CELLS = [(claim, cell) for claim in claims().values() for cell in claim.cells]


def test_there_are_157_claims():
    count = Counter(claim.investigation for claim in claims().values())
    assert count == {"A": 28, "B": 53, "C": 41, "D": 35}
    assert Counter(c.kind for c in claims().values())["R"] == 20
    assert [*claims()] == [f"{i}{n}" for i in "ABCD" for n in range(1, count[i] + 1)]


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_a_claim_is_tested_or_says_why_not(claim):
    assert bool(claim.cells) != bool(claim.untested)
    assert claim.kind in ("S", "N") or claim.reading or claim.untested
    for cell in claim.cells:
        assert cell.says in (">", "<", "=", "?")
        assert bool(cell.b) == (cell.at_most is None and cell.at_least is None)
        for name in (cell.measure, cell.measure_b or cell.measure):
            assert measures.measure(name).doc
        for side in cell.sides:
            assert set(side.split()) <= set(content(claim.investigation)["pieces"])


def test_p_values_are_those_of_the_tables():
    with open(ROOT / "bench" / "p_values.csv") as file:
        printed = Counter(row["p"] for row in csv.DictReader(file))
    assert sum(printed.values()) == 178
    used = Counter(cell.p for _, cell in CELLS if cell.p[0].isdigit())
    assert not used - printed
    assert sum(used.values()) == 163  # 15 cells of the tables belong to no claim


def test_the_sides_of_a15_are_those_of_the_benches():
    for window in (0, 150, 300):
        piece = f" window-{window}" if window else ""
        given = {"window": window} if window else {}
        ours = sides.member("A", f"left-20{piece}", world="mujoco").identity
        assert ours == identity(experiments.damaged("left-20", **given))
    ours = sides.member("A", "undamaged-infinity", world="mujoco").identity
    assert ours == identity(experiments.undamaged("infinity"))


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_every_side_can_run_in_the_physics_and_a_in_the_static_world_too(claim):
    letter = claim.investigation
    if content(letter)["preset"] not in presets.names():
        pytest.skip(f"no preset {content(letter)['preset']}")
    for cell in claim.cells:
        assert sides.missing(letter, cell, world="mujoco") == "", cell.text
        if letter == "A":
            assert sides.missing(letter, cell, world="static-snn") == "", cell.text


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_two_sides_of_a_comparison_differ(claim):
    if content(claim.investigation)["preset"] not in presets.names():
        pytest.skip(f"no preset {content(claim.investigation)['preset']}")
    for cell in claim.cells:
        if cell.b and not cell.measure_b:
            names = {
                sides.member(claim.investigation, side, world="mujoco").identity
                for side in cell.sides
            }
            assert len(names) == 2, cell.text


@pytest.mark.parametrize(
    ("p", "runs"),
    [("0.00000", 30), ("0.00100", 100), ("0.05543", 100), ("0.06001", 30),
     ("0.44161", 30), ("<0.05", 100), ("<0.0005", 30), ("n.s.", 30), ("-", 30)],
)  # fmt: skip
def test_runs_that_the_rule_asks_for(p, runs):
    assert verdict.runs_wanted(Cell(a="x", b="y", p=p)) == runs


@pytest.mark.parametrize(
    ("says", "share", "p", "said"),
    [
        (">", (0.7, 0.6, 0.8), 0.01, "holds"),
        (">", (0.6, 0.4, 0.8), 0.20, "direction only"),
        (">", (0.4, 0.2, 0.6), 0.20, "null"),
        (">", (0.5, 0.4, 0.6), 1.00, "null"),
        (">", (0.3, 0.2, 0.4), 0.01, "reversed"),
        ("<", (0.3, 0.2, 0.4), 0.01, "holds"),
        ("<", (0.7, 0.6, 0.8), 0.01, "reversed"),
        ("=", (0.5, 0.4, 0.6), 0.90, "holds"),
        ("=", (0.5, 0.3, 0.7), 0.90, "null"),
        ("=", (0.6, 0.51, 0.64), 0.04, "reversed"),
        ("?", (0.3, 0.2, 0.4), 0.01, "holds"),
        ("?", (0.3, 0.2, 0.6), 0.10, "null"),
    ],
)
def test_the_rule(says, share, p, said):
    assert verdict.verdict(says, Interval(*share), p) == said


def record(cost, *, onset=2, solved=None):
    """Runs with the given costs, ``(R, T)``."""
    cost = np.array(cost, dtype=float)
    columns = {
        "fitness_best": cost,
        "solved": np.zeros_like(cost) if solved is None else np.array(solved, float),
        "snn_forward": cost / 100,
        "diversity_41": cost[:, ::-1].copy(),
    }
    config = RunConfig(replicates=len(cost), trials=cost.shape[1])
    return Block("x", config, 0, onset, columns).record()


def test_a_claim_has_the_least_favourable_verdict_of_its_kind():
    worse, better = np.full((30, 4), 9.0), np.full((30, 4), 1.0)
    worse += np.arange(30)[:, None] * 1e-3
    better += np.arange(30)[:, None] * 1e-3
    won = verdict.judge(Cell(a="x", b="y"), record(better), record(worse))
    lost = verdict.judge(Cell(a="x", b="y", says="="), record(better), record(worse))
    assert (won.verdict, lost.verdict) == ("holds", "reversed")
    assert won.share.value == 1.0 and won.p < 1e-9 and won.runs == (30, 30)
    assert verdict.of_claim("S", [won, lost]) == "holds"
    assert verdict.of_claim("N", [won, lost]) == "reversed"
    assert verdict.of_claim("Q", [won, lost]) == "reversed"
    assert verdict.of_claim("N", [won]) == "holds"


def test_more_of_what_is_neither_good_nor_bad():
    low, high = record(np.full((5, 4), 1.0)), record(np.full((5, 4), 3.0))
    more = verdict.judge(Cell(a="x", b="y", measure="diversity41-end"), high, low)
    assert more.share.value == 1.0
    less = verdict.judge(Cell(a="x", b="y", measure="end"), high, low)
    assert less.share.value == 0.0


def test_a_side_against_a_number():
    solved = np.zeros((30, 6))
    solved[:24, 3] = 1  # 24 of 30 recover within 2 trials from the damage in trial 2
    runs = record(np.ones((30, 6)), solved=solved)
    found = verdict.judge(Cell(a="x", measure="recover", at_most=2), runs, None)
    assert found.share.value == 0.8 and found.verdict == "holds"
    assert found.p == pytest.approx(0.0014, abs=1e-4)  # binomial, 24 of 30
    never = verdict.judge(Cell(a="x", measure="recover", at_least=3), runs, None)
    assert never.share.value == pytest.approx(0.2)
    assert never.verdict == "reversed"


def test_measures_by_hand():
    cost = [[1, 2, 30, 4, 5, 6], [1, 1, 10, 10, 10, 10]]
    runs = record(cost)
    assert measures.of(runs, "before").tolist() == [3, 2]
    assert measures.of(runs, "before-10").tolist() == [1.5, 1]
    assert measures.of(runs, "after").tolist() == [11.25, 10]
    assert measures.of(runs, "next").tolist() == [4, 10]
    assert measures.of(runs, "end").tolist() == [8, 7]
    assert measures.of(runs, "snn-first").tolist() == [0.01, 0.01]
    assert measures.of(runs, "diversity41-next").tolist() == [30, 10]
    assert measures.of(runs, "observation").tolist() == [45, 40]
    whole = record(cost, onset=-1)
    assert len(measures.of(whole, "after")) == 0
    with pytest.raises(BnsError, match="diversity_73"):
        measures.of(runs, "diversity73-end")


def test_the_onset_of_improvement_is_where_a_fifth_is_made_up():
    calm, high = [10.0] * 10, [100.0] * 20
    falling = list(np.linspace(100, 10, 10))
    runs = record([calm + high + falling, calm + high + [100.0] * 10], onset=10)
    # smoothed over five trials, 82 or less for the first time from trial 30 on
    assert measures.of(runs, "onset-of-improvement").tolist() == [30.0, np.inf]


@pytest.fixture
def tiny(monkeypatch):
    """Quick runs that take no time."""

    def shrunk(config):
        damage = tuple(t.replace("@30", "@2") for t in config.world.damage)
        return replace(
            config,
            trials=4,
            compiled="no",
            evolution=replace(config.evolution, population=8, generations=1),
            snn=replace(config.snn, epochs=2),
            world=replace(config.world, damage=damage),
        )

    monkeypatch.setattr(sides, "shrunk", shrunk)
    monkeypatch.setattr(runner, "QUICK_RUNS", 2)


def test_claims_run_once_and_are_judged(tiny, tmp_path):
    place = runner.directory("mujoco", quick=True, root=tmp_path)

    def run():
        sessions = runner.run(
            [find("A8")], InlineEngine(), quick=True, root=tmp_path, progress=False
        )
        return sum(session.done for session in sessions)

    assert run() > 0
    assert run() == 0
    chosen = [find(name) for name in ("A8", "B2", "B1")]
    rows = report.judged(chosen, place, world="mujoco", quick=True)
    assert [finding.runs for finding in rows[0].findings] == [(2, 2)]
    assert rows[0].provisional and rows[0].verdict in verdict.ORDER
    assert [row.verdict for row in rows][1:] == ["not run", "not tested"]
    assert rows[1].note == "no runs yet"
    none = report.judged(chosen, tmp_path / "none", world="static-snn")
    assert [row.note for row in none][:2] == [
        "no runs yet",
        "no world like 'static-snn' for this task",
    ]


def test_finished_runs_are_taken(tmp_path, monkeypatch):
    config = RunConfig(
        trials=3,
        replicates=2,
        record_replicates=0,
        compiled="no",
        threads=1,
        evolution=replace(RunConfig().evolution, population=8, generations=1),
        snn=replace(RunConfig().snn, epochs=2),
        world=WorldConfig(damage=("wheel_gain:wheel=left,factor=0.8@1",)),
    )
    made = train(config, tmp_path / "runs" / "one")
    monkeypatch.setattr(
        sides,
        "member",
        lambda *words, **named: sides.Member("x", config),
    )
    place = {"world": "mujoco", "root": tmp_path}
    assert runner.take([find("A8")], [tmp_path / "runs"], **place) == ["one"]
    assert runner.take([find("A8")], [tmp_path / "runs"], **place) == []
    folder = runner.directory("mujoco", quick=False, root=tmp_path)
    (row,) = report.judged([find("A8")], folder, world="mujoco")
    assert row.findings[0].runs == (2, 2)
    assert row.findings[0].share.value == 0.5  # a run against itself
    assert np.isfinite(stats.observation_after(made)).all()
    with pytest.raises(BnsError, match="no folder"):
        runner.take([find("A8")], [tmp_path / "none"], **place)


def test_a_side_that_needs_what_does_not_exist_says_so():
    cell = Cell(a="left-20 no-such-piece")
    assert "Unknown piece of A" in sides.missing("A", cell, world="mujoco")


def test_quick_sides_are_short():
    whole = sides.member("A", "left-20-at-40", world="mujoco").config
    short = sides.member("A", "left-20-at-40", world="mujoco", quick=True).config
    assert (whole.trials, short.trials) == (100, 20)
    assert short.world.damage == ("wheel_gain:wheel=left,factor=0.8@8",)
