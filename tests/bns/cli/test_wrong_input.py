"""What a command refuses, and that nothing of the user's is replaced."""

import pytest

from bns.__main__ import WRONG_INPUT, main

WRONG = {
    "no such effect": (["effects", "wheel_gian"], "Did you mean 'wheel_gain'?\n"),
    "no such stage": (["effects", "--stage", "wheel"], "value of --stage 'wheel'."),
    "no such verb": (["rum"], "Unknown command 'rum'. Did you mean 'run'?\n"),
    "nothing to run": (["run"], "Nothing to run: give a preset (demo, "),
    "device": (
        ["run", "demo", "--device", "warp"],
        "device = 'warp' is not available here: give cpu",
    ),
    "option first": (["run", "--trials", "3"], "comes too early: give a preset"),
    "preset": (["run", "khepera-simpel"], "Did you mean 'khepera-simple'?"),
    "file": (["run", "no.toml"], "There is no file no.toml"),
    "option": (
        ["run", "demo", "--evolution.populatoin", "3"],
        "Unknown option --evolution.populatoin. Did you mean --evolution.population?\n",
    ),
    "flag": (["run", "demo", "--resum"], "--resum. Did you mean --resume?\n"),
    "choice": (
        ["run", "demo", "--evolution.selection", "x"],
        "Unknown value of --evolution.selection 'x'. Available: best, random, roulette",
    ),
    "type": (["run", "demo", "--trials", "abc"], "--trials abc: give a whole number."),
    "bound": (
        ["run", "demo", "--task.radius", "5"],
        "task.radius = 5.0 m is not allowed: give a number from 0.005 to 0.5 m",
    ),
    "nan": (["run", "demo", "--task.radius", "nan"], "task.radius = nan m is not"),
    "world": (["run", "demo", "--world.name", "mujco"], "Did you mean 'mujoco'?"),
    "robot": (["run", "demo", "--world.robot", "khepera"], "Did you mean 'khepera3'?"),
    "effect": (["run", "demo", "--world.damage", "weel_gain"], "mean 'wheel_gain'?"),
    "parameter": (
        ["run", "demo", "--world.damage", "wheel_gain:factr=0.8"],
        "Unknown parameter of wheel_gain 'factr'. Did you mean 'factor'?",
    ),
    "effect's bound": (
        ["run", "demo", "--world.reality", "wheel_gain:factor=9"],
        "wheel_gain:factor = 9",
    ),
    "damage's grammar": (
        ["run", "demo", "--world.damage", "wheel_gain@soon"],
        "cannot be read: write NAME",
    ),
    "no ensemble": (
        ["run", "demo", "--choose", "disagreement", "--out", "new"],
        "set snn.kind = 'ensemble'",
    ),
    "no lamps": (
        ["run", "khepera-light", "--world.name", "static-snn", "--out", "new"],
        "which 'static-snn' has not: give --world.name light.",
    ),
    "no legs": (
        ["run", "hexapod-walk", "--world.name", "mujoco", "--out", "new"],
        "'phantomx' is legged, this world is for wheeled ones",
    ),
    "foreign directory": (["run", "demo", "--out", "."], "not empty and holds no run"),
    "no directory": (["report", "nowhere"], "nowhere is not a run directory"),
    "nothing to report": (["report"], "No run was given"),
    "one to compare": (["compare", "run"], "1 run was given: give two or more"),
    "none to compare": (["compare"], "0 runs were given"),
    "no recording": (["view", "no.rrd"], "There is no recording no.rrd"),
    "nothing to view": (["view"], "Missing: DIRECTORY. See `bns view --help`."),
    "an argument too many": (["worlds", "mujoco"], "'mujoco' is one argument too many"),
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
    "a large bound": (["run", "demo", "--trials", "0"], "from 1 to 1000000."),
    "seed": (
        ["repertoire", "make", "x", "--evaluations", "9", "--seed", "-1"],
        "--seed = -1 is not allowed: give a number from 0 to ",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line_and_changes_nothing(
    said, run, monkeypatch, tmp_path, case
):
    argv, message = WRONG[case]
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    text = said(*argv, code=WRONG_INPUT)
    assert message in text
    assert text.startswith("bns: ") and text.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


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
    from bns.viz import pictures

    recording = tmp_path / "a.rrd"
    recording.touch()
    with pytest.raises(BnsError, match=r"ends in \.png|Cannot write .*: No such"):
        pictures.write_png(recording, tmp_path / name)


def test_a_preset_runs_without_options(monkeypatch):
    from bns.cli import run

    given = []
    monkeypatch.setattr(run, "execute", lambda asked: given.append(asked) or 0)
    assert main(["run", "demo"]) == 0
    assert given[0].config.preset == "demo" and given[0].out == "runs/demo"


def test_a_share_has_no_unit(said, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert "duty -1 to 1 " in said("robots") and "1 1" not in said("robots")
