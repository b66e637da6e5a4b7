"""A first model of a robot with two driven wheels, from a handful of its numbers.

A box on two wheels and a ball. What has to be known are two lengths, the mass and the
top speed; the rest is computed from them or assumed, and `numbers.toml` says which.
Where an assumption is off, a recording of the robot and the gap diagnosis tell.
"""

import math
from dataclasses import asdict, dataclass
from pathlib import Path

from bns.errors import BnsError, OutOfBoundsError
from bns.models.directory import make, named, short, texts
from bns.models.new_legged import box

GRAVITY = 9.81  # [m/s2]
FRICTION = 0.8  # rubber on a board; assumed
WHEEL = 0.03  # share of the mass in each wheel; assumed
ROTOR = 0.2  # armature over the body's inertia as a wheel feels it; assumed
RISE = 0.03  # [s] in which wheels come up to speed; assumed
GRIP = 2.0  # largest torque over that at which a wheel slips; assumed
BACK, UP = 0.05, 0.35  # shares of length and height at which the mass lies; assumed
BALL = 0.2  # radius of the ball over the wheel's; assumed
CLEAR = 0.03  # height of the nose over the length; assumed
EYES = 0.9  # height of the light sensors over the body's; assumed
HEADINGS = {
    "ir_left_90": 85.0,
    "ir_left_45": 45.0,
    "ir_front_left": 10.0,
    "ir_front_right": -10.0,
    "ir_right_45": -45.0,
    "ir_right_90": -85.0,
    "ir_back_right": -129.2,
    "ir_back_left": 129.2,
}
"""[deg] of light sensors, around the body; those of a Khepera III, assumed"""

FILES = {
    "{name}.xml": "wheeled.xml.jinja",
    "scene.xml": "wheeled_scene.xml.jinja",
    "robot.toml": "wheeled_robot.toml.jinja",
    "numbers.toml": "wheeled_numbers.toml.jinja",
}
LENGTH = (0.01, 10.0, "m")
NEEDED = {
    "wheel_radius": (0.001, 2.0, "m"),
    "axle_length": LENGTH,
    "mass": (0.001, 2000.0, "kg"),
    "top_speed": (0.001, 50.0, "m/s"),
}
OPTIONAL = dict.fromkeys(("length", "width", "height"), LENGTH)


@dataclass(frozen=True, kw_only=True)
class Wheeled:
    """What is known of the robot.

    Raises:
        BnsError: a number that no such robot has; wheels larger than the axle.
    """

    wheel_radius: float
    """of the driven wheels [m]"""
    axle_length: float
    """between the middles of the driven wheels [m]"""
    mass: float
    """of the whole robot [kg]"""
    top_speed: float
    """of a wheel over the floor [m/s]"""
    length: float = 0.0
    """of the body [m]; 0 = as long as the axle"""
    width: float = 0.0
    """of the body [m]; 0 = 0.7 times the axle"""
    height: float = 0.0
    """of the body above the floor [m]; 0 = a wheel's radius and half the axle"""

    light_sensors: bool = False
    """eight of them around the body, for the world `light`"""

    def __post_init__(self) -> None:
        for name, bounds in {**NEEDED, **OPTIONAL}.items():
            value = getattr(self, name)
            if value == 0 and name in OPTIONAL:
                continue
            if not bounds[0] <= value <= bounds[1]:
                raise OutOfBoundsError(name, value, *bounds)
        if self.wheel_radius > self.axle_length:
            raise BnsError(
                f"Wheels of radius {self.wheel_radius} m do not go on an axle of "
                f"{self.axle_length} m: give both in metres, the axle from wheel to "
                "wheel."
            )

    @property
    def box(self) -> tuple[float, float, float]:
        """Length, width and height [m]."""
        return (
            self.length or self.axle_length,
            self.width or 0.7 * self.axle_length,
            self.height or self.wheel_radius + 0.5 * self.axle_length,
        )


def write(directory: Path, known: Wheeled) -> None:
    """Make the directory of a robot, named as the directory is.

    Raises:
        BnsError: a name that no model can have; something is there already.
    """
    name = named(directory)
    content = {"name": name, **asdict(known), **_numbers(known), **_looks(known)}
    content["eyes"] = _eyes(known) if known.light_sensors else {}
    make(directory, texts(name, FILES, content))


def _numbers(known: Wheeled) -> dict[str, float | list[float]]:
    """What numbers.toml lists, beside what is known."""
    length, _, height = known.box
    radius, wheel = known.wheel_radius, WHEEL * known.mass
    body, spin = known.mass - 2 * wheel, wheel * radius**2 / 2
    felt = known.mass / 2 * radius**2  # by one wheel, when the robot speeds up
    ball = BALL * radius
    made: dict[str, float | list[float]] = {
        "body_mass": body,
        "inertia": box(body, known.box),
        "centre_of_mass": [-BACK * length, 0.0, UP * height],
        "wheel_mass": wheel,
        "wheel_spin_inertia": spin,
        "wheel_tilt_inertia": 0.6 * spin,  # of a disc a third as thick as its radius
        "ball_radius": ball,
        "ball_position": ball - length / 2,
        "nose_position": length / 2 - ball,
        "nose_height": ball + CLEAR * length,
        "torque_limit": GRIP * FRICTION * known.mass / 2 * GRAVITY * radius,
        "servo_gain": (felt * (1 + ROTOR) + spin) / RISE,
        "armature": ROTOR * felt,
    }
    exact: dict[str, float | list[float]] = {
        "wheel_speed_limit": known.top_speed / radius,
        "wheel_friction": FRICTION,
        "half_axle": known.axle_length / 2,
    }
    return {name: short(value) for name, value in made.items()} | exact


def _eyes(known: Wheeled) -> dict[str, dict[str, list[float]]]:
    """Where each light sensor sits on the body, and the direction in which it looks."""
    length, width, height = known.box
    found = {}
    for name, heading in HEADINGS.items():
        ahead = math.cos(math.radians(heading)), math.sin(math.radians(heading))
        way = min(length / 2 / abs(ahead[0]), width / 2 / abs(ahead[1]))
        place = [way * ahead[0], way * ahead[1], EYES * height]
        found[name] = {"position": short(place), "ahead": [*ahead, 0.0]}
    return found


def _looks(known: Wheeled) -> dict[str, float | list[float]]:
    """What only shows: half sizes, places, the camera."""
    length, width, height = known.box
    low, size = 0.5 * known.wheel_radius, max(length, known.axle_length, height)
    made: dict[str, float | list[float]] = {
        "tyre": known.wheel_radius / 6,
        "lens": 0.02 * known.axle_length,
        "box": [length / 2, width / 2, (height - low) / 2],
        "middle": (height + low) / 2,
        "top": height,
        "mark": [0.05 * length, 0.05 * length, 0.01 * length],
        "ahead": 0.4 * length,
        "extent": 2 * size,
        "camera": [2.8 * size, -2.3 * size, 1.6 * size],
    }
    return {name: short(value) for name, value in made.items()}
