"""`bns repertoire` and `bns standings`, driven with right and wrong input."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bns.campaign.engines import registry as engines
from bns.campaign.file import Member
from bns.prior import repertoire
from bns.standings import design, figures, run
from bns.worlds import registry as worlds
from tests.bns.robots import Slider


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
