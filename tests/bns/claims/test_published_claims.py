"""Findings on claims that come with the package, and the page made of them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.claims import page, provenance, published, report, verdict
from bns.claims.claim import _whole, claims, content, digest_of, find, settings_of
from bns.claims.provenance import Batch, Made
from bns.claims.published import Stale
from bns.errors import FormatError
from bns.experiment.config import RunConfig
from bns.experiment.versions import REVISION
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


def test_published_findings_are_of_comparisons_that_there_are():
    known = {(c.id, cell.text) for c in claims().values() for cell in c.cells}
    for world, claim, text in published.library().rows:
        assert world in WORLDS and (claim, text) in known, (claim, text)


CLAIM = find("A15")
CELL = CLAIM.cells[0]


def a_library(**changed):
    """One finding of today's settings, with parts of its row changed."""
    found = made_finding()
    row = published.row(CLAIM, found, world="mujoco") | changed
    known = {
        digest_of("A", side, "mujoco"): settings_of("A", side, "mujoco")
        for side in CELL.sides
    }
    return published.parse(published.text([row], known), "test")


def made_finding():
    """A finding with its provenance."""
    low = np.arange(10) / 7
    found = verdict.examine(CELL, low + 9, low, verdict.design(CELL))
    digests = tuple(digest_of("A", side, "mujoco") for side in CELL.sides)
    made = Made(
        sides=digests,
        revision=REVISION,
        commits=("abc",),
        dates=("2026-11-23",),
        seeds=(1, 2),
        versions={"torch": "2"},
        seconds=12.5,
    )
    return replace(found, made=made)


def test_a_finding_comes_back_whole_and_unrounded():
    kept = published.finding(CLAIM, CELL, world="mujoco", among=a_library())
    assert kept == replace(made_finding(), published=True)
    assert published.finding(CLAIM, CELL, world="elsewhere", among=a_library()) is None


def test_a_finding_of_other_code_is_stale():
    found = a_library(revision=REVISION - 1)
    kept = published.finding(CLAIM, CELL, world="mujoco", among=found)
    assert isinstance(kept, Stale) and "revision" in kept.why


def test_a_finding_of_before_settings_were_kept_is_stale():
    row = {"world": "mujoco", "claim": "A15", "cell": CELL.text, "sides": ["a", "b"]}
    row |= {"runs": [30, 30], "p": 0.01, "share": [0.8, 0.7, 0.9]}
    old = published.parse(json.dumps([row]), "old")
    kept = published.finding(CLAIM, CELL, world="mujoco", among=old)
    assert kept == Stale(CELL.text, (30, 30), 0.8, 0.01, published.NO_SETTINGS)
    (judged,) = report.judged(
        [CLAIM], ROOT / "none", world="mujoco", own=False, among=old
    )
    assert (judged.verdict, judged.findings) == ("stale", ())
    assert not judged.complete and judged.note == published.NO_SETTINGS


def test_a_changed_default_makes_a_finding_stale_and_is_named(monkeypatch):
    found = a_library()
    changed = replace(
        RunConfig().evolution, generations=RunConfig().evolution.generations + 1
    )
    plain = presets.load
    monkeypatch.setattr(
        presets, "load", lambda name: replace(plain(name), evolution=changed)
    )
    for cached in (_whole, settings_of, digest_of):
        cached.cache_clear()
    try:
        kept = published.finding(CLAIM, CELL, world="mujoco", among=found)
    finally:
        for cached in (_whole, settings_of, digest_of):
            cached.cache_clear()
    assert isinstance(kept, Stale)
    assert kept.why.endswith("evolution.generations was 60, is 61")


def test_a_digest_is_of_names_and_values_and_of_nothing_else():
    settings = settings_of("A", "left-20", "mujoco")
    shuffled = dict(sorted(settings.items(), reverse=True))
    assert provenance.of(shuffled) == provenance.of(settings)
    assert settings["evolution.generations"] == 60 and "seed" not in settings
    assert not any(key.startswith(("light.", "walk.")) for key in settings)
    other = {**settings, "adaptation.window": 7}
    assert provenance.of(other) != provenance.of(settings)
    for letter in "ABCD":
        for piece in content(letter)["pieces"].values():
            assert not set(piece) & set(content(letter)["ignored"])


def test_runs_come_back_with_what_is_missing_and_what_is_never():
    facts = {"revision": REVISION, "seed": 5, "commit": "abc", "versions": {}}
    found = {"recover": np.array([3.0, np.inf]), "end": np.array([np.nan, 0.1])}
    batch = Batch(0, 2, facts, "2026-11-25", 1.5, found.__getitem__)
    line = published.line("d1", batch, ["end", "recover"])
    assert line["values"] == {"end": [None, 0.1], "recover": [3.0, "never"]}
    kept = published.parse(published.text([], {}, [line]), "x")
    (back,) = kept.batches("d1", ["recover"])
    assert np.array_equal(back.values("recover"), found["recover"])
    assert np.array_equal(back.values("end"), found["end"], equal_nan=True)
    assert kept.batches("d1", ["solve"]) == []  # asked since: not known of these runs
    old = published.text([], {}, [line | {"revision": REVISION - 1}])
    assert published.parse(old, "x").batches("d1", ["end"]) == []
    with pytest.raises(FormatError, match="3 values"):
        published.parse(published.text([], {}, [line | {"count": 3}]), "x")


def test_a_newer_file_and_a_damaged_one_are_refused():
    with pytest.raises(FormatError, match="newer"):
        published.parse(json.dumps({"schema": 99}), "x.json")
    for text in ("{", "{}", "[1]"):
        with pytest.raises(FormatError, match=r"x\.json"):
            published.parse(text, "x.json")


@pytest.mark.parametrize("runs", [(10, True), (50, False), (20, False)])
def test_runs_of_ones_own_replace_what_is_published_if_they_say_more(monkeypatch, runs):
    mine, stopped = runs
    kept = a_library(runs=[30, 30], stopped=False)
    found = replace(made_finding(), runs=(mine, mine), stopped=stopped)
    monkeypatch.setattr(report._Judge, "_mine", lambda self, claim, cell: found)
    (row,) = report.judged(
        [CLAIM], ROOT / "none", world="mujoco", own=False, among=kept
    )
    assert row.findings[0].published == (mine == 20)
