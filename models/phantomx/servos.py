"""The hexapod's servos: names, identities on the bus, and goals as registers.

Columns of goals go by the numbers of legs (`bns.models.legs`): coxa, femur, tibia of
leg 1, then of leg 2 and so on. Goals are angles from half-way [rad] with signs alike
for all legs: coxa forward, femur up, tibia outward.
"""

from types import MappingProxyType

import numpy as np

from bns.models import ax12a
from bns.models.legs import JOINTS

IDS = MappingProxyType(
    dict(
        zip(
            JOINTS,
            (1, 3, 5, 2, 4, 6, 7, 9, 11, 8, 10, 12, 13, 15, 17, 14, 16, 18),
            strict=True,
        )
    )
)
"""joint -> identity of its servo (maker's firmware NUKE)"""

SIGNS = np.array([-1 if joint.startswith("left") else 1 for joint in JOINTS])
"""of the register against the angle, shape ``(18,)`` (NUKE, nuke.cpp, hex-mk2.ppr)"""


def registers(goals: np.ndarray) -> np.ndarray:
    """Goal registers (0 to 1023) for goals [rad], shape ``(..., 18)``."""
    return ax12a.units(np.asarray(goals) * SIGNS)


def goals(registers: np.ndarray) -> np.ndarray:
    """Goals [rad] that registers stand for, shape ``(..., 18)``."""
    return ax12a.angle(registers) * SIGNS
