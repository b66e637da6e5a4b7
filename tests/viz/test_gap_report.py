"""Report and recording of a diagnosis: they say what was found, in one file each."""

import re
from dataclasses import replace

import numpy as np
import pytest

from bns.__main__ import main
from bns.gap import store
from bns.gap.bench.wheeled_cases import commands
from bns.gap.candidates import wheeled_rows
from bns.gap.recordings import load_recordings
from bns.viz.gap import report, scene
from bns.viz.gap.figures import view
from bns.worlds import corrected
from bns.worlds.data import dataset
from bns.worlds.physics.wheeled_world import MujocoWorld
from tests.viz.test_recording import columns

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"
GAIN = "wheel_gain:wheel=left,factor=0.85"

KEPT = ("axle_length", "motor_lag[both]", "wheel_gain[left]", "wheel_gain[both]")


def recorded(path, *effects):
    world = MujocoWorld(reality=[*effects, NOISE], threads=1)
    told = commands(np.random.default_rng(3), 4)
    return dataset.write(path, world.run(told, seeds=range(4)))


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A diagnosis made on the command line, with everything it writes."""
    here = tmp_path_factory.mktemp("gap")
    recorded(here / "data", GAIN)
    words = ["gap", "diagnose", str(here / "data"), "--out", str(here / "out")]
    every = wheeled_rows.rows

    def few(trials):
        return tuple(r for r in every(trials) if r.name in KEPT or r.nuisance)

    with pytest.MonkeyPatch.context() as patch:  # few rows take less time
        patch.setattr(wheeled_rows, "rows", few)
        assert main([*words, "--threads", "1"]) == 0
    return here


def test_the_diagnosis_names_the_effect_and_where_it_comes_from(home):
    found = store.load(home / "out")
    assert found.verdict.named == (("wheel_gain[left]",),)
    assert found.provenance["data"] == [str(home / "data")]
    assert found.provenance["model"] == "khepera3"


def test_the_report_answers_the_questions_in_one_file(home):
    page = (home / "out" / "report.html").read_text()
    for said in (
        "One effect: wheel_gain[left]",
        "Where is it?",
        "of it in left wheel",
        "How large is it?",
        "What explains it?",
        "What is left?",
        "What the gap is made of",
        "What to do next",
        "bns gap diagnose",
    ):
        assert said in page, said
    assert "-0 %" not in page
    assert page.count("data:image/svg+xml;base64,") == 2 * 5  # wide and narrow
    assert not re.findall(r'(?:src|href)="(?!data:)', page)


def test_the_command_in_the_report_takes_the_same_trials(home):
    found = store.load(home / "out")
    asked = replace(found, provenance={**found.provenance, "trials": "1-2"})
    assert "--trials 1-2" in report._command(asked)
    assert "--trials" not in report._command(found)


def test_all_that_is_written_in_figures_can_be_read(home, tmp_path, illegible):
    found, trials = store.load(home / "out"), dataset.read(home / "data").trials
    model = load_recordings.model(found.model)
    report.write(found, trials, model, tmp_path / "report.html")
    assert illegible == [], "\n".join(illegible)


def test_the_recording_shows_three_robots(home):
    from rerun.chunk import RrdReader

    chunks = RrdReader(str(home / "out" / "recording.rrd")).stream()
    paths = {str(chunk.entity_path) for chunk in chunks}
    assert {
        "/world/recorded/khepera3",
        "/world/nominal/khepera3",
        "/world/corrected/khepera3",
        "/world/paths/arrows",
        "/residuals/turn/corrected",
    } <= paths


def test_the_trial_that_is_drawn_is_the_worst_of_those_that_count(home):
    found, trials = store.load(home / "out"), dataset.read(home / "data").trials
    robot = load_recordings.model(found.model)
    first = view(found, trials, robot).shown
    told = {**found.decomposition, "left_out": [first]}
    assert view(replace(found, decomposition=told), trials, robot).shown != first


def test_enlarged_robots_stand_where_they_were(home):
    found, trials = store.load(home / "out"), dataset.read(home / "data").trials
    seen = view(found, trials, load_recordings.model(found.model))
    stage = scene.Stage(seen, range(len(trials)))
    file = home / "out" / "recording.rrd"
    (scale,) = columns(file, "/world/corrected")["Transform3D:scale"]
    assert np.allclose(scale, stage.times) and stage.times >= 1
    places = columns(file, "/world/corrected/khepera3")["Transform3D:translation"]
    places = stage.times * np.array([row[0][:2] for row in places])
    for path in seen.corrected:
        end = path[-1, :2] + stage.lane("corrected")[:2]
        assert np.hypot(*(places - end).T).min() < 1e-5


def test_a_robot_that_drove_far_is_enlarged_and_one_that_did_not_is_not(home):
    found, trials = store.load(home / "out"), dataset.read(home / "data").trials
    seen = view(found, trials, load_recordings.model(found.model))
    drawn = [
        scene.Stage(replace(seen, corrected=[factor * p for p in seen.corrected]), [0])
        for factor in (0.1, 100.0)
    ]
    assert [stage.times for stage in drawn] == [1, scene.LARGEST]


def test_without_the_effect_the_edited_model_is_right(home, capsys):
    recorded(home / "plain")
    words = ["gap", "edit", str(home / "out"), "--predict", str(home / "plain")]
    assert main([*words, "--remove", "wheel_gain"]) == 0
    said = capsys.readouterr().out
    assert "stays right" in said and "edited" in said
    assert main([*words, "--remove", "payload"]) == 2
    assert "wheel_gain[left]" in capsys.readouterr().err


def test_the_corrected_world_is_kept_and_nothing_is_left_to_plan(
    home, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv(corrected.VARIABLE, str(tmp_path / "worlds.toml"))
    assert main(["gap", "apply", str(home / "out"), "--world", "kitchen"]) == 0
    (text,) = corrected.known()["kitchen"].reality
    assert text.startswith("wheel_gain:wheel=left,factor=0.84") or "0.85" in text
    assert main(["gap", "apply", str(home / "out"), "--world", "mujoco"]) == 2
    assert main(["gap", "plan", str(home / "out")]) == 0
    assert "Nothing is tied" in capsys.readouterr().out
