"""What a robot directory has to be, checked one point at a time.

`bns models check ROBOT` prints it; the tests hold every robot of the project to it.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.models import legs, light_sites, mjcf, numbers, servo_numbers
from bns.models.robot_model import RobotModel

KINDS = ("wheeled", "legged", "servo")
HIT = ("femur", "tibia", "foot")
"""geoms of a leg, after what they belong to"""
SPEED_TOLERANCE = 0.05
"""share by which steady speed and spin may differ from what was told; assumed"""


class Checked(NamedTuple):
    """One point.

    Attributes:
        says: what was checked, in words.
        faults: what is wrong, one line each; none if it holds.
    """

    says: str
    faults: tuple[str, ...]


def check(robot: RobotModel) -> list[Checked]:
    """Every point that a robot has to keep, in the order in which to mend them."""
    done = [Checked("robot.toml names all there is to know", tuple(_facts(robot)))]
    try:
        model = mjcf.robot_spec(robot, scene=True, visuals=True, options={}).compile()
    except (BnsError, ValueError) as error:
        return [*done, Checked("scene.xml compiles", (str(error),))]
    done.append(Checked("scene.xml compiles", ()))
    for says, point in points_of(robot).items():
        done.append(Checked(says, tuple(point(robot, model))))
        if point in _NEEDED and done[-1].faults:
            break  # what follows would only fail for the same reason
    return done


def _facts(robot: RobotModel) -> list[str]:
    faults = []
    if robot.kind not in KINDS:
        faults.append(f"kind {robot.kind!r} is none of {', '.join(KINDS)}")
    if not robot.xml.is_file():
        faults.append(f"the robot alone is to be {robot.xml.name}, as its directory")
    if not robot.doc or "\n" in robot.doc:
        faults.append("doc is to be one line")
    if not robot.ctrl_per_command > 0:
        faults.append(f"ctrl_per_command is {robot.ctrl_per_command}, not above 0")
    for command in robot.commands:
        if not command.unit:
            faults.append(f"command {command.name} has no unit")
        if not command.low < command.high:
            faults.append(f"command {command.name}: low is not below high")
    if robot.kind == "wheeled" and set(robot.wheels) != {"left", "right"}:
        faults.append("a wheeled robot has [wheels.left] and [wheels.right]")
    return faults


def _names(robot: RobotModel, model: Any) -> list[str]:
    """What `robot.toml` names is in the model."""
    wanted = [("body", robot.base_body), ("joint", robot.base_joint)]
    wanted += [("site", site) for site in (robot.tracker_site, *robot.sensor_sites)]
    for wheel in robot.wheels.values():
        wanted += [("body", wheel.body), ("joint", wheel.joint)]
        wanted += [("geom", wheel.geom), ("actuator", wheel.actuator)]
    if robot.caster_geom:
        wanted.append(("geom", robot.caster_geom))
    wanted += [("geom", "floor"), ("camera", robot.picture), ("key", "home")]
    return _absent(model, wanted)


def _absent(model: Any, wanted: Iterable[tuple[str, str]]) -> list[str]:
    faults = []
    for kind, name in wanted:
        try:
            getattr(model, kind)(name)
        except KeyError:
            faults.append(f"the model has no {kind} called {name!r}")
    return faults


def _base(robot: RobotModel, model: Any) -> list[str]:
    import mujoco

    faults = []
    if model.body(robot.base_body).parentid != 0:
        faults.append(f"body {robot.base_body} is not a child of the world")
    fixed = robot.kind == "servo"  # on a stand, its base joint is the shaft
    joint = mujoco.mjtJoint
    wanted = joint.mjJNT_HINGE if fixed else joint.mjJNT_FREE
    if model.joint(robot.base_joint).type != wanted:
        kind = "hinge" if fixed else "free joint"
        faults.append(f"joint {robot.base_joint} is no {kind}")
    for side, wheel in robot.wheels.items():
        geom = model.geom(wheel.geom)
        if not (geom.conaffinity or geom.contype):
            faults.append(f"the {side} wheel's geom {wheel.geom} touches nothing")
    return faults


def _legs(robot: RobotModel, model: Any) -> list[str]:
    """A walking robot has what effects and the world look for by name."""
    names = {command.name for command in robot.commands}
    own, faults = legs.names(names), _servo(robot)
    if not own:
        return [f"no command is called after a leg and a part, as {legs.JOINTS[0]}"]
    parts = legs.parts(names)
    if len(parts) < 2 or "femur" not in parts:
        return [f"legs move by {', '.join(parts)}: a femur and one more are needed"]
    joints = [f"{leg}_{part}" for leg in own for part in parts]
    faults += [f"no command is called {name!r}" for name in joints if name not in names]
    faults += [f"command {name!r} is no joint of a leg" for name in names - {*joints}]
    wanted = [(kind, joint) for joint in joints for kind in ("body", "joint")]
    hit = [part for part in HIT if part in (*parts, "foot")]
    wanted += [("geom", f"{leg}_{part}") for leg in own for part in hit]
    return faults + _absent(model, [*wanted, ("geom", "belly"), ("sensor", "own")])


def _servo(robot: RobotModel) -> list[str]:
    if robot.servo == "ax12a":
        return []
    if robot.servo != servo_numbers.LAW:
        return [f"servo {robot.servo!r} is neither 'ax12a' nor {servo_numbers.LAW!r}"]
    try:
        servo_numbers.law(robot.directory)
    except BnsError as error:
        return [str(error)]
    return []


def _eyes(robot: RobotModel, model: Any) -> list[str]:
    """Light sensors are what effects and the world `light` look for."""
    return light_sites.faults(robot)


def _controls(robot: RobotModel, model: Any) -> list[str]:
    order = [model.actuator(index).name for index in range(model.nu)]
    named = [command.actuator for command in robot.commands]
    if named != order:
        return [f"commands go to {named}, the model's actuators are {order}"]
    reach = model.actuator_ctrlrange / robot.ctrl_per_command
    return [
        f"{command.name} goes from {command.low:g} to {command.high:g} {command.unit}, "
        f"its actuator from {low:.4g} to {high:.4g}"
        for command, (low, high) in zip(robot.commands, reach, strict=True)
        if not np.allclose((low, high), (command.low, command.high), rtol=1e-3)
    ]


def _numbers(robot: RobotModel, model: Any) -> list[str]:
    try:
        table = numbers.read(robot.directory)
        faults = [text for item in table.values() for text in item.disagreements(model)]
    except (BnsError, FileNotFoundError) as error:
        return [f"numbers.toml: {error}"]
    return faults + [
        f"{item.name} lacks a source, a unit, or where the model has it"
        for item in table.values()
        if not (item.source and item.unit and item.at)
    ]


def _rests(robot: RobotModel, model: Any) -> list[str]:
    home = model.key("home")
    still = np.tile(home.ctrl, (round(1.0 / model.opt.timestep), 1))
    seen, _ = controlled(model, still)
    way = float(np.abs(seen[-1, :3] - home.qpos[:3]).max())
    turn = float(np.abs(seen[-1, 3:] - home.qpos[3:]).max(initial=0))
    faults = []
    if not way < 1e-4:
        faults.append(f"in one second at rest it moved by {way * 1000:.3g} mm")
    if not turn < 1e-3:
        faults.append(f"in one second at rest its joints turned by {turn:.3g}")
    return faults


def _drives(robot: RobotModel, model: Any) -> list[str]:
    seen, data = controlled(model, smooth(model, 2.0, seed=1))
    if not np.isfinite(seen).all():
        return ["random commands make it diverge"]
    faults = []
    if any(int(warning.number) for warning in data.warning):
        faults.append("MuJoCo warns while it is driven")
    if not np.abs(np.diff(seen, axis=0)).max() < 0.5:
        faults.append("a coordinate jumps by more than 0.5 in one step")
    return faults


def _repeats(robot: RobotModel, model: Any) -> list[str]:
    controls = smooth(model, 0.5, seed=2)
    again = mjcf.robot_spec(robot, scene=True, visuals=True, options={}).compile()
    first, _ = controlled(model, controls)
    second, _ = controlled(again, controls)
    same = first.tobytes() == second.tobytes()
    return [] if same else ["the same commands gave another motion"]


def _bare(robot: RobotModel, model: Any) -> list[str]:
    controls = smooth(model, 0.5, seed=3)
    try:
        bare = mjcf.robot_spec(robot, scene=True, visuals=False, options={}).compile()
    except ValueError as error:
        return [f"without what only shows it does not compile: {error}"]
    shown, _ = controlled(model, controls)
    hidden, _ = controlled(bare, controls)
    same = shown.tobytes() == hidden.tobytes()
    return [] if same else ["geoms without contact have mass: give them mass 0"]


def _touches(robot: RobotModel, model: Any) -> list[str]:
    floor = model.geom("floor").id
    if robot.kind == "servo":
        met = (model.geom_contype & model.geom_conaffinity[floor]).any()
        return ["a servo on a stand touches the floor"] if met else []
    pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
    own = {frozenset(pair) for pair in pairs}
    _, data = controlled(model, model.key("home").ctrl[None])
    if not data.ncon:
        return ["it does not touch the floor"]
    _, data = controlled(model, smooth(model, 0.5, seed=4))
    return [
        f"{model.geom(a).name} touches {model.geom(b).name}"
        for a, b in (contact.geom for contact in data.contact)
        if floor not in (a, b) and frozenset((a, b)) not in own
    ]


def _speeds(robot: RobotModel, model: Any) -> list[str]:
    """A wheeled robot goes as fast as it is told, forwards and the right way round."""
    faults = []
    told, found = straight(robot, model)
    if not abs(found / told - 1) <= SPEED_TOLERANCE:
        faults.append(f"told {told:.3f} m/s straight on, it goes {found:.3f} m/s")
    told, found = spin(robot, model)
    if not abs(found / told - 1) <= SPEED_TOLERANCE:
        faults.append(
            f"told to spin by {told:.3f} rad/s (left), it spins by {found:.3f} rad/s"
        )
    return faults


POINTS: dict[str, Callable[[RobotModel, Any], list[str]]] = {
    "what robot.toml names is in the model": _names,
    "its base floats (or stands), its wheels touch": _base,
    "commands are the actuators, in order, with their ranges": _controls,
    "a walking robot's legs and joints have the names that effects know": _legs,
    "light sensors, if any, come in pairs, with the names that effects know": _eyes,
    "numbers.toml agrees with the model, each number with unit and source": _numbers,
    "at home it rests": _rests,
    "it is driven without warnings": _drives,
    "the same commands give the same bytes": _repeats,
    "what only shows moves nothing": _bare,
    "only the floor and paired geoms touch it": _touches,
    "a wheeled robot has the speed and the spin that it is told": _speeds,
}
_NEEDED = (_names, _base, _controls)
_OF_KIND: dict[Any, str] = {_legs: "legged", _speeds: "wheeled"}
"""points that only robots of one kind have to keep"""


def points_of(robot: RobotModel) -> dict[str, Callable[[RobotModel, Any], list[str]]]:
    """The points that a robot of its kind has to keep once its scene compiles.

    Args:
        robot: as its directory says.

    Returns:
        what is checked, in words -> what gives the faults.
    """
    return {
        says: point
        for says, point in POINTS.items()
        if _OF_KIND.get(point, robot.kind) == robot.kind
    }


SHARE = 0.4
"""of the largest command at which speed and spin are looked at; assumed"""
RAMP, STEADY = 2.0, 1.0
"""s; until the motion is taken as steady, and how long it is looked at; assumed"""


def smooth(model: Any, seconds: float, seed: int) -> np.ndarray:
    """Random controls over the whole range without jumps, shape ``(S, nu)``.

    Args:
        model: a `mujoco.MjModel`; its control ranges and time step count.
        seconds: duration.
        seed: of rates and phases.
    """
    rng = np.random.default_rng(seed)
    steps = round(seconds / model.opt.timestep)
    times = np.arange(steps) * model.opt.timestep
    rates, phases = rng.uniform(0.2, 2.0, model.nu), rng.uniform(0, 2, model.nu)
    low, high = model.actuator_ctrlrange.T
    wave = np.sin(2 * np.pi * (np.outer(times, rates) + phases))
    return (low + high) / 2 + wave * (high - low) / 2


def controlled(model: Any, controls: np.ndarray) -> tuple[np.ndarray, Any]:
    """Drive a compiled model from its `home`.

    Args:
        model: a `mujoco.MjModel`.
        controls: one row a physics step, shape ``(S, nu)``.

    Returns:
        Configurations after each step, shape ``(S, nq)``, and the `mujoco.MjData`.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    seen = np.empty((len(controls), model.nq))
    for step, control in enumerate(controls):
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        seen[step] = data.qpos
    return seen, data


