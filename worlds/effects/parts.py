"""Parts of any MJCF model, which effects name: joints, bodies, actuators, channels.

``part=elbow`` is one of them, ``part=*_knee`` all whose names match, ``part=all`` all
that there are.

Body effects find the parts of a robot in a `mujoco.MjSpec` here as well. Only the
wheels' body names are relied on, ``left_wheel`` and ``right_wheel``; joints, geoms,
actuators and the base follow from them. Of a robot without wheels the base is the body
that floats.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from bns.errors import BnsError, UnknownNameError
from bns.worlds.effects.parameter import Choice

ALL = "all"
WIDE = 1e9  # bounds of what has none on a model of any size; candidates narrow them
ANY = ("wheeled", "legged", "own")
"""robots of effects on the parts of any model, "own" being models without a world"""
UNSERVOED = ("wheeled", "own")
"""... on numbers that the servo law sets in walking robots; there it has the effect"""

SLIDE, HINGE = 2, 3  # mjtJoint
JOINT_WRAP = 1  # mjtWrap
COUPLED = 2  # mjtEq: of joints
PLAY, SEEN_PLAY = "_play", "_seen_play"
"""how the names of joints go on that are play behind others; where their encoders are
behind it, too, they read both's sum"""
FILTERS = (2, 3)  # mjtDyn: a first-order filter, and an exactly integrated one
ROUND_GEOMS = (2, 3, 4, 5)  # mjtGeom: sphere, capsule, ellipsoid, cylinder


@dataclass(frozen=True)
class Part(Choice):
    """A choice among the names of a model that is known later.

    Attributes:
        kind: "joint", "body", "actuator", "tendon", "geom" or "channel"; "lever arm" =
            of a fixed tendon about a joint, ``TENDON/JOINT``; "follower" = a joint that
            follows another one by an equality; "place" = a body or site that a tracker
            follows; "model" = of the whole of it, which is `ALL`.
    """

    kind: str = "channel"

    @property
    def shown(self) -> str:
        """The alternatives for a listing."""
        if self.kind == "model":
            return ALL
        return f"{ALL}, a name, or a pattern such as *_knee"

    def check(self, effect: str, value: object) -> str:
        """The name as text.

        Raises:
            BnsError: it is empty or can not be written in text.
        """
        name = str(value)
        if not name or name != name.strip() or set(name) & set(",=@%~"):
            raise BnsError(f"{effect}:{self.name} = {value!r} names no part.")
        return name


def part(kind: str) -> tuple[Part]:
    """The choice of a part of a kind."""
    return (Part("part", (ALL,), ALL, f"which {kind}", kind=kind),)


def among(names: Sequence[str], which: str, kind: str) -> list[int]:
    """Indices of the names that a part stands for.

    Args:
        names: of all parts of the kind.
        which: a name, a pattern with ``*``, or "all".
        kind: of the parts, for the message.

    Raises:
        UnknownNameError: it stands for none.
    """
    fits = [at for at, name in enumerate(names) if _fits(name, which)]
    if not fits:
        raise UnknownNameError(kind, which, [name for name in names if name])
    return fits


def _fits(name: str, which: str) -> bool:
    return which in (ALL, name) or ("*" in which and fnmatchcase(name, which))


def joints(spec: Any, which: str) -> list[Any]:
    """Hinges and slides of an `MjSpec` that a part stands for."""
    some = [joint for joint in spec.joints if joint.type in (SLIDE, HINGE)]
    return _of(some, which, "joint (hinge or slide) of the model")


def bodies(spec: Any, which: str) -> list[Any]:
    """Bodies of an `MjSpec` that a part stands for; "all" are those with a mass."""
    some = [body for body in spec.bodies[1:] if body.name]
    if which == ALL:
        model = spec.copy().compile()
        some = [body for body in some if model.body(body.name).mass[0] > 0]
    return _of(some, which, "body of the model")


def actuators(spec: Any, which: str) -> list[Any]:
    """Actuators of an `MjSpec` that a part stands for."""
    return _of(list(spec.actuators), which, "actuator of the model")


