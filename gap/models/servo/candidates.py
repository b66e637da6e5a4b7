"""What may explain a gap of a servo: every servo effect with its magnitudes."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.gap.records import Candidate
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


def candidates(names: Sequence[str] = tuple(_GRIDS)) -> tuple[Candidate, ...]:
    """Candidates for servo effects.

    Args:
        names: of effects; quantisation of the encoder is left out by default, as it
            moves nothing.
    """
    return tuple(_candidate(name) for name in names)


def _candidate(name: str) -> Candidate:
    parameter = registry.get(name).parameters[0]
    return Candidate(
        name=name,
        effect=name,
        parameter=parameter.name,
        unit=parameter.unit,
        nominal=parameter.nominal,
        low=parameter.low,
        high=parameter.high,
        grid=_GRIDS[name],
        scale="log" if parameter.nominal >= 1.0 else "linear",
        aliases=_ALIASES.get(name, ()),
        excite=_EXCITE.get(name, SLOW),
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
