"""`bns campaign` and `bns claims`, driven with right and wrong input."""

import json

import pytest

from bns.__main__ import WRONG_INPUT
from bns.cli.campaign import FAILED

TINY = """
replicates = 2
[settings]
trials = 3
compiled = "no"
evolution.population = 8
evolution.generations = 1
snn.epochs = 2
world.damage = ["wheel_gain:wheel=left,factor=0.8@1"]
[grid]
adaptation.window = [0, 20]
"""


@pytest.fixture
def tiny(tmp_path, monkeypatch):
    """A campaign file; the present directory is empty but for it."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def test_a_campaign_from_file_to_pictures(said, tiny, tmp_path):
    out = tmp_path / "out"
    run = ("campaign", "run", tiny, "--out", out, "--engine", "inline")
    assert "1 batches done, 0 failed" in said(*run)
    assert "4 of 4 runs are done" in said("campaign", "status", out)
    status = json.loads(said("campaign", "status", out, "--json"))
    assert [row["runs"] for row in status["members"]] == [2, 2]
    table = said("campaign", "table", out)
    assert "window=20" in table and "A12" in table and "power" in table
    both = json.loads(said("campaign", "table", out, "--json"))
    assert len(both["members"]) == 2 and len(both["pairs"]) == 1
    drawn = said("campaign", "plot", out)
    for name in ("curves.png", "sensitivity.png"):
        assert name in drawn
        assert (out / name).read_bytes().startswith(b"\x89PNG")
    assert "add --resume" in said(*run, code=WRONG_INPUT)
    again = said("campaign", "run", out, "--resume", "--engine", "inline")
    assert "0 batches done" in again


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[grid]\nadaptation.windo = [1]", "Did you mean 'adaptation.window'"),
        ("[grid]\nadaptation.window = []", "nothing to run"),
        ("trials = 3", "Unknown key of a campaign file 'trials'"),
        ("[grid]\nworld.damage = ['wheel_gian:factor=1']", "Did you mean 'wheel_gain'"),
        ("[grid]\nworld.name = ['mujocco']", "Did you mean 'mujoco'"),
        ("[sample]\ncount = 900000\nsnn.epochs = [1, 2]", "add --yes"),
        ("replicates = [", "cannot be read as TOML"),
    ],
)
def test_a_wrong_file_is_one_line(said, tiny, text, words):
    tiny.write_text(text)
    message = said("campaign", "run", tiny, "--out", "x", code=WRONG_INPUT)
    assert words in message and message.count("\n") == 1
    assert not (tiny.parent / "x").exists()


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["campaign", "rum"], "Did you mean 'run'"),
        (["campaign", "run", "none.toml"], "no campaign file"),
        (["campaign", "status", "."], "not a campaign directory"),
        (["campaign", "table", "nowhere"], "not a campaign directory"),
        (["campaign", "merge", "nowhere"], "No directory was given"),
        (["campaign", "merge", "nowhere", "."], "not a campaign directory"),
        (["campaign", "run", "tiny.toml", "--ray-address", "a:1"], "--engine ray"),
        (
            ["campaign", "run", "tiny.toml", "--engine", "ray", "--ray-address", "x"],
            "HOST:PORT",
        ),
        (["claims", "run"], "or --all"),
        (["claims", "run", "A15", "--all"], "or --all"),
        (["claims", "run", "A199"], "Unknown claim"),
        (["claims", "table", "E"], "a letter alone"),
        (["claims", "run", "A15", "--runs", "-1"], "--runs"),
        (["claims", "take"], "folders"),
        (["claims", "take", "nowhere"], "no folder"),
        (["claims", "table", "A1", "--write", "x.md"], "leave ids"),
        (["claims", "tabel"], "Did you mean 'table'"),
    ],
)
def test_wrong_words_are_one_line(said, tiny, argv, words):
    message = said(*argv, code=WRONG_INPUT)
    assert words in message and message.count("\n") == 1


def test_ray_that_cannot_be_used_leaves_nothing_behind(said, tiny, monkeypatch):
    import sys

    go = ("campaign", "run", tiny, "--out", "out", "--engine", "ray")
    nobody = said(*go, "--ray-address", "127.0.0.1:9", code=WRONG_INPUT)
    assert "Nobody answers at 127.0.0.1:9" in nobody
    monkeypatch.setitem(sys.modules, "ray", None)
    missing = said(*go, code=WRONG_INPUT)
    assert "pip install 'bns-testbed[ray]'" in missing
    assert not (tiny.parent / "out").exists()


def test_what_failed_is_said_and_tried_again(said, tiny, monkeypatch):
    from bns.campaign import work

    whole = work.run

    def run(job, beat):
        raise RuntimeError("no such luck")

    monkeypatch.setattr(work, "run", run)
    go = ("campaign", "run", tiny, "--out", "out", "--engine", "inline")
    text = said(*go, code=FAILED)
    assert "RuntimeError: no such luck" in text and "--retry" in text
    assert "no such luck" in said("campaign", "status", "out")
    empty = said("campaign", "table", "out", code=WRONG_INPUT)
    assert "nothing on 'observation' yet" in empty
    monkeypatch.setattr(work, "run", whole)
    said(*go, "--resume", code=FAILED)
    assert "1 batches done" in said(*go, "--resume", "--retry")


def test_claims_are_listed_and_judged_without_runs(said, tiny):
    rows = json.loads(said("claims", "list", "--json"))
    assert len(rows) == 157
    assert "p 0.05543" in " ".join(said("claims", "list", "a15").split())
    text = said("claims", "table", "A15", "B6")
    assert "stale" in text and "not tested" in text
    rows = json.loads(said("claims", "list", "--json", "A3", "c", "A3"))
    assert [row["id"] for row in rows] == ["A3"] + [f"C{n}" for n in range(1, 42)]
    assert "not run" in said("claims", "table", "A15", "--own")
    said("claims", "table", "--write", "claims.md", "--publish", "all.json")
    assert (tiny.parent / "claims.md").read_text().startswith("# Claims")
    kept = json.loads((tiny.parent / "all.json").read_text())
    assert len(kept["findings"]) > 100