def tendons(spec: Any, which: str) -> list[Any]:
    """Tendons of an `MjSpec` that a part stands for."""
    return _of(list(spec.tendons), which, "tendon of the model")


def fixed(tendon: Any) -> bool:
    """Whether a tendon of an `MjSpec` pulls joints by lever arms of its own."""
    return bool(len(tendon.path)) and int(tendon.path[0].type) == JOINT_WRAP


def arms(spec: Any, which: str) -> list[tuple[str, str]]:
    """Names of the fixed tendons of an `MjSpec`, each with one of its joints, that a
    part ``TENDON/JOINT`` stands for."""
    some = [
        (tendon.name, wrap.target.name)
        for tendon in spec.tendons
        if fixed(tendon)
        for wrap in tendon.path
    ]
    found = among(["/".join(pair) for pair in some], which, "lever arm of the model")
    return [some[at] for at in found]


def couplings(spec: Any, which: str) -> list[Any]:
    """Equalities of two joints in an `MjSpec` whose first one a part stands for."""
    some = [
        item for item in spec.equalities if int(item.type) == COUPLED and item.name2
    ]
    names = [item.name1 for item in some]
    return [some[at] for at in among(names, which, "joint that follows another one")]


def geoms(spec: Any, which: str) -> list[Any]:
    """Geoms of an `MjSpec` that a part stands for; "all" are those that can touch."""
    some = [g for g in spec.geoms if which != ALL or g.contype or g.conaffinity]
    return _of(some, which, "geom of the model")


def _of(some: list[Any], which: str, kind: str) -> list[Any]:
    return [some[at] for at in among([item.name for item in some], which, kind)]


def put(item: Any, field: str, value: float) -> None:
    """Set a number of a part of an `MjSpec`, of a polynomial's the first.

    Args:
        item: the part, a joint or a tendon.
        field: what an `MjSpec` calls the number.
        value: of the number, in the units of the model's file.
    """
    whole = np.array(getattr(item, field), dtype=float)
    whole.reshape(-1)[0] = value
    setattr(item, field, whole if whole.ndim else value)


def in_file(spec: Any, joint: Any, value: float) -> float:
    """A position of a joint [rad or m] in the units of the model's file.

    Args:
        spec: the `mujoco.MjSpec` that the joint is of.
        joint: a hinge or a slide.
        value: the position [rad or m].

    Returns:
        degrees for a hinge of a model that is written in degrees, else as given.
    """
    hinge = joint.type == HINGE
    return float(np.rad2deg(value)) if hinge and spec.compiler.degree else value


REST = 1e-3  # share of a sticking friction that stays; it must not vanish
QUICKNESS = 0.8  # of the bristles, per physics step; stable below 2


def stick(spec: Any, held: Sequence[Any], torque: float, speed: float) -> None:
    """Give joints a dry friction that fades with speed (Stribeck).

    friction = torque exp(-(v / speed)^2) in steady motion, by bristles that give way
    (LuGre: Canudas de Wit et al., IEEE TAC 40(3), 1995; MuJoCo's dcmotor). Their
    stiffness follows from the joint's inertia and the physics step: before it slips, a
    joint moves by torque / stiffness. They are not damped: MuJoCo's implicit steps
    would take that for less inertia. Each is an actuator of its own, behind the others,
    which nothing controls.

    Args:
        spec: a `mujoco.MjSpec`.
        held: its joints.
        torque: at standstill [N m or N].
        speed: at which it has faded to 37 % [rad/s or m/s].
    """
    import mujoco

    model, rate = spec.copy().compile(), QUICKNESS / spec.option.timestep
    for joint in held:
        inertia = model.dof_M0[model.joint(joint.name).dofadr[0]]
        bristles = spec.add_actuator(
            name=f"{joint.name}_stribeck{len(spec.actuators)}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=joint.name,
        )
        bristles.set_to_dcmotor(
            motorconst=[1e-9, 1e-9],  # no motor
            resistance=1.0,
            lugre=[inertia * rate**2, 0.0, REST * torque, torque, speed],
        )
        for key in spec.keys:
            key.ctrl = np.append(np.array(key.ctrl), 0.0) if len(key.ctrl) else []
            key.act = np.append(np.array(key.act), 0.0) if len(key.act) else []


