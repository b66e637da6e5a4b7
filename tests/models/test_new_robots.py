"""Robots made of a handful of numbers: walkers, and wheeled ones from small to large.

They keep to every point, are moved and damaged; what cannot be is refused.
"""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.gap.bench import wheeled_cases as cases
from bns.models import ax12a, check, legged_files, legs, new, numbers
from bns.models.new_legged import Legged
from bns.models.phantomx import gait
from bns.worlds import registry
from bns.worlds.light import sensors as light_sensors
from bns.worlds.physics import servo_law
from bns.worlds.trial import Commands
from tests.sources import ROOT

BODY = {"mass": 1.5, "body_length": 0.16, "body_width": 0.1}
LEG = {"coxa_length": 0.05, "femur_length": 0.07, "tibia_length": 0.13}
QUAD = {"legs": 4, **BODY, **LEG}
KINDS = {
    "four": QUAD,
    "six": {**QUAD, "legs": 6, "mass": 2.2, "body_length": 0.24},
    "coxa_femur": {**QUAD, "femur_length": 0.13, "tibia_length": 0.0},
    "femur_tibia": {**QUAD, "coxa_length": 0.0},
}
PHANTOMX = {  # models/phantomx/numbers.toml; the stance follows from its angles
    "legs": 6, "mass": 2.2296, "leg_mass": 0.209,
    "body_length": 0.26, "body_width": 0.11, "body_height": 0.04,
    "hip_length": 0.24, "hip_width": 0.12, "middle_width": 0.2,
    "coxa_length": 0.052, "femur_length": 0.066, "tibia_length": 0.133,
    "leg_spread": 0.7344, "femur_angle": -0.0612, "stance_height": 0.10186,
    "stops": 1.7,
}  # fmt: skip
POSE = {"coxa": 0.2, "femur": 0.2, "tibia": 0.2}


def made(place, **given):
    """Its directory."""
    legged_files.write(place, Legged(**given))
    return place


@pytest.fixture(scope="module", params=KINDS)
def robot(request, tmp_path_factory):
    """Its directory, and what it was made of."""
    given = KINDS[request.param]
    return made(tmp_path_factory.mktemp("made") / request.param, **given), given


def feet(model, goals) -> np.ndarray:
    """Places of the feet in the body's frame with joints at goals, by leg [m]."""
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    data.qpos[7:] = goals
    mujoco.mj_kinematics(model, data)
    names = legs.names(model.actuator(i).name for i in range(model.nu))
    return np.array([data.geom(f"{leg}_foot").xpos for leg in names])


def walked(place, *damage: str):
    """A trial in which it is told two postures."""
    channels = models.robot(str(place)).channels
    goals = np.random.default_rng(1).uniform(-0.4, 0.4, (2, len(channels)))
    told = Commands(goals, [1.0, 1.0], channels)
    return registry.make("hexapod", robot=str(place), damage=damage).run([told])[0]


def test_every_point_holds(robot):
    done = check.check(models.robot(str(robot[0])))
    assert {point.says: point.faults for point in done if point.faults} == {}
    assert len(done) == 13  # without what is for another kind of robot


def test_it_is_as_it_was_told(robot):
    place, given = robot
    model = models.spec(str(place)).compile()
    assert model.body_subtreemass[0] == pytest.approx(given["mass"], rel=1e-4)
    parts = [part for part in legs.PARTS if given[f"{part}_length"]]
    assert model.nu == given["legs"] * len(parts)
    half_way = feet(model, np.zeros(model.nu))
    outer = given[f"{parts[-1]}_length"]
    radius = model.geom("left_front_foot").size[0]
    # the foot's tip is three quarters of the shin's length below the hips
    assert half_way[:, 2] == pytest.approx(-0.75 * (outer - radius), abs=1e-5)
    assert (half_way[::2, 1] > 0.1).all() and (half_way[1::2, 1] < -0.1).all()
    assert half_way[::2] == pytest.approx(half_way[1::2] * [1, -1, 1], abs=1e-9)
    assert half_way[0] == pytest.approx(half_way[2] * [-1, 1, 1], abs=1e-5)
    listed = numbers.read(place)
    assert "given" in listed["body_length"].source
    assert "given" not in listed["hip_length"].source
    assert {item.basis for item in listed.values()} == {"assumed", "derived"}


def test_joints_turn_as_effects_expect(robot):
    """Coxae forward, femurs up, tibias outward."""
    model = models.spec(str(robot[0])).compile()
    joints = [model.actuator(index).name for index in range(model.nu)]
    begun = feet(model, np.zeros(model.nu))
    for part in legs.parts(joints):
        told = [POSE[part] if joint.endswith(part) else 0.0 for joint in joints]
        moved = feet(model, told) - begun
        if part == "coxa":
            assert (moved[:, 0] > 0.005).all()
        elif part == "femur":
            assert (moved[:, 2] > 0.005).all()
        else:
            out = np.sign(begun[:, 1]) * moved[:, 1]
            assert (out > 0.005).all() and (moved[:, 2] > 0.005).all()


@pytest.mark.parametrize("damage", ["leg_raised:legs=2", "leg_limp:legs=1,loss=1"])
def test_commands_move_it_and_damage_otherwise(robot, damage):
    place, _ = robot
    whole, hurt = walked(place), walked(place, damage)
    assert not whole.outcome.diverged and not whole.outcome.fell
    assert np.hypot(*whole.poses_world[-1][:2]) > 1e-3
    assert np.abs(hurt.observed[-1] - whole.observed[-1]).max() > 0.02


