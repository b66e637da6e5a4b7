"""A robot that is a little different from its model everywhere: the gap of a prior.

Real machines depart from their models in many ways at once, by a little each: they
carry more, grip less, their servos are softer and read a bit wrong, commands come
late. The draw is fixed by its seed, and `OFF` says how large it is for each robot, so
that the best walks of its repertoire lose 20 to 30 % (`python -m bench prior-off`).
The learner's model stays nominal; the world has these effects as its reality.
"""

from bns import seeding
from bns.errors import UnknownNameError

OFF = {"phantomx": (1, 0.6)}
"""robot -> seed and size of its gap"""
SERVOS = (
    "left_front_femur",
    "right_middle_coxa",
    "right_rear_tibia",
    "left_middle_femur",
)
"""whose encoders read wrong"""


def drawn(seed: int, size: float) -> tuple[str, ...]:
    """Effects of a hexapod that differs from its model.

    Args:
        seed: of the draw.
        size: 0 = none; 1 = as large as assumed below, on average.

    Returns:
        Texts, as the setting `world.reality` takes them.
    """
    rng = seeding.generator(seed, "mismatch")
    much = size * rng.uniform(0.5, 1.5, 4)
    x, y = 0.05 * rng.uniform(-1, 1, 2)
    turned = 0.1 * size * rng.uniform(0.5, 1.5, len(SERVOS))
    signs = rng.choice([-1, 1], len(SERVOS))
    found = [
        f"payload:mass={0.3 * much[0]:.4g},x={x:.4g},y={y:.4g}",
        f"floor_friction:factor={max(1 - 0.3 * much[1], 0.05):.4g}",
        f"servo_gain:factor={max(1 - 0.3 * much[2], 0.05):.4g}",
        f"servo_delay:delay={0.04 * much[3]:.4g}",
    ]
    for servo, angle in zip(SERVOS, turned * signs, strict=True):
        found.append(f"servo_offset:servo={servo},angle={angle:.4g}")
    return tuple(found) if size else ()


def reality(robot: str) -> tuple[str, ...]:
    """The gap of a robot's prior, fixed.

    Raises:
        UnknownNameError: none was drawn for it.
    """
    if robot not in OFF:
        raise UnknownNameError("robot with a fixed gap", robot, OFF)
    return drawn(*OFF[robot])