def loosen(
    spec: Any,
    joint: Any,
    play: float,
    soft: tuple[float, float] | None = None,
    *,
    called: str = PLAY,
) -> None:
    """Put play behind a joint, as a joint of its own with stops; more if it has some.

    Args:
        spec: a `mujoco.MjSpec`.
        joint: of it.
        play: full [rad or m].
        soft: inertia and damping in the play, so that it can be computed; by default a
            thousandth of the inertia that the joint moves, as much damping as stops
            that within ten milliseconds, and stops as hard as the step allows.
        called: how the name of the joint of its own goes on after that of the joint.
    """
    half = in_file(spec, joint, play / 2)
    name = f"{joint.name}{called}"
    wide = spec.joint(name)
    if wide is not None:
        wide.range = [wide.range[0] - half, wide.range[1] + half]
        return
    model = spec.copy().compile()
    inertia = 1e-3 * float(model.dof_M0[model.joint(joint.name).dofadr[0]])
    armature, damping = soft or (inertia, inertia / 0.01)
    made = joint.parent.add_joint(
        name=name,
        type=joint.type,
        axis=joint.axis,
        pos=joint.pos,
        range=[-half, half],
        limited=True,
        armature=armature,
        damping=[damping, 0.0, 0.0],
    )
    if soft is None:
        made.solref_limit = [2 * spec.option.timestep, 1.0]
    _make_room(spec, model, joint.name)


def _make_room(spec: Any, before: Any, joint: str) -> None:
    """Put a zero behind a joint in the keyframes of a spec.

    Args:
        spec: with a joint more, behind `joint`.
        before: the compiled model without it.
        joint: name.
    """
    place = before.joint(joint)
    for key in spec.keys:
        if len(key.qpos):
            key.qpos = np.insert(np.array(key.qpos), place.qposadr[0] + 1, 0.0)
        if len(key.qvel):
            key.qvel = np.insert(np.array(key.qvel), place.dofadr[0] + 1, 0.0)


FREE = 0  # mjJNT_FREE


def wheel(spec: Any, side: str) -> Any:
    """The wheel's body; `side` is "left" or "right".

    Raises:
        BnsError: the model has none.
    """
    body = spec.body(f"{side}_wheel")
    if body is None:
        raise BnsError(
            f"Model {spec.modelname!r} has no body '{side}_wheel': this effect needs "
            "a wheeled robot; see `bns robots`."
        )
    return body


def base(spec: Any) -> Any:
    """The body that carries the wheels, or the one that floats and carries the legs.

    Raises:
        BnsError: the model has neither.
    """
    if spec.body("left_wheel") is not None:
        return wheel(spec, "left").parent
    for joint in spec.joints:
        if joint.type == FREE:
            return joint.parent
    raise BnsError(
        f"Model {spec.modelname!r} has no free base: this effect needs a robot that "
        "moves about; see `bns robots`."
    )


def grounded(spec: Any) -> Iterator[Any]:
    """The bodies that carry the robot on the floor: wheels, or all parts of legs."""
    wheels = [spec.body(f"{side}_wheel") for side in ("left", "right")]
    if all(item is not None for item in wheels):
        yield from wheels
        return
    yield from base(spec).find_all("body")


def joint(spec: Any, side: str) -> Any:
    """The wheel's joint."""
    return wheel(spec, side).joints[0]


def actuator(spec: Any, side: str) -> Any:
    """The actuator that drives the wheel."""
    target = joint(spec, side).name
    return next(item for item in spec.actuators if item.target == target)


def contact_geoms(body: Any) -> Iterator[Any]:
    """The geoms of a body that can touch something."""
    return (geom for geom in body.geoms if geom.contype or geom.conaffinity)
