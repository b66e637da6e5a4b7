"""Findings on claims that come with the package, and the page made of them."""

import pytest

from bns.claims import page, published, report, sides, verdict
from bns.claims.claim import claims, find
from bns.stats import Interval
from tests.sources import ROOT

WORLDS = ("mujoco", "static-snn")


def without_runs(*, own):
    """All claims in both worlds, without runs of one's own."""
    every = list(claims().values())
    return {
        world: report.judged(every, ROOT / "none", world=world, own=own)
        for world in WORLDS
    }


def test_the_page_has_every_claim_and_is_the_committed_one():
    empty = page.page(without_runs(own=True))
    for claim in claims().values():
        assert f"| {claim.id} | {claim.where} |" in empty
    text = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
    written = page.page(without_runs(own=False))
    assert written == text, "bns claims table --write docs/claims.md"
    assert "reversed" in text and "{rule}" not in text


def test_published_findings_are_of_comparisons_and_settings_that_there_are():
    found = report.publishable(without_runs(own=False))
    assert found == list(published.rows().values())


def test_what_was_published_of_other_settings_does_not_count():
    claim = find("A15")
    cell = claim.cells[0]
    names = [sides.member("A", s, world="mujoco").identity for s in cell.sides]
    kept = published.finding(claim, cell, names, world="mujoco")
    assert kept.published and kept.runs == (30, 30) and kept.verdict == "holds"
    for other in (names[::-1], [names[0], "0" * 12]):
        assert published.finding(claim, cell, other, world="mujoco") is None
    assert published.finding(claim, cell, names, world="elsewhere") is None


@pytest.mark.parametrize("fewer", [True, False])
def test_as_many_runs_of_ones_own_replace_what_is_published(monkeypatch, fewer):
    claim = find("B16")
    kept = [
        row["runs"][0] for row in published.rows().values() if row["claim"] == "B16"
    ]
    runs = min(kept) - fewer

    def finding(cell, have):
        return verdict.finding(cell, (runs, runs), 0.01, Interval(0.7, 0.6, 0.8))

    monkeypatch.setattr(report, "_finding", finding)
    (row,) = report.judged([claim], ROOT / "none", world="mujoco", own=False)
    assert [found.published for found in row.findings] == [fewer] * 2
    (row,) = report.judged([claim], ROOT / "none", world="mujoco")
    assert [found.runs for found in row.findings] == [(runs, runs)] * 2
