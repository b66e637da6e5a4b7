"""Recordings: verified by Rerun's own tool, read back, and drawn; seen live; films.

A live view that fails is said once and does not stop the run. Legs of a walking robot
are drawn as its servos reported them.
"""

import logging
import socket
import subprocess
import time

import numpy as np
import pytest

from bns import models
from bns.__main__ import main
from bns.errors import BnsError, FormatError, MissingDependencyError
from bns.experiment.record import ARRAYS, Step
from bns.viz import moments, pictures, recording, scene, style
from bns.viz.choices import Choice, choose, typical
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial

pytest.importorskip("rerun")


@pytest.fixture(scope="module")
def rrd(record, trials, tmp_path_factory):
    path = tmp_path_factory.mktemp("viz") / "run.rrd"
    return recording.write(record, trials, path, replicate=0)


def chunks(rrd):
    from rerun.chunk import RrdReader

    return list(RrdReader(str(rrd)).stream())


def columns(rrd, path):
    """Row by row, what an entity holds: {component: list}."""
    found = {}
    for chunk in chunks(rrd):
        if str(chunk.entity_path) == path:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if ":" not in name:
                    continue
                found.setdefault(name, []).extend(batch.column(name).to_pylist())
    return found


def test_rerun_finds_nothing_wrong(rrd):
    command = [pictures.executable(), "rrd", "verify", str(rrd)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_it_holds_what_a_reader_needs(rrd, record):
    entities = {str(chunk.entity_path) for chunk in chunks(rrd)}
    for choice in choose(record, 0):
        for kind in ("real", "predicted"):
            assert f"/world/trails/trial_{choice.trial:03d}/{kind}" in entities
    for entity in (
        "/world/objectives",
        "/world/khepera3",
        "/wheels/left",
        "/charts/fitness/damaged",
        "/curves/diversity/equation_4_1",
        "/curves/snn_error/turn_deg",
        "/moment",
        "/about",
    ):
        assert entity in entities, entity


def test_no_wall_clock(rrd):
    schemas = [chunk.to_record_batch().schema for chunk in chunks(rrd)]
    names = {name for schema in schemas for name in schema.names}
    assert not {"log_time", "log_tick"} & names
    assert {"sim_time", "trial"} <= names


def test_the_robot_ends_where_each_trial_ended(rrd, record, trials):
    found = columns(rrd, "/world/khepera3")
    translations = [row[0] for row in found["Transform3D:translation"]]
    for choice in choose(record, 0):
        end = trials[choice.trial].poses_world[-1, :2]
        gaps = [np.hypot(*(np.array(row[:2]) - end)) for row in translations]
        assert min(gaps) < 1e-6


def test_the_lanes_follow_one_another(rrd, record):
    states = [row[0] for row in columns(rrd, "/moment")["StateChange:state"] if row]
    labels = [f"trial {c.trial}: {c.label}" for c in choose(record, 0)]
    assert states[:3] == labels


def test_a_trial_without_samples_is_drawn_from_its_command_ends(record, trials):
    model = scene.compiled("khepera3")
    at = (0, 20)
    times, poses, _ = moments.samples(record, at, trials[20], model)
    sparse_times, sparse, _ = moments.samples(record, at, None, model)
    assert np.isclose(times[-1], sparse_times[-1])
    assert np.allclose(poses[-1], sparse[-1], atol=1e-6)
    assert np.allclose(poses[:, 0].max(), sparse[:, 0].max(), atol=0.01)


def test_the_typical_replicate_by_default(record, tmp_path):
    path = recording.write(record, {}, tmp_path / "a.rrd")
    text = columns(path, "/about")["TextDocument:text"][0][0]
    assert f"replicate {typical(record)}" in text


def test_a_picture_without_warnings(rrd, tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "_SETTLE", 2.0)
    problem = pictures.missing()
    if problem:
        pytest.skip(str(problem))
    from PIL import Image

    port = pictures.free_port()
    monkeypatch.setattr(pictures, "free_port", lambda: port)
    png = tmp_path / "run.png"
    assert pictures.write_png(rrd, png) == []
    with socket.socket() as probe:  # the viewer is gone, it listens no more
        assert probe.connect_ex(("127.0.0.1", port)) != 0
    with Image.open(png) as image:
        assert image.size == (1920, 1080)
        assert len(image.resize((96, 54)).getcolors(9999)) > 50  # not an empty window


def test_no_such_recording(tmp_path):
    with pytest.raises(FormatError, match=r"no\.rrd is not a recording"):
        pictures.write_png(tmp_path / "no.rrd", tmp_path / "no.png")


def test_missing_vulkan_says_what_to_install(rrd, tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "_vulkan", lambda: False)
    with pytest.raises(MissingDependencyError, match="mesa-vulkan-drivers"):
        pictures.write_png(rrd, tmp_path / "run.png")


def test_broken_vulkan_says_what_to_install(rrd, tmp_path, monkeypatch):
    problem = pictures.missing()
    if problem:
        pytest.skip(str(problem))
    driver = tmp_path / "driver.json"
    driver.write_text("{}")
    monkeypatch.setenv("VK_DRIVER_FILES", str(driver))
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    with pytest.raises(MissingDependencyError, match="mesa-vulkan-drivers"):
        pictures.write_png(rrd, tmp_path / "run.png")


def step(record, trial):
    return Step(
        {name: values[:, trial] for name, values in record.columns.items()},
        {name: getattr(record, name)[:, trial] for name in ARRAYS},
    )


def test_without_a_display_it_warns_once_and_goes_on(record, monkeypatch, caplog):
    monkeypatch.setattr(recording, "_no_display", lambda: True)
    with (
        caplog.at_level(logging.WARNING),
        recording.stream(record.config) as on_trial,
    ):
        for trial in range(3):
            on_trial(trial, step(record, trial), [])
    assert len(caplog.records) == 1
    assert "no display" in caplog.text


def test_unexpected_data_do_not_stop_the_run(record, monkeypatch, caplog):
    monkeypatch.setattr(recording.Stream, "_open", lambda self, url: None)
    shown = recording.Stream(record.config)
    shown.on_trial(0, Step({}, {"poses": np.zeros((1, 1, 3))}))
    assert shown.failed


def test_the_live_view_listens_on_this_machine_alone(monkeypatch):
    begun = []
    monkeypatch.setattr(recording, "_no_display", lambda: False)
    monkeypatch.setattr(recording, "executable", lambda: "viewer")
    monkeypatch.setattr(recording, "wait", lambda process, port: None)
    monkeypatch.setattr(
        recording.subprocess, "Popen", lambda words, **_: begun.append(words)
    )
    assert recording._spawn().startswith("rerun+http://127.0.0.1:")
    ((_, flag, address, *_),) = begun
    assert (flag, address) == ("--bind", "127.0.0.1")


def test_trials_reach_a_viewer(record):
    problem = pictures.missing()
    if problem:
        pytest.skip(str(problem))
    with (
        pictures.viewer() as viewer,
        recording.stream(record.config, url=viewer.url) as on_trial,
    ):
        for trial in range(3):
            on_trial(trial, step(record, trial), [])
        names, tries = set(), 0
        while not names and (tries := tries + 1) < 40:
            time.sleep(0.25)
            names = {view.name for view in viewer.get_state().views}
    assert names >= {"World", "Fitness"}


@pytest.fixture(scope="module")
def model():
    return models.scene_spec("phantomx").compile()


def trial(positions):
    """Two samples at (0.3, -0.2); servos at `positions` [rad], else half-way."""
    robot = models.robot("phantomx")
    names = [channel.name for channel in robot.channels]
    row = [0.3, -0.2, 1.0, *(positions.get(name, 0.0) for name in names)]
    channels = tuple(Channel(f"{name}_position", "rad") for name in names)
    told = Commands(
        np.zeros((1, 18)), [1.0], tuple(Channel(*c) for c in robot.channels)
    )
    return Trial(
        told, [0.0, 1.0], [row, row], [0, 1], channels=(*POSE_CHANNELS, *channels)
    )


def feet(model, qpos):
    """Heights of the feet by leg [m]."""
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    names = [model.site(i).name for i in range(model.nsite)]
    return {
        name.removesuffix("_foot"): data.site(name).xpos[2]
        for name in names
        if name.endswith("_foot")
    }


def test_it_stands_on_all_feet_half_way(model):
    seen = trial({})
    qpos = moments.walking_qpos(model, seen.poses_world, seen, np.arange(2))
    heights = feet(model, qpos[0])
    assert len(heights) == 6
    np.testing.assert_allclose(list(heights.values()), 0.0, atol=1e-3)
    np.testing.assert_allclose(qpos[0, :2], [0.3, -0.2])


def test_a_raised_leg_is_in_the_air_and_the_others_are_not(model):
    seen = trial({"left_middle_femur": 1.0})
    qpos = moments.walking_qpos(model, seen.poses_world, seen, np.arange(2))
    heights = feet(model, qpos[0])
    assert heights.pop("left_middle") > 0.05
    np.testing.assert_allclose(list(heights.values()), 0.0, atol=1e-3)


def test_only_walking_robots_report_servos():
    bare = Trial(Commands([[0.1, 0.1]], [1.0]), [0, 1], np.zeros((2, 3)), [0, 1])
    assert moments.reports_servos(trial({})) and not moments.reports_servos(bare)


@pytest.mark.parametrize("walks", [False, True])
def test_a_recording_of_walking_shows_distances_and_no_wheels(walks):
    from bns import presets
    from bns.viz import charts, scene
    from bns.viz.rrd import blueprint

    config = presets.load("hexapod-walk" if walks else "khepera-simple")
    shown_task = scene.picture(config)
    titles = charts.chart_titles({}, shown_task)
    layout = blueprint(shown_task, charts=titles)
    shown = dict(_views(layout.root_container))
    assert ("/wheels" in shown) != walks
    title = shown["charts/fitness"]
    assert title.startswith(
        "Distance walked" if walks else "Fitness over trials (log10"
    )


def _views(part):
    """(origin, name) of all views in a part of a blueprint."""
    for inner in getattr(part, "contents", ()):
        if hasattr(inner, "origin"):
            yield inner.origin, inner.name
        yield from _views(inner)


CHOICES = (Choice(1, "before damage", style.BLUE), Choice(20, "damaged", style.ORANGE))
SMALL = {"size": (96, 64), "speed": 100.0, "replicate": 0, "choices": CHOICES}


def test_a_gif_shows_each_trial(record, tmp_path, opengl):
    from PIL import Image

    path = pictures.write_film(record, {}, tmp_path / "run.gif", **SMALL)
    with Image.open(path) as image:
        assert image.size == (96, 64) and image.n_frames >= 4
        seconds = 0.0
        shown = []
        for number in range(image.n_frames):
            image.seek(number)
            seconds += image.info["duration"] / 1000
            shown.append(np.asarray(image.convert("RGB"), dtype=float))
    assert seconds > 2 * pictures.HOLD
    assert np.abs(shown[0] - shown[-1]).mean() > 1, "the robot has moved"


def test_an_mp4_is_written(record, tmp_path, opengl):
    pytest.importorskip("imageio_ffmpeg")
    path = pictures.write_film(record, {}, tmp_path / "run.mp4", **SMALL)
    assert path.read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("name", "more", "message"),
    [
        ("run.avi", {}, "ends in .gif or .mp4"),
        ("nowhere/run.gif", {}, "There is no directory"),
        ("run.gif", {"size": (97, 64)}, "give even numbers"),
        ("run.gif", {"speed": 0.0}, "give 0.1 to 100"),
    ],
)
def test_what_cannot_be_is_refused(record, tmp_path, name, more, message):
    with pytest.raises(BnsError, match=message):
        pictures.write_film(record, {}, tmp_path / name, **(SMALL | more))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gif", "a.gif", "--png", "a.png"], "Give one of"),
        (["--gif", "a.mp4"], "give a name that ends in .gif"),
    ],
)
def test_wrong_words_are_one_line(words, message, capsys, tmp_path):
    assert main(["view", str(tmp_path), *words]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
