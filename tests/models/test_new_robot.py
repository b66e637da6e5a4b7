"""Robots made of a handful of numbers keep to every point, from small to large."""

import numpy as np
import pytest

from bns import models
from bns.gap.bench import wheeled_cases as cases
from bns.models import check, new, numbers
from bns.worlds import registry
from bns.worlds.light import sensors as light_sensors
from bns.worlds.trial import Commands
from tests.sources import ROOT

ROBOTS = {  # wheel radius, axle [m], mass [kg], top speed [m/s], of makers' data
    "epuck": (0.0205, 0.053, 0.15, 0.13),
    "burger": (0.033, 0.16, 1.0, 0.22),
    "create": (0.036, 0.235, 2.9, 0.5),
    "pioneer": (0.0975, 0.33, 9.0, 1.2),
    "jackal": (0.098, 0.376, 17.0, 2.0),
}
NAMES = ("wheel_radius", "axle_length", "mass", "top_speed")


def made(tmp_path, name, **more):
    known = new.Wheeled(**dict(zip(NAMES, ROBOTS[name], strict=True)), **more)
    new.write(tmp_path / name, known)
    return str(tmp_path / name), known


@pytest.mark.parametrize("name", ROBOTS)
def test_every_point_holds(tmp_path, name):
    place, _ = made(tmp_path, name)
    done = check.check(models.robot(place))
    assert {point.says: point.faults for point in done if point.faults} == {}
    assert len(done) == 14


def test_it_weighs_and_turns_as_it_was_told(tmp_path):
    place, known = made(tmp_path, "create")
    compiled = models.spec(place).compile()
    assert compiled.body_subtreemass[0] == pytest.approx(known.mass, rel=1e-4)
    listed = numbers.read(tmp_path / "create")
    assert {n for n, item in listed.items() if "given" in item.source} >= {
        "wheel_radius", "axle_length", "wheel_speed_limit",
    }  # fmt: skip
    world = registry.make("mujoco", robot=place)
    (trial,) = world.run([Commands(np.array([(-0.05, 0.05)]), [2.0])])
    spin = 0.1 / known.axle_length
    assert trial.poses_world[-1][2] == pytest.approx(2 * spin, rel=0.05)


def test_a_burger_of_four_numbers_goes_where_the_detailed_one_goes(tmp_path):
    place, _ = made(tmp_path, "burger")
    rng = np.random.default_rng(0)
    drives = [
        Commands(rng.uniform(-0.2, 0.2, (10, 2)), np.full(10, 1.0)) for _ in range(20)
    ]
    ends = [
        np.array(
            [
                trial.poses_world[-1]
                for trial in registry.make("mujoco", robot=name).run(drives)
            ]
        )
        for name in (place, str(ROOT / "examples" / "burger"))
    ]
    apart = np.abs(ends[0] - ends[1])
    assert np.median(np.hypot(apart[:, 0], apart[:, 1])) < 0.003  # [m], 0.8 m driven
    assert np.median(apart[:, 2]) < np.radians(0.5)


def test_light_sensors_sit_on_the_body_and_look_out(tmp_path):
    place, known = made(tmp_path, "burger", light_sensors=True)
    assert [p for p in check.check(models.robot(place)) if p.faults] == []
    sensors = light_sensors.of(place)
    assert sensors.names == tuple(new.HEADINGS)
    assert np.degrees(sensors.heading) == pytest.approx([*new.HEADINGS.values()])
    length, width, _ = known.box
    out = np.abs(sensors.position[:, :2]) / [length / 2, width / 2]
    assert out.max(axis=1) == pytest.approx(1.0, abs=1e-4)
    # the body hides what is behind a sensor, and nothing of what is ahead
    ahead = np.stack([np.cos(sensors.heading), np.sin(sensors.heading)], axis=1)
    for way, free in ((ahead, 1.0), (-ahead, 0.0)):
        unit = np.append(way, np.zeros((8, 1)), axis=1)
        assert (sensors.sight(unit[:, None]) == free).all()


def test_a_slow_robot_is_diagnosed_within_its_speeds(tmp_path):
    place, known = made(tmp_path, "epuck")
    told = cases.commands(np.random.default_rng(0), 20, robot=place)
    most = max(np.abs(item.values).max() for item in told)
    assert 0.8 * known.top_speed < most <= known.top_speed
