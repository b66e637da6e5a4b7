"""Legs of a walking robot drawn as its servos reported them."""

import numpy as np
import pytest

from bns import models
from bns.viz import moments
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial


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
    from bns.viz import blueprint, charts, scene

    config = presets.load("hexapod-walk" if walks else "khepera-simple")
    shown_task = scene.picture(config)
    titles = charts.chart_titles({}, shown_task)
    layout = blueprint.blueprint(shown_task, charts=titles)
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
