"""Light, on the board and on a robot of the user's.

Inverse square, angles, bodies in the way, noise: all without a trial. The robot with
light sensors is read, driven, damaged, diagnosed.
"""

import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, UnknownNameError
from bns.gap import diagnose
from bns.gap.bench.light_cases import Wanderer
from bns.gap.models.wheeled.model import WheeledModel
from bns.models import check, new, render
from bns.worlds import registry
from bns.worlds.light import law as light_law
from bns.worlds.light import sensors
from bns.worlds.light import sensors as light_sensors
from bns.worlds.light.law import Lamp, LightField
from bns.worlds.objects import Post, RayScreen
from bns.worlds.stepwise import look
from tests.worlds.test_closed_loop import Ahead, Replay, Seek

SENSORS = sensors.of("khepera3")
BACK = SENSORS.names.index("ir_back")
SIDE = SENSORS.names.index("ir_left_45")


def light(field, poses, **settings):
    """Irradiance without the ambient light, shape (n, S)."""
    law = SENSORS.law(field) | {"ambient": np.array(0.0)}
    return light_law.irradiance(law, np.atleast_2d(poses), **settings)


def facing(distance, sensor=SIDE):
    """A pose from which a sensor looks at the origin from a distance."""
    heading = SENSORS.heading[sensor]
    x, y, _ = SENSORS.position[sensor]
    ahead = np.array([np.cos(heading), np.sin(heading)])
    return np.append(-np.array([x, y]) - distance * ahead, 0.0)


def test_light_falls_with_the_square_of_the_distance():
    level = LightField((Lamp(height=0.0237),))
    near, far = (light(level, facing(d))[0, SIDE] for d in (0.4, 0.8))
    assert near / far == pytest.approx(4.0, rel=1e-9)
    assert near == pytest.approx(10 / (4 * np.pi * 0.4**2), rel=1e-9)


def test_light_from_aside_and_above_falls_with_the_cosine():
    level = LightField((Lamp(height=0.0237),))
    straight = light(level, facing(0.6))[0, SIDE]
    x, y, _ = SENSORS.position[SIDE]
    heading = SENSORS.heading[SIDE] + np.radians(60)
    aside = -np.array([x, y]) - 0.6 * np.array([np.cos(heading), np.sin(heading)])
    seen = light(level, np.append(aside, 0.0))[0, SIDE]
    assert seen / straight == pytest.approx(0.5**4, rel=1e-6)
    above = LightField((Lamp(height=0.0237 + 0.6),))  # at 45 degrees, farther by root 2
    seen = light(above, facing(0.6))[0, SIDE]
    assert seen / straight == pytest.approx(0.25 / 2, rel=1e-6)


def test_lamps_add_up_and_ambient_light_is_everywhere():
    one, two = Lamp(x=0.3), Lamp(x=-0.2, y=0.4, power=3.0)
    poses = np.array([[0.8, 0.1, 0.5], [-0.7, -0.6, 2.0]])
    both = light(LightField((one, two)), poses)
    alone = light(LightField((one,)), poses) + light(LightField((two,)), poses)
    assert both == pytest.approx(alone)
    dark = LightField((Lamp(power=0.0),), ambient=0.1)
    reading = 4095 - round(4095 * 0.1 / 0.86)
    assert (SENSORS.counts(dark, poses) == reading).all()


def test_a_turned_world_reads_the_same():
    poses = np.array([[0.6, 0.2, 1.0]])
    cos, sin = np.cos(0.7), np.sin(0.7)
    turned = np.array([[0.6 * cos - 0.2 * sin, 0.6 * sin + 0.2 * cos, 1.7]])
    field = LightField()
    assert light(field, poses) == pytest.approx(light(field, turned))


def test_smaller_is_brighter_between_0_and_4095_in_whole_counts():
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(-1, 1, (500, 2)), rng.uniform(-4, 4, 500)])
    seen = light(LightField(ambient=0.0), poses)
    counts = SENSORS.counts(LightField(ambient=0.0), poses)
    assert (counts == np.rint(counts)).all()
    assert counts.min() == 0 and counts.max() == 4095
    order = np.argsort(seen.ravel())
    assert (np.diff(counts.ravel()[order]) <= 0).all()