def test_one_of_the_phantomxs_numbers_walks_where_the_phantomx_does(tmp_path):
    place = str(made(tmp_path / "twin", **PHANTOMX))
    ends = []
    for name in ("phantomx", place):
        channels = models.robot(name).channels
        tripod = Commands(gait.tripod(), np.full(11, 1.5), channels)
        (trial,) = registry.make("hexapod", robot=name).run([tripod])
        assert not (trial.outcome.fell or trial.outcome.collided)
        ends.append(trial.poses_world[-1])
    assert np.hypot(*ends[0][:2]) > 0.8
    assert np.hypot(*(ends[1] - ends[0])[:2]) < 0.02  # [m], in eleven commands


def law(file, voltage: float) -> None:
    """Write that of an AX-12A at another voltage."""
    rest = 'unit = "V"\nbasis = "assumed"\nsource = "a test"\n'
    file.write_text(f"[voltage]\nvalue = {voltage}\n{rest}")


def test_servos_of_ones_own_are_in_the_model(tmp_path):
    file = tmp_path / "strong.toml"
    law(file, 16.0)
    place = made(tmp_path / "mine", **QUAD, servo=str(file))
    assert (place / "law.toml").read_text() == file.read_text()
    assert models.robot(str(place)).servo == "law.toml"
    expected = servo_law.joint_numbers({**ax12a.law(), "voltage": 16.0})
    actuator = models.spec(str(place)).compile().actuator("left_rear_femur")
    assert actuator.forcerange[1] == pytest.approx(expected.torque_limit, rel=1e-4)
    assert not any(point.faults for point in check.check(models.robot(str(place))))


def test_servos_that_hardly_turn_are_refused(tmp_path):
    law(tmp_path / "weak.toml", 0.7)
    with pytest.raises(BnsError, match=r"0.0875 N m hardly turn .* of 0.05 N m"):
        made(tmp_path / "mine", **QUAD, servo=str(tmp_path / "weak.toml"))


@pytest.mark.parametrize(
    "changed, expected",
    [
        ({"legs": 2}, "two feet do not hold a robot up.* Give 4 or 6"),
        ({"legs": 5}, "legs = 5 is not possible: legs stand in pairs"),
        ({"mass": 0.0}, "mass = 0.0 kg is not allowed: give a number from 0.05"),
        ({"body_length": float("nan")}, "body_length = nan m is not allowed"),
        ({"tibia_length": 133.0}, "tibia_length = 133.0 m is not allowed"),
        ({"coxa_length": -0.05}, "coxa_length = -0.05 m is not allowed"),
        ({"leg_spread": 45.0}, "leg_spread = 45.0 rad is not allowed"),
        ({"stops": 0.0}, "stops = 0.0 rad is not allowed"),
        ({"coxa_length": 0.0, "tibia_length": 0.0}, "leg of one servo cannot walk"),
        ({"tibia_length": 0.0, "femur_angle": 0.1}, "no meaning without a tibia"),
        ({"middle_width": 0.2}, "is for six legs"),
        ({"stance_height": 0.2}, "does not stand: give --stance-height .* 0.127 m"),
        ({"femur_angle": -0.9, "stance_height": 0.05}, "does not stand"),
        ({"body_height": 0.19}, "does not clear the floor with hips 0.0975 m"),
        ({"hip_width": 0.03}, "left_front and right_front are 0.03 m apart"),
        ({"leg_mass": 0.4}, "4 legs of 0.4 kg leave a robot of 1.5 kg no body"),
        ({"mass": 0.5}, "12 AX-12A servos alone weigh 0.66 kg"),
        ({"mass": 8.0}, "yield by .* rad: too weak"),
        ({"body_height": 0.17}, "body and thighs need"),
        ({"tibia_length": 0.0, "femur_length": 0.13, "body_width": 0.3,
          "body_height": 0.04, "hip_width": 0.1, "hip_length": 0.06},
         "left_front_femur touches belly"),
        ({"servo": "ax12"}, "neither ax12a nor a file"),
    ],
)  # fmt: skip
def test_what_no_walker_can_be_is_not_made(tmp_path, changed, expected):
    with pytest.raises(BnsError, match=expected):
        made(tmp_path / "mine", **{**QUAD, **changed})
    assert not any(tmp_path.iterdir())


ROBOTS = {  # wheel radius, axle [m], mass [kg], top speed [m/s], of makers' data
    "epuck": (0.0205, 0.053, 0.15, 0.13),
    "burger": (0.033, 0.16, 1.0, 0.22),
    "create": (0.036, 0.235, 2.9, 0.5),
    "pioneer": (0.0975, 0.33, 9.0, 1.2),
    "jackal": (0.098, 0.376, 17.0, 2.0),
}
NAMES = ("wheel_radius", "axle_length", "mass", "top_speed")


def made_wheeled(tmp_path, name, **more):
    known = new.Wheeled(**dict(zip(NAMES, ROBOTS[name], strict=True)), **more)
    new.write(tmp_path / name, known)
    return str(tmp_path / name), known


@pytest.mark.parametrize("name", ROBOTS)
def test_every_point_of_a_wheeled_one_holds(tmp_path, name):
    place, _ = made_wheeled(tmp_path, name)
    done = check.check(models.robot(place))
    assert {point.says: point.faults for point in done if point.faults} == {}
    assert len(done) == 13  # without what is for another kind of robot


def test_it_weighs_and_turns_as_it_was_told(tmp_path):
    place, known = made_wheeled(tmp_path, "create")
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
    place, _ = made_wheeled(tmp_path, "burger")
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
    place, known = made_wheeled(tmp_path, "burger", light_sensors=True)
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
    place, known = made_wheeled(tmp_path, "epuck")
    told = cases.commands(np.random.default_rng(0), 20, robot=place)
    most = max(np.abs(item.values).max() for item in told)
    assert 0.8 * known.top_speed < most <= known.top_speed
