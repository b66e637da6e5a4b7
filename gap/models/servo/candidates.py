"""What may explain a gap of a servo: every servo effect with its magnitudes."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect, ServoEffect
from bns.worlds.physics.servo_law import Law

SLOW = "a slow sweep at low gain"
FAST = "a fast sweep or a step"
DROP = "lift, then let fall with the motor off"

_RATIO = tuple(np.geomspace(1 / 3, 3, 17))
_GRIDS: dict[str, tuple[float, ...]] = {
    "servo_payload": tuple(np.linspace(-1.2, 1.2, 17)),
    "servo_lever": tuple(np.geomspace(0.5, 2.0, 17)),
    "servo_gain": tuple(np.geomspace(0.1, 10, 23)),
    "servo_voltage": _RATIO,
    "servo_torque_constant": _RATIO,
    "servo_coulomb": (-0.15, -0.08, -0.04, 0.04, 0.08, 0.15, 0.3, 0.6),
    "servo_viscous": (-0.06, -0.03, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0),
    "servo_stribeck": (-0.1, -0.05, 0.05, 0.1, 0.2, 0.4, 0.8),
    "servo_load_friction": (-0.1, -0.05, 0.05, 0.1, 0.2, 0.3, 0.45),
    "servo_armature": (-0.02, -0.01, 0.01, 0.02, 0.04, 0.08, 0.16),
    "servo_delay": (-0.02, -0.01, 0.01, 0.02, 0.04, 0.08, 0.16, 0.3),
    "servo_lag": (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.3),
    "servo_duty_limit": (0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7),
    "servo_current_limit": (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.5),
    "servo_backlash": (0.005, 0.01, 0.02, 0.04, 0.08, 0.15),
    "servo_dead_zone": (0.005, 0.01, 0.02, 0.04, 0.08, 0.15),
    "servo_offset": (-0.3, -0.15, -0.08, -0.04, 0.04, 0.08, 0.15, 0.3),
}
_EXCITE = {
    "servo_payload": SLOW,
    "servo_lever": DROP,
    "servo_armature": DROP,
    "servo_viscous": DROP,
    "servo_delay": FAST,
    "servo_lag": FAST,
    "servo_duty_limit": FAST,
    "servo_current_limit": FAST,
    "servo_backlash": "reversals at low load",
    "servo_dead_zone": SLOW,
    "servo_voltage": "a step large enough to saturate the drive",
}
_ALIASES = {"servo_gain": ("servo_voltage",), "servo_voltage": ("servo_gain",)}
"""the same effect while the duty does not saturate, whatever is commanded"""


_SD = {
    "servo_payload": 0.3,
    "servo_lever": 0.15,
    "servo_gain": 0.5,
    "servo_voltage": 0.3,
    "servo_torque_constant": 0.3,
    "servo_coulomb": 0.1,
    "servo_viscous": 0.1,
    "servo_stribeck": 0.1,
    "servo_load_friction": 0.1,
    "servo_armature": 0.02,
    "servo_delay": 0.03,
    "servo_lag": 0.03,
    "servo_backlash": 0.03,
    "servo_dead_zone": 0.03,
    "servo_offset": 0.05,
}
"""plausible departures (standard deviation; assumed); the others are limits"""


def candidates(names: Sequence[str] = tuple(_GRIDS)) -> tuple[Row, ...]:
    """Numbers of a servo that may be off, with the values that are tried.

    Args:
        names: of effects; quantisation of the encoder is left out by default, as it
            moves nothing.
    """
    return tuple(_row(name) for name in names)


def ratio(row: Row) -> bool:
    """Whether its values are ratios, which span decades."""
    return row.nominal >= 1.0


def _row(name: str) -> Row:
    parameter = registry.get(name).parameters[0]
    nominal = float(parameter.nominal)
    return Row(
        name=name,
        nominal=nominal,
        sd=_SD.get(name, 0.3),
        low=parameter.low,
        high=parameter.high,
        unit=parameter.unit,
        levels=_GRIDS[name],
        smooth=name in _SD,
        step=0.25 * _SD.get(name, 0.3),
        excite=_EXCITE.get(name, SLOW),
        effect=name,
        parameter=parameter.name,
        aliases=_ALIASES.get(name, ()),
    )


def columns(law: Law, sets: Sequence[Sequence[Effect]]) -> Law:
    """A law with one column per set of effects.

    Args:
        law: arrays ``(R, 1)`` or scalars.
        sets: E sets of servo effects, each applied in order.

    Returns:
        Arrays ``(R, E)`` where the sets differ, else as given.

    Raises:
        BnsError: an effect that does not act on a servo.
    """
    made = []
    for effects in sets:
        changed = law
        for effect in effects:
            if not isinstance(effect, ServoEffect):
                raise BnsError(
                    f"{effect} does not act on a servo; take effects whose name begins "
                    "with servo_ (`bns effects`)."
                )
            changed = effect.change(changed)
        made.append(changed)
    result = {}
    for name, value in law.items():
        if all(item[name] is value for item in made):
            result[name] = value
            continue
        rows = np.broadcast_arrays(*(np.atleast_2d(item[name]) for item in made))
        result[name] = np.concatenate(rows, axis=1)
    return result
