"""`bns campaign`, `claims`, `repertoire`, `standings`, with right and wrong input."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bns.__main__ import WRONG_INPUT
from bns.campaign.engines import registry as engines
from bns.campaign.file import Member
from bns.cli.campaign import FAILED
from bns.prior import repertoire
from bns.standings import design, figures, run
from bns.worlds import registry as worlds
from tests.bns.robots import Slider

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


def test_a_campaign_that_ends_before_its_damage(said, tiny):
    """There is no measure from the damage on, and it is said why and what to do."""
    tiny.write_text(TINY.replace("@1", "@9").partition("[grid]")[0])
    said("campaign", "run", tiny, "--out", "out", "--engine", "inline")
    table = ("campaign", "table", "out")
    told = said(*table, code=WRONG_INPUT)
    assert "damage comes at trial 9, counted from 0, and runs have 3" in told
    assert "Give --measure solve" in told
    assert "trials until solved" in said(*table, "--measure", "solve")
    drawn = said("campaign", "plot", "out")
    assert "curves.png" in drawn and "No sensitivity.png: no setting has two" in drawn


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


@pytest.fixture
def slider(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    worlds.register("slider", _slider)
    yield tmp_path
    del worlds._registered["slider"]


def _slider(**settings):
    """A robot on six sliding legs."""
    return Slider()


def test_made_shown_and_made_larger(slider, said):
    told = ["--preset", "walk.toml", "--behaviour", "told", "--step", "0"]
    (slider / "walk.toml").write_text(
        'preset = "hexapod-walk"\n[world]\nname = "slider"\n'
    )
    said("repertoire", "make", "mine", "--evaluations", "100", *told)
    found = repertoire.read("mine.npz")
    assert found.head.evaluations == 128  # whole generations
    assert "--evaluations 100" in found.head.command
    text = said("repertoire", "show", "mine.npz")
    assert "walk of phantomx in the world slider" in text and "as here" in text
    words = ("repertoire", "make", "mine", "--evaluations", "100", *told)
    assert "already" in said(*words, code=2)
    said("repertoire", "make", "mine", "--evaluations", "1100", *told, "--resume")
    head = json.loads(said("repertoire", "show", "mine.npz", "--json"))
    assert [row[0] for row in head["growth"]] == [1024, 1152]


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        (["make", "x", "--evaluations", "0"], "holds nothing"),
        (["make", "x", "--evaluations", "9", "--genotype", "gaits"], "Did you mean"),
        (["make", "x", "--evaluations", "9", "--preset", "walk"], "preset"),
        (["show", "nothing"], "Unknown repertoire"),
        (["shwo"], "Did you mean 'show'"),
    ],
)
def test_repertoires_refused(slider, said, words, wrong):
    assert wrong in said("repertoire", *words, code=2)


def test_a_damaged_repertoire(slider, said):
    (slider / "x.npz").write_bytes(b"no archive")
    assert "cannot be read" in said("repertoire", "show", "x.npz", code=2)


def test_plan_prints_hours_and_runs_nothing(slider, said):
    words = ["--tasks", "walk", "--kinds", "inside", "--runs", "3"]
    text = said("standings", "plan", "ite", "random", *words)
    assert "processor hours in all" in text and "P2" in text
    assert not list(slider.iterdir())
    assert "no standings yet" in said("standings", "table", *words, code=2)


def small(entries):
    """Cells on the slider: damage from trial 3, four trials after it."""
    found = []
    for entry in entries:
        world = replace(
            entry.member.config.world,
            name="slider",
            damage=(entry.member.config.world.damage[0].rpartition("@")[0] + "@3",),
        )
        config = replace(entry.member.config, world=world, trials=7)
        found.append(replace(entry, member=Member(entry.member.label, config)))
    return found


def test_run_once_it_says_the_same_as_alone_and_never_runs_again(slider):
    wanted = design.Wanted(
        tasks=("walk",), rivals=("random",), damages=("type0", "type1"), runs=2
    )
    cells = small(design.entries(wanted))
    told = {"runs": 2, "root": slider / "s", "progress": False}
    engine = engines.make("inline", workers=1, ray_address="")
    session = run.run(cells, engine, **told)
    assert session.done == 3 and not session.failed  # the trunk, and two sides
    found = figures.read(cells, slider / "s")
    assert [cell.deployed.shape for cell in found] == [(2, 4)] * 2
    np.testing.assert_array_equal(
        found[0].deployed, found[1].deployed
    )  # no damage here
    assert run.run(cells, engine, **told).done == 0
    alone = run.run(cells[:1], engine, **told | {"root": slider / "t"})
    assert alone.done == 1
    (one,) = figures.read(cells[:1], slider / "t")
    np.testing.assert_array_equal(one.deployed, found[0].deployed)


def test_a_picture_of_the_standings(slider):
    from bns.viz import standings

    wanted = design.Wanted(
        tasks=("walk",), rivals=("random",), damages=("type0",), runs=2
    )
    cells = small(design.entries(wanted))
    engine = engines.make("inline", workers=1, ray_address="")
    run.run(cells, engine, runs=2, root=slider / "s", progress=False)
    (path,) = standings.write(figures.read(cells, slider / "s"), slider / "out")
    assert path.name == "standings-walk.png" and path.stat().st_size > 5000
