"""What the light sensors of a robot are called, and where they sit.

Effects and the world `light` know sensors by these names, the Khepera III's; a robot
with fewer has some of them. They are sites of the model that look along their z.
"""

from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.models import mjcf
from bns.models.robot_model import RobotModel

SIDES = {
    "left": ("ir_left_90", "ir_left_45", "ir_front_left"),
    "right": ("ir_right_90", "ir_right_45", "ir_front_right"),
}
"""forward sensors; the mean of a side's is what its virtual sensor reads"""

BEHIND = ("ir_back_left", "ir_back_right", "ir_back")
NAMES = (*SIDES["left"], *SIDES["right"], *BEHIND)
NUMBERS = ("exponent", "full_light", "light_noise", "count_noise")
"""that a robot may have of its own, in `[light]`; `bns.worlds.light.sensors` says what
they are"""

GROUND = "ground"  # in the name of a site that looks at the floor, no light sensor
LEVEL = 0.1  # a light sensor's heading rises or falls by no more than this; assumed


class Site(NamedTuple):
    """Where a sensor sits at home, in the robot's frame.

    Attributes:
        position: x, y, z [m].
        heading: counter-clockwise from forward [deg].
        rise: sine of the angle by which it looks up.
    """

    position: np.ndarray
    heading: float
    rise: float


def present(sites: Iterable[str]) -> tuple[str, ...]:
    """The light sensors among a robot's sensor sites, in their order."""
    return tuple(name for name in sites if name in NAMES)


def twin(name: str) -> str:
    """The sensor on the other side, "ir_front_right" for "ir_front_left"."""
    sides = {"left": "right", "right": "left"}
    return "_".join(sides.get(part, part) for part in name.split("_"))


@cache
def placed(robot: RobotModel) -> dict[str, Site]:
    """The light sensors of a robot, by name.

    Raises:
        FormatError: MuJoCo cannot read the model.
        BnsError: it has no such site.
    """
    import mujoco

    model = mjcf.robot_spec(robot, scene=False, visuals=False, options={}).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = {}
    for name in present(robot.sensor_sites):
        try:
            site = data.site(name)
        except KeyError as error:
            raise BnsError(
                f"Robot {robot.name!r} has no site {name!r}, which its robot.toml "
                "lists: add it, or take it from the list."
            ) from error
        ahead = site.xmat.reshape(3, 3)[:, 2]
        heading = np.degrees(np.arctan2(ahead[1], ahead[0]))
        found[name] = Site(
            np.round(site.xpos, 9), round(float(heading), 6), float(ahead[2])
        )
    return found


def faults(robot: RobotModel) -> list[str]:
    """Why a robot's light sensors can not be used, one line each; none = they can."""
    names = present(robot.sensor_sites)
    strange = [
        f"sensor site {name!r} is none of {', '.join(NAMES)}, nor has it {GROUND!r} in "
        "its name"
        for name in robot.sensor_sites
        if name not in NAMES and GROUND not in name
    ]
    wrong = [
        f"[light] {name} = {value} is no number above 0"
        for name, value in robot.light.items()
        if name in NUMBERS and not (isinstance(value, float | int) and value > 0)
    ]
    unknown = set(robot.light) - {*NUMBERS, "headings"}
    wrong += [
        f"[light] {name} is none of {', '.join(NUMBERS)}" for name in sorted(unknown)
    ]
    if not names:
        return strange + wrong
    lone = [
        f"sensor {name!r} has no twin {twin(name)!r}"
        for name in names
        if twin(name) not in names
    ]
    if not set(names) & set(SIDES["left"]):
        lone.append("no sensor looks forward: none of " + ", ".join(SIDES["left"]))
    askew = [
        f"sensor {name!r} looks up or down: turn the site so that its z is level"
        for name, site in placed(robot).items()
        if abs(site.rise) > LEVEL
    ]
    return strange + wrong + lone + askew
