"""Claims run in a store, taken from finished runs, and gone on from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from bns import stats
from bns.campaign.engines.registry import InlineEngine
from bns.campaign.file import Member
from bns.claims import published, report, runner, verdict
from bns.claims.claim import find
from bns.errors import BnsError
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.run import train


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

    monkeypatch.setattr("bns.claims.claim.shrunk", shrunk)
    monkeypatch.setattr(runner, "QUICK_RUNS", 2)


def test_claims_run_once_and_are_judged(tiny, tmp_path):
    place = runner.directory("mujoco", quick=True, root=tmp_path)

    def run():
        return runner.run(
            [find("A8")], InlineEngine(), quick=True, root=tmp_path, progress=False
        ).done

    assert run() > 0
    assert run() == 0
    chosen = [find(name) for name in ("A8", "B2", "B6")]
    rows = report.judged(chosen, place, world="mujoco", quick=True)
    assert [finding.runs for finding in rows[0].findings] == [(2, 2)]
    assert rows[0].provisional and rows[0].verdict in verdict.ORDER
    assert [row.verdict for row in rows][1:] == ["not run", "not tested"]
    assert rows[1].note == "no runs yet"
    made = rows[0].findings[0].made
    assert made.commits == ("test",) and len(made.seeds) == 1  # of a shared trunk
    assert made.dates and made.seconds > 0 and made.versions["torch"]
    none = report.judged(chosen, tmp_path / "none", world="static-snn")
    assert [row.note for row in none][:2] == [
        "no runs yet",
        "no world like 'static-snn' for this task",
    ]


def small_config():
    """Two runs of three trials, damaged in the second."""
    return RunConfig(
        trials=3,
        replicates=2,
        record_replicates=0,
        compiled="no",
        threads=1,
        evolution=replace(RunConfig().evolution, population=8, generations=1),
        snn=replace(RunConfig().snn, epochs=2),
        world=WorldConfig(damage=("wheel_gain:wheel=left,factor=0.8@1",)),
    )


def test_finished_runs_are_taken(tmp_path, monkeypatch):
    config = small_config()
    made = train(config, tmp_path / "runs" / "one")
    for user in ("claim", "report", "schedule"):
        monkeypatch.setattr(
            f"bns.claims.{user}.member_of",
            lambda *words, **named: Member("A: x", config),
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


def test_published_runs_are_gone_on_from_elsewhere(tmp_path, monkeypatch):
    """The same finding as of a store that was never left, and nothing run twice."""

    def whole(investigation, side, world):
        gone = {"left-20": 0.8, "left-20 population-reset": 0.7}.get(side, 0.6)
        world = WorldConfig(damage=(f"wheel_gain:wheel=left,factor={gone}@1",))
        return replace(small_config(), world=world), {}

    monkeypatch.setattr("bns.claims.claim._whole", whole)
    report.asked.cache_clear()

    def run(root, runs):
        root, asked = tmp_path / root, {"runs": runs, "own": False}
        done = runner.run(
            [find("A8")], InlineEngine(), root=root, progress=False, **asked
        ).done
        place = runner.directory("mujoco", quick=False, root=root)
        (row,) = report.judged([find("A8")], place, world="mujoco", **asked)
        return done, row.findings[0], place

    empty = published.parse(published.text([], {}), "none")
    monkeypatch.setattr(published, "library", lambda: empty)
    _, _, place = run("here", 2)
    written = published.text([], {}, report.runs({"mujoco": place}))
    more, stayed, _ = run("here", 4)
    monkeypatch.setattr(published, "library", lambda: published.parse(written, "x"))
    there, moved, place = run("there", 4)
    assert there == more == 3  # a trunk, and what each side has after it
    assert moved == replace(stayed, made=moved.made) and moved.runs == (4, 4)
    assert moved.made.seeds == stayed.made.seeds
    again = [(line["start"], line["count"]) for line in report.runs({"mujoco": place})]
    assert again == [(0, 2), (2, 2)] * 2
    report.asked.cache_clear()