def straight(robot: RobotModel, model: Any) -> tuple[float, float]:
    """Speed forwards that a wheeled robot is told, and the one it keeps [m/s]."""
    told = SHARE * float(robot.limits.min())
    places, yaws, seconds = _steady(robot, model, left=told, right=told)
    ahead = (places[-1] - places[0]) @ (np.cos(yaws[0]), np.sin(yaws[0]))
    return told, float(ahead) / seconds


def spin(robot: RobotModel, model: Any) -> tuple[float, float]:
    """Rate at which it is told to spin, left positive, and the one it keeps [rad/s]."""
    speed = SHARE * float(robot.limits.min())
    _, yaws, seconds = _steady(robot, model, left=-speed, right=speed)
    left, right = (_place(model, robot.wheels[side].body) for side in ("left", "right"))
    axle = float(np.linalg.norm(left - right))
    return 2 * speed / axle, float(yaws[-1] - yaws[0]) / seconds


def _steady(
    robot: RobotModel, model: Any, **told: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Places [m] and yaws [rad] over the steady part, and how long that lasts [s]."""
    ramp, steady = (round(time / model.opt.timestep) for time in (RAMP, STEADY))
    controls = np.zeros((ramp + steady, model.nu))
    for side, speed in told.items():
        at = model.actuator(robot.wheels[side].actuator).id
        controls[:, at] = speed * robot.ctrl_per_command
    seen, _ = controlled(model, controls)
    at = int(model.joint(robot.base_joint).qposadr[0])
    w, i, j, k = seen[ramp - 1 :, at + 3 : at + 7].T
    yaws = np.unwrap(np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)))
    return seen[ramp - 1 :, at : at + 2], yaws, steady * model.opt.timestep


def _place(model: Any, body: str) -> np.ndarray:
    """Where a body is at `home` [m]."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_kinematics(model, data)
    return data.body(body).xpos.copy()
