"""Recordings: verified by Rerun's own tool, read back, and drawn."""

import socket
import subprocess

import numpy as np
import pytest

from bns.errors import FormatError, MissingDependencyError
from bns.viz import moments, picture, recording, scene
from bns.viz.choices import choose, typical

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
    command = [picture.executable(), "rrd", "verify", str(rrd)]
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
    monkeypatch.setattr(picture, "_SETTLE", 2.0)
    problem = picture.missing()
    if problem:
        pytest.skip(str(problem))
    from PIL import Image

    port = picture.free_port()
    monkeypatch.setattr(picture, "free_port", lambda: port)
    png = tmp_path / "run.png"
    assert picture.save(rrd, png) == []
    with socket.socket() as probe:  # the viewer is gone, it listens no more
        assert probe.connect_ex(("127.0.0.1", port)) != 0
    with Image.open(png) as image:
        assert image.size == (1920, 1080)
        assert len(image.resize((96, 54)).getcolors(9999)) > 50  # not an empty window


def test_no_such_recording(tmp_path):
    with pytest.raises(FormatError, match=r"no\.rrd is not a recording"):
        picture.save(tmp_path / "no.rrd", tmp_path / "no.png")


def test_missing_vulkan_says_what_to_install(rrd, tmp_path, monkeypatch):
    monkeypatch.setattr(picture, "_vulkan", lambda: False)
    with pytest.raises(MissingDependencyError, match="mesa-vulkan-drivers"):
        picture.save(rrd, tmp_path / "run.png")


def test_broken_vulkan_says_what_to_install(rrd, tmp_path, monkeypatch):
    problem = picture.missing()
    if problem:
        pytest.skip(str(problem))
    driver = tmp_path / "driver.json"
    driver.write_text("{}")
    monkeypatch.setenv("VK_DRIVER_FILES", str(driver))
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    with pytest.raises(MissingDependencyError, match="mesa-vulkan-drivers"):
        picture.save(rrd, tmp_path / "run.png")