def test_noise_comes_from_the_generator_alone():
    poses = np.array([[0.6, 0.2, 1.0]] * 3)
    field = LightField()
    draws = [
        SENSORS.counts(field, poses, rng=np.random.default_rng(seed))
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(draws[0], draws[1])
    assert not np.array_equal(draws[0], draws[2])


def test_flicker_is_a_wave_in_time():
    field = LightField((Lamp(flicker_depth=0.6, flicker_frequency=2.0),))
    pose = np.tile(facing(0.6), (3, 1))
    seen = light(field, pose, times=np.array([0.0, 0.25, 0.5]))[:, SIDE]
    assert seen[1] / seen[0] == pytest.approx(0.4)
    assert seen[2] == pytest.approx(seen[0])


@pytest.fixture(scope="module")
def rays():
    return sensors.Rays("khepera3")


def test_the_kept_sight_is_what_rays_find(rays):
    """In random directions; they may differ within the table's steps of an edge."""
    rng, wrong = np.random.default_rng(3), 0
    kept = sensors.kept("khepera3", SENSORS.names)
    count = 150
    azimuth = rng.uniform(-np.pi, np.pi, (count, 9))
    height = rng.uniform(0, np.radians(60), (count, 9))
    unit = np.stack(
        [np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth),
         np.sin(height)], axis=-1,
    )  # fmt: skip
    table = kept(unit[:, :, None])[..., 0]
    for row in range(count):
        for sensor, name in enumerate(SENSORS.names):
            free = rays.free(name, azimuth[row, sensor], height[row, sensor])
            wrong += free != bool(table[row, sensor])
    assert wrong <= 0.03 * count * 9
    assert 0.35 < table.mean() < 0.75


def test_the_kept_sight_is_of_this_model(rays):
    known = json.loads((models.path("khepera3") / sensors.FILE).read_text())
    middle, half = known["ir_left_45"][0]
    azimuths = np.radians([middle - half - 2, middle - half + 2, middle, middle + 170])
    free = [rays.free("ir_left_45", azimuth, 0.0) for azimuth in azimuths]
    assert free == [False, True, True, False], "run python -m bns.worlds.light.sensors"


def test_a_bent_sensor_looks_into_the_robots_own_body():
    """Turned by half a turn it sees nothing of a lamp behind the robot."""
    law = SENSORS.law(LightField()) | {"ambient": np.array(0.0)}
    law["heading"] = SENSORS.heading + np.pi
    pose = np.array([[0.8, 0.0, 0.0]])  # the lamp is behind
    front = SENSORS.names.index("ir_front_left")
    assert light_law.irradiance(law, pose)[0, front] > 0.5
    assert light_law.irradiance(law, pose, sight=SENSORS.sight)[0, front] == 0


