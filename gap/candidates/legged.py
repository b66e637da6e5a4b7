"""Numbers of a walking robot that may be off, and how far they plausibly are."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.legged.signs import Signs, Suspects
from bns.models.legs import JOINTS, LEGS, names, parts
from bns.worlds.effects import registry

SHARE = 0.01  # slack of a number over its plausible departure; assumed
STEP = 0.25  # of a plausible departure, for differences: feet come down in steps
NO_SIGNS = Signs()
SERVO_SLACK = 0.03  # of a gain or a voltage, how well all servos are known together

# effect, parameter, plausible departure (standard deviation), low, high, settings; all
# assumed. Slack is that of all legs together. Load-dependent friction is left out: in a
# joint of MuJoCo it is dry friction by another name; quantisation moves nothing.
_SERVOS: tuple[tuple[str, str, float, float, float, dict[str, Any]], ...] = (
    ("servo_gain", "factor", 0.4, 0.1, 5, {"slack": SERVO_SLACK, "levels": (0.4,)}),
    ("servo_voltage", "factor", 0.25, 0.3, 2, {"slack": SERVO_SLACK}),
    ("servo_torque_constant", "factor", 0.25, 0.3, 2, {}),
    ("servo_coulomb", "torque", 0.15, -0.05, 0.8, {}),
    ("servo_viscous", "coefficient", 0.2, 0, 1, {}),
    ("servo_armature", "inertia", 0.02, 0, 0.1, {}),
    ("servo_delay", "delay", 0.06, 0, 0.4, {"step": 0.012}),
    ("servo_lag", "time_constant", 0.08, 0, 0.5, {"step": 0.012, "levels": (0.07,)}),
    ("servo_duty_limit", "factor", 0.3, 0.02, 1, {"levels": (0.08, 0.2, 0.4, 0.7)}),
    ("servo_offset", "angle", 0.1, -0.3, 0.3, {}),
)  # fmt: skip
PLAY = (0.06, 0.18, 0.45)  # [rad] of a horn, of which no slope tells
HIDDEN = ("servo_offset",)
"""what a servo's own reading does not show, but its leg's place: every joint counts"""
_BODY: tuple[tuple[str, str, float, float, float, dict[str, Any]], ...] = (
    ("payload", "mass", 0.5, 0, 2, {"slack": 0.02}),
    ("centre_of_mass", "dx", 0.015, -0.03, 0.03, {}),
    ("centre_of_mass", "dy", 0.015, -0.03, 0.03, {}),
    ("floor_compliance", "factor", 1.5, 1, 5, {}),
    ("command_latency", "delay", 0.06, 0, 0.4, {"step": 0.012}),
)
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


def rows(
    found: Suspects,
    joints: Sequence[str] = JOINTS,
    signs: Signs = NO_SIGNS,
) -> tuple[Row, ...]:
    """All numbers that may be off, in a fixed order.

    Args:
        found: joints and legs that are suspected beside all of them.
        joints: that the robot has.
        signs: what the servos say of legs that hold, hang or are gone.
    """
    return (
        *_servos(found, joints),
        *_legs(joints),
        *_horns(joints),
        *(_row(*entry[:5], **entry[5]) for entry in _BODY),
        *_slope(),
        *lost(signs),
    )


def unsure(joints: Sequence[str] = JOINTS) -> tuple[Row, ...]:
    """Numbers of all legs together that even a sound robot's model is unsure of."""
    shin = f"link_length[{parts(joints)[-1]},all]"
    names_ = ("servo_gain[all]", "servo_voltage[all]", "foot_slippery[all]", "payload")
    every = rows(Suspects((), (), True), joints)
    return tuple(row for row in every if row.name in (*names_, shin))


