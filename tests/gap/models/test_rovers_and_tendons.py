"""Rovers and tendons of a user: turns and lengths are told apart, and what departs."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bns.errors import FormatError, UnknownNameError
from bns.gap.diagnose import diagnose
from bns.gap.importers import tables
from bns.gap.models.mjcf import view
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import TURNS
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.recordings import check
from bns.worlds.physics.rollout import STATE
from tests.gap.own_robots import described

CART = """<mujoco model="cart"><option timestep="0.005"/><worldbody>
  <geom name="floor" type="plane" size="5 5 .1"/>
  <body name="chassis" pos="0 0 0.05"><freejoint name="base"/>
    <geom type="box" size="0.1 0.06 0.02" mass="1" contype="0" conaffinity="0"/>
    <geom type="sphere" pos="-0.08 0 -0.04" size="0.01" mass="0.1" friction="0"
      priority="1" condim="1"/>
    <site name="mast" pos="0.05 0.02 0.1"/>
    <body name="left" pos="0.03 0.08 0"><joint name="left_wheel" axis="0 1 0"
      damping="0.01" armature="1e-3"/>
      <geom type="sphere" size="0.05" mass="0.1"/></body>
    <body name="right" pos="0.03 -0.08 0"><joint name="right_wheel" axis="0 1 0"
      damping="0.01" armature="1e-3"/>
      <geom type="sphere" size="0.05" mass="0.1"/></body></body></worldbody>
  <actuator><velocity joint="left_wheel" kv="0.2"/>
    <velocity joint="right_wheel" kv="0.2"/></actuator></mujoco>"""
FINGER = """<mujoco model="finger"><option timestep="0.005" gravity="0 0 0"/><worldbody>
  <site name="root" pos="0 0.02 0"/>
  <body name="bone"><joint name="mcp" axis="0 0 1" damping="0.02" stiffness="0.05"/>
    <geom type="capsule" fromto="0 0 0 0.05 0 0" size="0.01" mass="0.05"/>
    <site name="tip" pos="0.05 0.01 0"/></body></worldbody>
  <tendon><spatial name="flexor"><site site="root"/><site site="tip"/></spatial>
  </tendon><actuator><motor name="pull" tendon="flexor" gear="-1"/></actuator>
  </mujoco>"""
TRIED = (
    "actuator_gear[left_wheel]",
    "actuator_gear[right_wheel]",
    "geom_friction[all]",
)
RATE = 50  # [Hz]
NOISE = np.array([1e-3, 1e-3, 5e-3, 5e-3, 5e-3])


def driven(folder, *, gear=1.0, fade=0.0, yaw=0.0, ahead=0.0, seconds=3.0, trials=4):
    """A log of a cart that turns on the spot and drives off, in a frame of its own."""
    robot = mujoco.MjModel.from_xml_string(CART)
    robot.actuator_gear[0, 0] *= gear
    rng, rows = np.random.default_rng(2), []
    for trial in range(trials):
        data = mujoco.MjData(robot)
        told = rng.uniform(-1, 1, (6, 2)) * 6
        told[:2] = [[-8, 8], [8, 8]]
        for step in range(round(seconds * RATE)):
            now = told[min(step * 6 // round(seconds * RATE), 5)]
            frame = Rotation.from_quat(data.qpos[3:7], scalar_first=True)
            (turned, _, _) = frame.as_euler("ZYX")
            place = complex(*data.qpos[:2]) + ahead * np.exp(1j * turned)
            place = np.exp(1j * yaw) * place + (3 - 2j)
            heading = (turned + yaw + np.pi) % (2 * np.pi) - np.pi
            seen = [place.real, place.imag, heading, *data.qpos[7:9]]
            rows.append([trial, step / RATE, *now, *rng.normal(seen, NOISE)])
            data.ctrl[:] = now * np.exp(-fade * trial)
            mujoco.mj_step(robot, data, round(1 / RATE / 0.005))
    head = (
        "trial,time,left_wheel_cmd,right_wheel_cmd,x,y,heading,left_wheel,right_wheel"
    )
    log = folder / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=head, comments="")
    return log


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cart")
    log = driven(folder, yaw=2.0)
    return *described(folder, CART, log), log


def test_columns_of_the_one_free_body_are_told_by_their_axes(cart):
    found, own, _ = cart
    told = " ".join((*found.guessed, *found.unsure))
    for column, what in (("x", "along x"), ("y", "along y"), ("heading", "yaw")):
        assert f"{column}: body 'chassis' {what} in " in told
    (item,) = [item for item in own.config.seen if item.turning]
    assert item.channel.unit == "rad"


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("place", ["chassis", "mast"])
def test_turns_are_those_of_the_rotation_and_go_on_beyond_half_a_turn(
    tmp_path, turn, place
):
    model = mujoco.MjModel.from_xml_string(CART)
    angles = np.zeros((60, 3))
    angles[:, 0] = np.linspace(2.5, 5.5, 60)  # yaw, beyond half a turn
    angles[:, 1:] = [0.3, -0.2]
    turned = Rotation.from_euler("ZYX", angles).as_quat(scalar_first=True)
    states = np.zeros((60, mujoco.mj_stateSize(model, STATE)))
    states[:, 4:8] = turned
    states[50] = np.nan
    kind = "site" if place == "mast" else "body"
    text = 'name="c"\nmodel="c.xml"\n[commands.u]\nactuator="left_wheel"\nunit="1"\n'
    text += f'low=-1\nhigh=1\n[observed.a]\n{kind}="{place}"\naxis="{turn}"\n'
    config = read(tmp_path, text + 'unit="rad"\nnoise=1e-3\n')
    made = view.View.of(config, model).read(model, states)[:, 0]
    good = np.arange(60) != 50
    expected = angles[:, ("yaw", "pitch", "roll").index(turn)]
    np.testing.assert_allclose(made[good], expected[good], atol=1e-9)
    assert np.isnan(made[50])


def read(folder, text):
    path = folder / "own.toml"
    path.write_text(text)
    return OwnConfig.read(path)


@pytest.mark.parametrize("axis, unit", [("yaw", "m"), ("x", "rad"), ("spin", "rad")])
def test_an_axis_in_another_unit_or_that_is_none_is_refused(tmp_path, axis, unit):
    text = 'name="c"\nmodel="c.xml"\n[commands.u]\nactuator="a"\nunit="1"\nlow=-1\n'
    text += f'high=1\n[observed.h]\nbody="b"\naxis="{axis}"\nunit="{unit}"\nnoise=1\n'
    with pytest.raises((FormatError, UnknownNameError), match="yaw"):
        read(tmp_path, text)


def test_the_frame_of_the_tracker_does_not_matter(cart):
    _, own, log = cart
    (trial, *_) = own.read_log(str(log))
    windows = own.joint_windows(trial)
    before = own.compare(trial, trial.observed, windows)
    x, y, heading = (
        [item.name for item in own.channels].index(n) for n in ("x", "y", "heading")
    )
    moved = trial.observed.copy()
    way = (moved[:, x] + 1j * moved[:, y]) * np.exp(0.7j) + 5
    moved[:, x], moved[:, y] = way.real, way.imag
    moved[:, heading] += 0.7 + 2 * np.pi
    np.testing.assert_allclose(own.compare(trial, moved, windows), before, atol=1e-9)
    drift = trial.observed.copy()
    drift[:, heading] += 0.1 * trial.times
    change = own.compare(trial, drift, windows)[:, heading] - before[:, heading]
    assert np.median(change) == pytest.approx(0.05, abs=2e-3)


def test_a_robot_that_set_out_another_way_has_no_turned_sign(tmp_path):
    log = driven(tmp_path, yaw=np.pi)
    found, own = described(tmp_path, CART, log)
    _, faults = check.check(own.read_log(str(log)), own)
    notes = (*found.unsure, *faults)
    assert not any("against the model" in note for note in notes)


def test_a_heading_is_read_as_going_on_beyond_half_a_turn(cart):
    _, own, log = cart
    raw = tables.read(log)["heading"]
    assert np.abs(np.diff(raw[:150])).max() > 6
    (trial, *_) = own.read_log(str(log))
    heading = [item.name for item in own.channels].index("heading")
    assert np.abs(np.diff(trial.observed[:, heading])).max() < 1


def test_whole_turns_of_what_goes_over_no_floor_are_none(tmp_path):
    text = 'name="f"\nmodel="f.xml"\n[commands.u]\nactuator="pull"\nunit="1"\nlow=-1\n'
    text += 'high=1\n[observed.a]\nsite="tip"\naxis="yaw"\nunit="rad"\nnoise=1e-3\n'
    (tmp_path / "f.xml").write_text(FINGER)
    own = OwnModel(read(tmp_path, text), threads=1)
    log = tmp_path / "log.csv"
    times = np.arange(50) / RATE
    rows = np.column_stack([times, np.zeros(50), 0.1 * np.sin(times)])
    np.savetxt(log, rows, delimiter=",", header="time,u,a", comments="")
    (trial,) = own.read_log(str(log))
    windows = own.joint_windows(trial)
    same = own.compare(trial, trial.observed - 4 * np.pi, windows)
    plain = own.compare(trial, trial.observed, windows)
    np.testing.assert_allclose(same, plain, atol=1e-9)


def test_a_cart_without_an_effect_has_no_gap(cart):
    _, own, log = cart
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.kind == "no gap"


def test_a_planted_gear_is_named_with_its_value(tmp_path):
    log = driven(tmp_path, gear=1.1, yaw=-1.0)
    _, own = described(tmp_path, CART, log)
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.named == (("actuator_gear[left_wheel]",),)
    assert found.best.magnitudes[0] == pytest.approx(1.1, abs=0.02)


def test_a_marker_that_sits_ahead_is_named_with_its_place(tmp_path):
    log = driven(tmp_path, ahead=0.04, yaw=1.0)
    _, own = described(tmp_path, CART, log)
    found = diagnose(own.read_log(str(log)), own, full=False)
    assert found.verdict.named == (("marker_mount.dx[chassis]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.04, abs=2e-3)


def test_a_marker_is_looked_for_where_a_place_and_its_heading_are_seen(cart):
    _, own, log = cart
    assert own.config.followed == {"chassis": [0, 1, 2]}
    assert own.config.tracked("all") == {"chassis": [0, 1, 2]}
    with pytest.raises(UnknownNameError, match="tracked place"):
        own.config.tracked("mast")
    names = {row.name for row in own.rows(own.read_log(str(log)))}
    assert {f"marker_mount.{way}[chassis]" for way in ("dx", "dy")} <= names
    assert "marker_mount.yaw[chassis]" not in names  # an offset of the heading


def test_a_battery_that_fades_over_trials_is_named_with_its_value(tmp_path):
    log = driven(tmp_path, fade=0.02, trials=6)
    _, own = described(tmp_path, CART, log)
    names = (*TRIED, "command_fade[all]", "joint_damping[all]", "actuator_gear[all]")
    trials = own.read_log(str(log))
    found = diagnose(trials, own, rows=names, full=False)
    assert found.verdict.named == (("command_fade[all]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.02, abs=0.002)
    effects = [own.parse(text) for text in found.best.effects]
    (paths,) = own.simulate(trials, [effects])
    last = trials[-1].observed[-1] - paths[-1][-1]
    assert np.abs(last[3:]).max() < 0.1


def pulled(folder, friction=0.0, seconds=24.0):
    """A log of a finger whose tendon is pulled, and let go."""
    robot = mujoco.MjModel.from_xml_string(FINGER)
    robot.tendon_frictionloss[0] += friction
    rng, data, rows = np.random.default_rng(5), mujoco.MjData(robot), []
    for step in range(round(seconds * RATE)):
        told = np.round(1.0 + np.sin(step // 10) + 0.5 * np.sin(0.37 * (step // 10)), 3)
        mujoco.mj_forward(robot, data)
        seen = rng.normal([data.qpos[0], data.ten_length[0]], [2e-3, 1e-4])
        rows.append([step / RATE, told, *seen])
        data.ctrl[:] = told
        mujoco.mj_step(robot, data, round(1 / RATE / 0.005))
    log = folder / "log.csv"
    head = "time,pull_cmd,mcp,tendon_length"
    np.savetxt(log, rows, delimiter=",", header=head, comments="")
    return log


def test_the_length_of_a_tendon_is_told_and_read(tmp_path):
    log = pulled(tmp_path, seconds=4.0)
    _, own = described(tmp_path, FINGER, log)
    (item,) = [item for item in own.config.seen if item.quantity == "tendon"]
    assert item.part == "flexor"
    (trial, *_) = own.read_log(str(log))
    ((path, *_),) = own.simulate([trial], [()])
    length = [item.name for item in own.channels].index("tendon_length")
    assert np.nanmax(np.abs(path - trial.observed)[5:, length]) < 1e-3


def test_a_tendon_that_rubs_is_named_with_its_value(tmp_path):
    log = pulled(tmp_path, friction=0.3)
    _, own = described(tmp_path, FINGER, log)
    names = ("tendon_friction[flexor]", "tendon_damping[flexor]", "actuator_gain[pull]")
    found = diagnose(own.read_log(str(log)), own, rows=names, full=False)
    assert found.verdict.named == (("tendon_friction[flexor]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.3, abs=0.02)


def test_a_quaternion_is_read_as_roll_pitch_and_yaw(tmp_path):
    angles = np.array([[0.4, 0.2, -0.1], [0.5, 0.1, 0.0]])
    turned = Rotation.from_euler("ZYX", angles).as_quat()
    rows = np.column_stack([[0.0, 0.1], [1.0, 2.0], turned])
    log = tmp_path / "log.csv"
    head = "time,w,base_qx,base_qy,base_qz,base_qw"
    np.savetxt(log, rows, delimiter=",", header=head, comments="")
    table = tables.read(log)
    for at, turn in enumerate(("yaw", "pitch", "roll")):
        np.testing.assert_allclose(table[f"base_{turn}"], angles[:, at], atol=1e-9)


def test_few_commands_may_be_trimmed_or_fade_whatever_they_move(tmp_path):
    links = "".join(
        f'<body pos="0 0 0.1"><joint name="j{n}"/><geom size="0.01"/>' for n in range(7)
    )
    (tmp_path / "robot.xml").write_text(
        f"""<mujoco><worldbody><body><joint name="wheel"/><geom size="0.05"/></body>
        {links}{"</body>" * 7}</worldbody><tendon><fixed name="rack">
        {"".join(f'<joint joint="j{n}" coef="1"/>' for n in range(7))}</fixed></tendon>
        <actuator><position name="steer" tendon="rack" kp="1"/>
        <velocity name="throttle" joint="wheel" kv="1"/></actuator></mujoco>"""
    )
    (tmp_path / "own.toml").write_text(
        """name = "car"
        model = "robot.xml"
        commands.steer = { actuator = "steer", unit = "rad", low = -1.0, high = 1.0 }
        commands.throttle = { actuator = "throttle", unit = "rad/s", low = 0, high = 9 }
        observed.q = { joint = "wheel", unit = "rad", noise = 0.01 }"""
    )
    names = {row.name for row in OwnModel.read(tmp_path / "own.toml").listed}
    fading = {"command_fade[throttle]", "command_dead_zone[throttle]"}
    assert {"command_offset[steer]"} | fading <= names
    assert not any(name.startswith("joint_backlash") for name in names)
