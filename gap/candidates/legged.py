"""Candidate explanations for a walking robot, from the library of effects."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bns.gap.models.legged.signs import Signs
from bns.gap.models.legged.where import Suspects
from bns.gap.records import Candidate
from bns.models.legs import JOINTS, LEGS, names, parts
from bns.worlds.effects import registry

NO_SIGNS = Signs()
UPHILL = tuple({"direction": k * np.pi / 2} for k in (-1, 0, 1, 2))

# effect, parameter, grid, low, high, slack if on all legs. Bounds narrower than the
# effect's own are assumed. Load-dependent friction is left out: in a joint of MuJoCo it
# is dry friction by another name; quantisation moves nothing.
_SERVOS = (
    ("servo_gain", "factor", (0.3, 0.6, 1.6, 3.0), 0.1, 5, 0.03),
    ("servo_voltage", "factor", (0.4, 0.75, 1.3), 0.3, 2, 0.03),
    ("servo_torque_constant", "factor", (0.5, 0.8, 1.3), 0.3, 2, 0.0),
    ("servo_coulomb", "torque", (-0.04, 0.08, 0.3), -0.05, 0.8, 0.0),
    ("servo_viscous", "coefficient", (0.05, 0.2, 0.6), 0, 1, 0.0),
    ("servo_armature", "inertia", (0.01, 0.04), 0, 0.1, 0.0),
    ("servo_delay", "delay", (0.02, 0.06, 0.15), 0, 0.4, 0.0),
    ("servo_lag", "time_constant", (0.02, 0.06, 0.2), 0, 0.5, 0.0),
    ("servo_duty_limit", "factor", (0.08, 0.2, 0.4), 0.02, 1, 0.0),
    ("servo_offset", "angle", (-0.1, 0.1), -0.3, 0.3, 0.0),
)
HIDDEN = ("servo_offset",)
"""what a servo's own reading does not show, but its leg's place: every joint counts"""

_ALIASES = {
    "servo_delay[all]": ("command_latency",),
    "command_latency": ("servo_delay[all]",),
}
EXCITE = {
    "servo_gain": "standing on fewer legs",
    "servo_voltage": "fast steps under load",
    "servo_delay": "steps",
    "servo_lag": "steps",
    "floor_slope": "walking in several headings",
    "foot_slippery": "long strides",
}


def candidates(
    found: Suspects,
    joints: Sequence[str] = JOINTS,
    signs: Signs = NO_SIGNS,
) -> tuple[Candidate, ...]:
    """All candidates, in a fixed order.

    Args:
        found: joints and legs that are suspected beside all of them.
        joints: that the robot has.
        signs: what the servos say of legs that hold, hang or are gone.
    """
    return (
        *_servos(found, joints),
        *_legs(joints),
        *_horns(joints),
        *_body(),
        *lost(signs),
    )


def lost(signs: Signs) -> tuple[Candidate, ...]:
    """Legs and joints that may be lost, by what servos say of them."""
    return (
        *_legwise("leg_raised", "blend", (0.5, 1.0), signs.raised),
        *_locked(signs.held),
        *_legwise("leg_limp", "loss", (0.5, 1.0), signs.limp),
        *_legwise("leg_missing", "loss", (1.0,), signs.unloaded),
    )


def _servos(found: Suspects, joints: Sequence[str]) -> Iterable[Candidate]:
    for effect, parameter, grid, low, high, slack in _SERVOS:
        everywhere = ("all",) if found.all or slack else ()
        near = joints if effect in HIDDEN else found.joints
        for servo in (*everywhere, *found.legs, *near):
            yield _candidate(
                effect,
                parameter,
                grid,
                low,
                high,
                part=servo,
                fixed={"servo": servo},
                slack=slack if servo == "all" else 0.0,
            )


def _legs(joints: Sequence[str]) -> Iterable[Candidate]:
    moved = parts(joints)
    for leg in ("all", *names(joints)):
        number = "all" if leg == "all" else str(LEGS.index(leg) + 1)
        for part in moved:
            yield _candidate(
                "link_length",
                "factor",
                (0.88, 1.12),
                0.8,
                1.25,
                part=f"{part},{leg}",
                fixed={"part": part, "legs": number},
                slack=0.005 if (part, leg) == (moved[-1], "all") else 0.0,
            )
        yield _candidate(
            "foot_slippery",
            "factor",
            (0.1, 1.7),
            0.02,
            2,
            part=leg,
            fixed={"legs": number},
            slack=0.1 if leg == "all" else 0.0,
        )


def _horns(joints: Sequence[str]) -> Iterable[Candidate]:
    for joint in joints:
        yield _candidate(
            "loose_horn",
            "angle",
            (0.1, 0.3),
            0,
            0.6,
            part=joint,
            fixed={"joint": joint},
        )


def _locked(held: Mapping[str, float]) -> Iterable[Candidate]:
    for joint, angle in held.items():
        yield _candidate(
            "joint_locked",
            "loss",
            (0.5, 1.0),
            0,
            1,
            part=joint,
            fixed={"joint": joint, "angle": float(np.clip(angle, -1.5, 1.5))},
        )


def _legwise(
    effect: str, parameter: str, grid: tuple[float, ...], legs: Sequence[str]
) -> Iterable[Candidate]:
    for leg in legs:
        fixed = {"legs": str(LEGS.index(leg) + 1)}
        yield _candidate(effect, parameter, grid, 0, 1, part=leg, fixed=fixed)


def _body() -> Iterable[Candidate]:
    yield _candidate("payload", "mass", (0.1, 0.4, 1.2), 0, 2, slack=0.02)
    for parameter in ("dx", "dy"):
        yield _candidate(
            "centre_of_mass",
            parameter,
            (-0.03, -0.01, 0.01, 0.03),
            -0.03,
            0.03,
            stem=f"centre_of_mass.{parameter}",
        )
    yield _candidate(
        "floor_slope",
        "angle",
        (0.05, 0.2),
        0,
        0.35,
        branches=UPHILL,
        extras=("direction",),
    )
    yield _candidate("floor_compliance", "factor", (2.0, 4.0), 1, 5)
    yield _candidate("command_latency", "delay", (0.02, 0.06, 0.15), 0, 0.4)


def _candidate(
    effect: str,
    parameter: str,
    grid: tuple[float, ...],
    low: float,
    high: float,
    *,
    part: str = "",
    stem: str = "",
    **more: Any,
) -> Candidate:
    about = next(p for p in registry.get(effect).parameters if p.name == parameter)
    name = f"{stem or effect}[{part}]" if part else stem or effect
    return Candidate(
        name=name,
        effect=effect,
        parameter=parameter,
        unit=about.unit,
        nominal=about.nominal,
        low=low,
        high=high,
        grid=grid,
        aliases=_ALIASES.get(name, ()),
        excite=EXCITE.get(effect, "walking"),
        **more,
    )