def test_objects_cast_shadows_as_single_rays_say():
    posts = (Post(0.4, 0.1, radius=0.08), Post(-0.3, -0.3, 0.1, height=0.1))
    screen, rng = RayScreen(posts), np.random.default_rng(2)
    points = np.concatenate(
        [rng.uniform(-1, 1, (60, 9, 2)), np.full((60, 9, 1), 0.0237)], axis=-1
    )
    lamps = np.tile([[0.0, 0.0, 0.2], [0.5, -0.4, 0.3]], (60, 1, 1))
    lamps[30:, 0, 0] = 0.1  # robots may have lamps of their own
    seen = screen(points, lamps)
    spec = mujoco.MjSpec()
    for post in posts:
        geom = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER)
        geom.pos = [post.x, post.y, post.height / 2]
        geom.size = [post.radius, post.height / 2, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for n, s, lamp in np.ndindex(seen.shape):
        way = points[n, s] - lamps[n, lamp]
        hit = mujoco.mj_ray(
            model, data, lamps[n, lamp], way, None, 1, -1, np.zeros(1, np.int32), None
        )
        assert seen[n, s, lamp] == (not 0 <= hit < 1)
    assert 0.02 < 1 - seen.mean() < 0.5


def test_a_post_shades_the_robot_and_stops_it():
    start = [[-1.1, 0.0, 0.0]]
    post = {"x": -0.7, "y": 0.0, "radius": 0.05}
    free, shaded = (
        registry.make("light", posts=posts).drive(Ahead(0.1), cycles=15, starts=start)[
            0
        ]
        for posts in ((), (post,))
    )
    assert free.observed[0, 3:].max() < 3500
    assert shaded.observed[0, 3:].min() > 3800
    assert free.poses_world[-1, 0] > -0.6
    touch = -0.7 - 0.05 - 0.0675
    assert shaded.poses_world[-1, 0] == pytest.approx(touch, abs=0.01)
    assert shaded.conditions["objects"][0]["x"] == -0.7


def test_open_loop_trials_have_the_readings_as_well():
    from bns.worlds.trial import Commands

    world = registry.make("light", start=(-0.8, 0.1, 0.0))
    speeds = np.array([[0.05, 0.08], [0.1, 0.02], [0.0, 0.0]])
    trial = world.run([Commands(speeds, np.full(3, 0.4))], seeds=[4])[0]

    loop = world.drive(Replay(speeds), cycles=3, seeds=[4], starts=[world.start])[0]
    assert trial.observed.tobytes() == loop.observed.tobytes()
    assert trial.channels == loop.channels


BAD = {
    "no table": (
        lambda: sensors.of("khepera3", "mine"),
        UnknownNameError,
        "public, thesis",
    ),
    "post on the lamp": (
        lambda: registry.make("light", posts=[Post(0.0, 0.02)]),
        BnsError,
        "stands on lamp 0",
    ),
    "post without place": (
        lambda: registry.make("light", posts=[{"x": 1.0}]),
        BnsError,
        "is no object",
    ),
    "post in the robot": (
        lambda: registry.make("light", posts=[Post(0.8, 0.0)]).drive(
            Ahead(0.1), starts=[[0.75, 0.0, 0.0]]
        ),
        BnsError,
        "stands on start 0",
    ),
    "negative": (lambda: LightField((Lamp(),), -1), BnsError, "ambient light = -1"),
    "no pair": (
        lambda: SENSORS.__class__(("a",), np.zeros((1, 3)), np.zeros(1)).virtual(
            np.zeros((2, 1))
        ),
        BnsError,
        "no virtual pair",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_light_is_refused(case):
    make, error, says = BAD[case]
    with pytest.raises(error, match=says):
        make()


@pytest.fixture(scope="module")
def spec():
    """Two lamps and a post."""
    lights = [{}, {"x": 0.7, "y": -0.4, "height": 0.1}]
    posts = [{"x": -0.5, "y": 0.3}]
    return look.spec(registry.make("light", lights=lights, posts=posts))


def test_lamps_are_where_the_light_is(spec):
    model = spec.compile()
    assert model.site("lamp_0").pos == pytest.approx([0, 0, 0.2])
    assert model.geom("bulb_1").pos == pytest.approx([0.7, -0.4, 0.1])
    for name in ("stem_1", "foot_0", "boundary_0_0"):
        assert not model.geom(name).contype[0] and not model.geom(name).conaffinity[0]
    ring = [model.geom(f"boundary_1_{piece}").pos[:2] for piece in range(0, 48, 2)]
    far = np.hypot(*(np.array(ring) - [0.7, -0.4]).T)
    assert far == pytest.approx(0.15, abs=0.001)
    assert model.geom("object_0").size[:2] == pytest.approx([0.05, 0.15])


def test_bulbs_are_in_the_picture(spec, opengl):
    pixels = render.picture(spec, camera="overhead", size=(240, 160), shadows=False)
    yellow = (pixels[..., 0] > 200) & (pixels[..., 2] < 140)
    assert yellow.sum() >= 8
    rows, columns = np.nonzero(yellow)
    near = (np.abs(columns - 120) < 8) & (np.abs(rows - 80) < 8)
    assert near.any()  # the first lamp is in the middle


def test_no_boundary_where_nobody_watches():
    from bns.worlds.light.closed_loop import Supervisor

    world = registry.make("light", supervisor=Supervisor(safety=0))
    names = [geom.name for geom in look.spec(world).geoms]
    assert "bulb_0" in names
    assert not any(name.startswith("boundary") for name in names)


@pytest.fixture(scope="module")
def burger(tmp_path_factory):
    """A robot with eight light sensors."""
    return made(tmp_path_factory.mktemp("eight"))


@pytest.fixture(scope="module")
def braitenberg(tmp_path_factory):
    """The same with two of them."""
    place = made(tmp_path_factory.mktemp("two"))
    listed = [f'    "{name}",\n' for name in new.HEADINGS if name[-2:] != "45"]
    for text in listed:
        spoil(place, text, "")
    return place


def made(parent: Path) -> str:
    known = new.Wheeled(
        wheel_radius=0.033, axle_length=0.16, mass=1, top_speed=0.2, light_sensors=True
    )
    new.write(parent / "bug", known)
    return str(parent / "bug")


def spoil(place: str, old: str, instead: str) -> None:
    file = Path(place) / "robot.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, instead))


def test_two_sensors_are_the_virtual_two(braitenberg):
    sensors = light_sensors.of(braitenberg)
    assert sensors.names == ("ir_left_45", "ir_right_45")
    counts = sensors.counts(LightField(), np.array([[0.8, 0.1, 2.0], [0.4, -0.3, 1.0]]))
    assert (sensors.virtual(counts) == counts).all()
    assert len(np.unique(counts)) > 2


@pytest.mark.parametrize("robot", ["burger", "braitenberg"])
def test_it_finds_the_lamp(robot, request):
    world = registry.make("light", robot=request.getfixturevalue(robot))
    starts = [[0.9, 0.5, 1.0], [-0.8, 0.4, -2.0]]
    for trial in world.drive(Seek(), cycles=70, seeds=[1, 2], starts=starts):
        ways = np.hypot(*trial.poses_world[:, :2].T)
        assert ways[0] > 0.8
        assert ways.min() < 0.25


def test_numbers_of_its_own_count(burger, tmp_path):
    place = made(tmp_path)
    spoil(place, "full_light = 0.86", "full_light = 0.43")
    spoil(place, "exponent = 4.0", "exponent = 2.0")
    usual, own = light_sensors.of(burger), light_sensors.of(place)
    assert (own.full_light, own.exponent, own.count_noise) == (0.43, 2.0, 30.0)
    assert (usual.full_light, usual.exponent) == (0.86, 4.0)


def test_effects_take_the_sensors_that_are_there(braitenberg):
    told = {"cycles": 3, "seeds": [1], "starts": [[0.8, 0.2, 2.5]]}
    gain = "sensor_gain:sensor={},factor=0.5"
    plain, left, single = (
        registry.make("light", robot=braitenberg, damage=damage).drive(Seek(), **told)
        for damage in ((), [gain.format("left")], [gain.format("left_45")])
    )
    seen = [trial[0].channel("light_left")[0] for trial in (plain, left, single)]
    assert seen[1] == seen[2] == round(seen[0] / 2)
    with pytest.raises(BnsError, match="no sensor 'back'; it has left_45, right_45"):
        registry.make("light", robot=braitenberg, damage=[gain.format("back")])


@pytest.mark.parametrize(
    "old, instead, expected",
    [
        ('"ir_left_45",', '"tracker",', "'tracker' is none of"),
        ('    "ir_left_45",\n', "", "sensor 'ir_right_45' has no twin 'ir_left_45'"),
        (
            "full_light = 0.86",
            "full_light = -1",
            "full_light = -1.0 is no number above",
        ),
        ("exponent = 4.0", "exponents = 4.0", "exponents is none of exponent"),
        ("[light]", '[light]\nheadings = "thesis"', "headings"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, instead, expected):
    place = made(tmp_path)
    spoil(place, old, instead)
    if "headings" not in expected:
        points = check.check(models.robot(place))
        found = [text for point in points for text in point.faults]
        assert any(expected in text for text in found), found
    with pytest.raises(BnsError, match=expected):
        registry.make("light", robot=place)


def test_a_sensor_that_looks_up_is_refused(tmp_path):
    place = made(tmp_path)
    file = Path(place) / "bug.xml"
    site = r'(<site name="ir_left_45" .* zaxis=)"[^"]*"'
    text, count = re.subn(site, r'\1"0.7 0.7 0.5"', file.read_text())
    assert count == 1
    file.write_text(text)
    with pytest.raises(BnsError, match="'ir_left_45' looks up or down"):
        light_sensors.of(place)


@pytest.mark.parametrize("robot", ["burger", "braitenberg"])
def test_a_weak_sensor_is_named(robot, request):
    place = request.getfixturevalue(robot)
    world = registry.make(
        "light",
        robot=place,
        reality=[
            "sensor_gain:sensor=left,factor=0.7",
            "tracker_noise:position_sd=0.001",
        ],
    )
    roams = Wanderer(np.random.default_rng(3), 3)
    trials = world.drive(roams, cycles=40, seeds=[1, 2, 3])
    names = ("wheel_gain[left]", "sensor_gain[left]", "sensor_gain[right]")
    model = WheeledModel(place)
    found = diagnose.diagnose(trials, model, rows=names, full=False).verdict
    assert found.named == (("sensor_gain[left]",),)
