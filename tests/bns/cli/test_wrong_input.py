"""What a command refuses, and that nothing of the user's is replaced."""

import pytest

from bns.__main__ import WRONG_INPUT, main

REFUSED = {
    "a film that is none": (["view", ".", "--gif", "a.txt"], "that ends in .gif"),
    "one example": (
        ["examples", "02_damage_it", "--copy", "to"],
        "--copy takes all examples, not '02_damage_it' alone",
    ),
    "no such place": (["examples", "--copy", "/proc/to"], "Cannot write /proc/to: No"),
    "frames of a table": (
        ["export", ".", "--to", "parquet", "--fps", "9"],
        "--fps and --task are for --to lerobot",
    ),
    "a schema as a directory": (["schema", "--out", "."], "is there and is no file"),
    "nothing alike": (["nosuch"], "Unknown command 'nosuch'. Available: campaign, "),
    "a large bound": (["run", "demo", "--trials", "0"], "from 1 to 1000000 trials"),
    "seed": (
        ["repertoire", "make", "x", "--evaluations", "9", "--seed", "-1"],
        "--seed = -1 is not allowed: give a number from 0 to ",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_it_is_one_line_and_nothing_is_written(said, monkeypatch, tmp_path, case):
    words, message = REFUSED[case]
    monkeypatch.chdir(tmp_path)
    assert message in said(*words, code=WRONG_INPUT)
    assert not any(tmp_path.iterdir())


def test_a_report_never_replaces_what_is_no_page(said, run):
    config = run / "config.toml"
    before = config.read_text()
    text = said("report", run, "--out", config, "--force", code=WRONG_INPUT)
    assert "give an --out that ends in .html" in text and config.read_text() == before


def test_a_schema_replaces_schemas_alone(said, tmp_path):
    notes, schema = tmp_path / "notes.txt", tmp_path / "run.schema.json"
    notes.write_text("mine")
    text = said("schema", "run", "--out", notes, code=WRONG_INPUT)
    assert "is not overwritten" in text and notes.read_text() == "mine"
    for _ in range(2):
        said("schema", "run", "--out", schema)


@pytest.mark.parametrize("name", ["a.gif", "missing/a.png"])
def test_a_picture_that_cannot_be_is_told_before_it_is_drawn(tmp_path, name):
    from bns.errors import BnsError
    from bns.viz import picture

    recording = tmp_path / "a.rrd"
    recording.touch()
    with pytest.raises(BnsError, match=r"ends in \.png|Cannot write .*: No such"):
        picture.save(recording, tmp_path / name)


def test_a_preset_runs_without_options(monkeypatch):
    from bns.cli import run

    given = []
    monkeypatch.setattr(run, "execute", lambda asked: given.append(asked) or 0)
    assert main(["run", "demo"]) == 0
    assert given[0].config.preset == "demo" and given[0].out == "runs/demo"


def test_a_share_has_no_unit(said, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert "duty -1 to 1 " in said("robots") and "1 1" not in said("robots")