def known(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Rows without the slack of what all legs share, where what that slack does to a
    walk is told otherwise (`bns.gap.models.legged.scatter`): not twice."""
    return tuple(_told(row) if row.slack > SHARE * row.sd else row for row in rows)


def _told(row: Row) -> Row:
    return replace(row, slack=SHARE * row.sd, unsure=row.slack)


def lost(signs: Signs) -> tuple[Row, ...]:
    """Legs and joints that may be lost, by what servos say of them."""
    return (
        *_legwise("leg_raised", "blend", (0.5, 1.0), signs.raised),
        *_locked(signs.held),
        *_legwise("leg_limp", "loss", (0.5, 1.0), signs.limp),
        *_legwise("leg_missing", "loss", (1.0,), signs.unloaded),
    )


def _servos(found: Suspects, joints: Sequence[str]) -> Iterable[Row]:
    for effect, parameter, sd, low, high, settings in _SERVOS:
        more = dict(settings)
        slack = more.pop("slack", 0.0)
        everywhere = ("all",) if found.all or slack else ()
        near = joints if effect in HIDDEN else found.joints
        for servo in (*everywhere, *found.legs, *near):
            yield _row(
                effect, parameter, sd, low, high, part=servo, fixed={"servo": servo},
                slack=slack if servo == "all" else 0.0, **more,
            )  # fmt: skip


def _legs(joints: Sequence[str]) -> Iterable[Row]:
    moved = parts(joints)
    for leg in ("all", *names(joints)):
        number = "all" if leg == "all" else str(LEGS.index(leg) + 1)
        for part in moved:
            yield _row(
                "link_length", "factor", 0.06, 0.8, 1.25, part=f"{part},{leg}",
                fixed={"part": part, "legs": number},
                slack=0.005 if (part, leg) == (moved[-1], "all") else 0.0,
            )  # fmt: skip
        yield _row(
            "foot_slippery", "factor", 0.4, 0.02, 2, part=leg, fixed={"legs": number},
            slack=0.1 if leg == "all" else 0.0, levels=(0.1, 0.3),
        )  # fmt: skip


def _horns(joints: Sequence[str]) -> Iterable[Row]:
    for joint in joints:
        yield _row(
            "loose_horn", "angle", 0.15, 0, 0.6, part=joint, fixed={"joint": joint},
            smooth=False, levels=PLAY,
        )  # fmt: skip


def _slope() -> Iterable[Row]:
    for axis in "xy":
        yield Row(
            f"floor_slope.{axis}", 0.0, 0.07, -0.35, 0.35, unit="rad",
            group="floor_slope", excite=EXCITE["floor_slope"], effect="floor_slope",
            parameter=axis,
        )  # fmt: skip


def _locked(held: Mapping[str, float]) -> Iterable[Row]:
    for joint, angle in held.items():
        fixed = {"joint": joint, "angle": float(np.clip(angle, -1.5, 1.5))}
        yield _whole("joint_locked", "loss", (0.5, 1.0), joint, fixed)


def _legwise(
    effect: str, parameter: str, levels: tuple[float, ...], legs: Sequence[str]
) -> Iterable[Row]:
    for leg in legs:
        fixed = {"legs": str(LEGS.index(leg) + 1)}
        yield _whole(effect, parameter, levels, leg, fixed)


def _whole(
    effect: str,
    parameter: str,
    levels: tuple[float, ...],
    part: str,
    fixed: Mapping[str, Any],
) -> Row:
    """A loss, which has no slope: a leg stands or it does not."""
    return _row(
        effect, parameter, 0.5, 0, 1, part=part, fixed=fixed, smooth=False,
        stepped=len(levels) == 1, levels=levels,
    )  # fmt: skip


def _row(
    effect: str,
    parameter: str,
    sd: float,
    low: float,
    high: float,
    *,
    part: str = "",
    **more: Any,
) -> Row:
    known = registry.get(effect).parameters
    about = next(p for p in known if p.name == parameter)
    stem = f"{effect}.{parameter}" if effect == "centre_of_mass" else effect
    name = f"{stem}[{part}]" if part else stem
    return Row(
        name=name,
        nominal=float(about.nominal),
        sd=sd,
        low=low,
        high=high,
        unit=about.unit,
        aliases=_ALIASES.get(name, ()),
        excite=EXCITE.get(effect, "walking"),
        effect=effect,
        parameter=parameter,
        **{"step": STEP * sd, **more, "slack": more.get("slack") or SHARE * sd},
    )
