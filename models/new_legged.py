"""What is known of a robot that walks: a handful of its numbers, and what they imply.

A box on four or six legs of two or three servos each. What has to be known are the
mass, the body's length and width, and the lengths of the legs' parts; the rest has
defaults, those of the PhantomX where it has them. `legged_files` makes the directory.

Masses and shapes are computed: a shin is its servo, at the knee, and a rod; a part
before it a box; so is the body.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from bns.errors import BnsError, OutOfBoundsError
from bns.models.ax12a import MASS
from bns.models.directory import short
from bns.models.legs import LEGS, PARTS

AX12A = "ax12a"
COUNTS = (4, 6)
LENGTH, ANGLE = (0.005, 2.0, "m"), (-1.0, 1.0, "rad")
NEEDED = {
    "mass": (0.05, 200.0, "kg"),
    "body_length": LENGTH,
    "body_width": LENGTH,
    "femur_length": LENGTH,
}
OPTIONAL = {
    **dict.fromkeys(("coxa_length", "tibia_length", "body_height"), LENGTH),
    **dict.fromkeys(("hip_length", "hip_width", "middle_width"), LENGTH),
    "stance_height": LENGTH,
    "leg_mass": (0.001, 50.0, "kg"),
    "femur_angle": ANGLE,
    "leg_spread": (0.0, 1.5708, "rad"),
}
SPREAD = 0.7854  # [rad], 45 deg; assumed
STOPS = (0.3, 2.6, "rad")  # an AX-12A turns by 2.6 rad from half-way
HEIGHT = 0.4  # of the body over its width; assumed
HIPS = 0.875  # distance of front and rear hips over the body's length; assumed
STANCE = 0.75  # sine of the angle at which a leg stands; assumed
STEEP = (0.1, 0.98)  # sines between which that has to be; assumed
CLEAR = 0.005  # [m] that has to be between belly and floor; assumed
SHARES = {2: 0.4, 3: 0.55}  # of the mass in the legs, by joints; the PhantomX's
BODY = 0.1  # smallest share of the mass that the body may have; assumed
THIGH, SHIN, FOOT = 0.072, 0.048, 0.028  # radii over a leg's length; the PhantomX's


@dataclass(frozen=True, kw_only=True)
class Legged:
    """What is known of the robot.

    Raises:
        OutOfBoundsError: a number that no robot here can have.
        BnsError: numbers of legs and joints with which none walks; legs that do not
            reach the floor, hips without room, legs that weigh more than the robot.
    """

    legs: int
    """how many, 4 or 6"""
    mass: float
    """of the whole robot [kg]"""
    body_length: float
    """of the body, a box [m]"""
    body_width: float
    """of the body [m]"""
    femur_length: float
    """from the axis that lifts the leg to the knee, or to the foot's tip if legs have
    no tibia [m]"""
    coxa_length: float = 0.0
    """from the axis that swings the leg forward to the one that lifts it [m]; 0 = legs
    do not swing: a femur at the hip and a tibia at the knee"""
    tibia_length: float = 0.0
    """from the knee to the foot's tip [m]; 0 = no knee: a coxa and a femur"""
    body_height: float = 0.0
    """of the body [m]; 0 = 0.4 times its width"""
    hip_length: float = 0.0
    """between front and rear hips [m]; 0 = 7/8 of the body's length"""
    hip_width: float = 0.0
    """between left and right hips [m]; 0 = the body's width"""
    middle_width: float = 0.0
    """between the middle hips of six legs [m]; 0 = as between the others"""
    stance_height: float = 0.0
    """of the hips over the feet with all servos half-way [m]; 0 = what stands on the
    floor, tibia or femur, reaches 0.75 times its length down"""
    femur_angle: float = 0.0
    """of the femur half-way, above the level, if there is a tibia [rad]"""
    leg_spread: float = SPREAD
    """by which front legs look ahead of sideways half-way, and rear ones back [rad]"""
    leg_mass: float = 0.0
    """of a leg from the coxa outwards [kg]; 0 = all have 55 % of the mass together,
    with two joints 40 %"""
    stops: float = 1.4
    """to which servos turn from half-way, either way [rad]"""
    servo: str = AX12A
    """ax12a, or a file with the law of other servos, see docs/your_robot.md"""

    def __post_init__(self) -> None:
        if self.legs not in COUNTS:
            raise BnsError(
                f"legs = {self.legs} is not possible: legs stand in pairs, two feet do "
                "not hold a robot up, and there are names for six. Give 4 or 6."
            )
        for name, bounds in {**NEEDED, **OPTIONAL, "stops": STOPS}.items():
            value = getattr(self, name)
            if value == 0 and name in OPTIONAL:
                continue
            if not bounds[0] <= value <= bounds[1]:
                raise OutOfBoundsError(name, value, *bounds)
        self._refuse_parts()
        self._refuse_heights()
        self._refuse_hips()
        self._refuse_masses()

    @property
    def names(self) -> tuple[str, ...]:
        """Of its legs, in the order of their numbers."""
        return LEGS[: self.legs]

    @property
    def lengths(self) -> dict[str, float]:
        """Of the parts that move [m], from the body outwards."""
        every = {part: getattr(self, f"{part}_length") for part in PARTS}
        return {part: length for part, length in every.items() if length}

    @property
    def outer(self) -> str:
        """The part that the foot belongs to."""
        return tuple(self.lengths)[-1]

    @property
    def height(self) -> float:
        """Of the body [m]."""
        return self.body_height or HEIGHT * self.body_width

    @property
    def stance(self) -> float:
        """Height of the hips over the feet half-way [m]."""
        return self.stance_height or STANCE * self.lengths[self.outer] - self._knee

    @property
    def slope(self) -> float:
        """Of the part that stands on the floor half-way, below the level [rad]."""
        return math.asin((self.stance + self._knee) / self.lengths[self.outer])

    @property
    def hips(self) -> dict[str, tuple[float, float]]:
        """Places of the hips on the body [m], by leg."""
        ahead = (self.hip_length or HIPS * self.body_length) / 2
        width = self.hip_width or self.body_width
        ends = {"front": ahead, "rear": -ahead, "middle": 0.0}
        aside = {**dict.fromkeys(ends, width), "middle": self.middle_width or width}
        made = {}
        for leg in self.names:
            side, _, end = leg.rpartition("_")
            half = aside[end] / 2
            made[leg] = (ends[end], half if side == "left" else -half)
        return made

    @property
    def each_leg(self) -> float:
        """What a leg weighs [kg]."""
        shared = SHARES[len(self.lengths)] * self.mass / self.legs
        return self.leg_mass or shared

    @property
    def thick(self) -> float:
        """Of a leg at the hip [m]."""
        return 2 * THIGH * sum(self.lengths.values())

    def radius(self, part: str) -> float:
        """Of what touches of a part of a leg, or of its foot [m]."""
        share = {"foot": FOOT, self.outer: SHIN}.get(part, THIGH)
        return share * sum(self.lengths.values())

    @property
    def _knee(self) -> float:
        """Height of the knee over the hip half-way [m]; without a tibia 0."""
        if self.outer == "femur":
            return 0.0
        return self.femur_length * math.sin(self.femur_angle)

    def _refuse_parts(self) -> None:
        if len(self.lengths) < 2:
            raise BnsError(
                "A leg of one servo cannot walk here: give --coxa-length (it swings "
                "forward), --tibia-length (it has a knee), or both."
            )
        if self.femur_angle and self.outer == "femur":
            raise BnsError(
                f"femur_angle = {self.femur_angle} has no meaning without a tibia: the "
                "femur stands on the floor, give --stance-height."
            )
        if self.middle_width and self.legs < 6:
            raise BnsError(
                f"middle_width = {self.middle_width} is for six legs; leave it out, or "
                "give --legs 6."
            )

    def _refuse_heights(self) -> None:
        length = self.lengths[self.outer]
        low, high = (share * length - self._knee for share in STEEP)
        if not low <= self.stance <= high:
            raise BnsError(
                f"With hips {self.stance:.4g} m over the feet a {self.outer} of "
                f"{length} m does not stand: give --stance-height from "
                f"{max(low, CLEAR):.3g} to {high:.3g} m, or another length."
            )
        if self.stance < self.height / 2 + CLEAR:
            raise BnsError(
                f"A body of {self.height:.4g} m in height does not clear the floor "
                f"with hips {self.stance:.4g} m over it: give a lower --body-height, "
                f"or a higher --stance-height (up to {high:.3g} m)."
            )

    def _refuse_hips(self) -> None:
        places = list(self.hips.items())
        for number, (leg, here) in enumerate(places):
            for other, there in places[:number]:
                apart = math.dist(here, there)
                if apart < self.thick:
                    raise BnsError(
                        f"The hips of {other} and {leg} are {apart:.3g} m apart, and "
                        f"legs of that length {self.thick:.3g} m thick: give a larger "
                        "body, or hips farther apart (--hip-length, --hip-width)."
                    )

    def _refuse_masses(self) -> None:
        if self.legs * self.each_leg > (1 - BODY) * self.mass:
            raise BnsError(
                f"{self.legs} legs of {self.each_leg:.4g} kg leave a robot of "
                f"{self.mass} kg no body: give the mass of all of it as --mass, and of "
                "one leg as --leg-mass."
            )
        servos = self.legs * len(self.lengths)
        if self.servo == AX12A and self.mass < servos * MASS:
            raise BnsError(
                f"{servos} AX-12A servos alone weigh {servos * MASS:.2f} kg, the robot "
                f"{self.mass} kg: give its mass with servos, or --servo FILE with the "
                "law of smaller ones."
            )


ROWS = ("front", "middle", "rear")
PART_SHARES = {
    2: (0.3, 0.7),
    3: (0.19, 0.38, 0.43),
}  # of a leg's mass, by part; PhantomX's
SERVO = 0.6  # share of a shin's mass that its servo is; PhantomX's
KNEE, ROD = 0.165, 0.5  # where on the shin servo and rod have their centres; PhantomX's
CENTRE = SERVO * KNEE + (1 - SERVO) * ROD


def box(mass: float, sides: Sequence[float]) -> list[float]:
    """About the axes through a box's middle [kg m2].

    Args:
        mass: [kg].
        sides: its length, width and height [m].
    """
    squares = [side * side for side in sides]
    return [mass / 12 * (sum(squares) - square) for square in squares]


def masses(known: Legged) -> dict[str, Any]:
    """What numbers.toml lists of them.

    Returns:
        masses: by part, each with mass [kg], centre [m] and inertia [kg m2], share of
            the leg [%], and in words where the centre is and whose inertia that is.
        body_mass: [kg].
        body_inertia: [kg m2].
    """
    shares = PART_SHARES[len(known.lengths)]
    made = {
        part: {"share": round(100 * share), **_part(known, part, share)}
        for part, share in zip(known.lengths, shares, strict=True)
    }
    body = known.mass - known.legs * sum(item["mass"] for item in made.values())
    size = known.body_length, known.body_width, known.height
    around = short(box(body, size))
    return {"masses": made, "body_mass": short(body), "body_inertia": around}


def _part(known: Legged, part: str, share: float) -> dict[str, Any]:
    mass, length, thick = share * known.each_leg, known.lengths[part], known.thick
    if part != known.outer:
        return {
            "mass": short(mass),
            "centre": short(length / 2),
            "inertia": short(box(mass, (length, thick, thick))),
            "where": "half-way",
            "like": "of a box of that mass, as long and thick as the part",
        }
    cube = box(SERVO * mass, (thick, thick, thick))[0]
    apart = SERVO * (KNEE - CENTRE) ** 2 + (1 - SERVO) * (ROD - CENTRE) ** 2
    across = cube + mass * length**2 * (apart + (1 - SERVO) / 12)
    return {
        "mass": short(mass),
        "centre": short(CENTRE * length),
        "inertia": short([cube, across, across]),
        "where": f"{CENTRE:.1%} of the length, PhantomX",
        "like": f"of a servo, {SERVO:.0%} of that mass at {KNEE:.1%} of the length, "
        "and a rod",
    }


def shapes(known: Legged) -> dict[str, Any]:
    """Capsules of the legs' parts, the foot and the belly.

    Returns:
        shapes: by part, where its capsule begins and ends on the leg, its radius [m].
        foot, foot_radius: where on the outermost part its ball is, and how large [m].
        belly: half sizes of the box [m].
    """
    made = {
        part: {"begin": 0.0, "end": short(size), "radius": short(known.radius(part))}
        for part, size in known.lengths.items()
        if part != "coxa"
    }
    outer, foot = made[known.outer], short(known.radius("foot"))
    tip = known.lengths[known.outer] - foot
    outer["end"] = short(tip - foot - outer["radius"])
    if known.outer == "tibia":
        outer["begin"] = outer["radius"]
    return {
        "shapes": made,
        "foot": short(tip),
        "foot_radius": foot,
        "belly": [known.body_length / 2, known.body_width / 2, short(known.height) / 2],
    }


def pairs(known: Legged) -> list[tuple[str, str]]:
    """Geoms that can meet: of neighbouring and opposite legs; shins and the body."""
    rows = [row for row in ROWS if f"left_{row}" in known.names]
    beside = [
        (f"{side}_{row}", f"{side}_{other}")
        for side in ("left", "right")
        for row, other in pairwise(rows)
    ]
    facing = [(f"left_{row}", f"right_{row}") for row in rows]
    parts = [part for part in known.lengths if part != "coxa"]
    legs = [
        (f"{leg}_{part}", f"{other}_{its}")
        for leg, other in (*beside, *facing)
        for part in parts
        for its in parts
    ]
    return legs + [(f"{leg}_{known.outer}", "belly") for leg in known.names]


def looks(known: Legged) -> dict[str, Any]:
    """What only shows: half sizes, places, the camera."""
    thigh, length = known.thick / 2, known.body_length
    out = max(y for _, y in known.hips.values())
    reach = max(math.hypot(*place) for place in known.hips.values())
    reach += 0.85 * sum(known.lengths.values())
    made: dict[str, float | list[float]] = {
        "hip": [1.2 * thigh, known.height / 2 + 0.1 * thigh],
        "coxa": [0.38 * known.coxa_length, 0.67 * thigh, thigh],
        "rib": [1.2 * thigh, out, 0.4 * known.height],
        "lid": [0.19 * length, 0.3 * known.body_width, 0.05 * known.height],
        "lid_forward": 0.25 * length,
        "middle": known.stance / 2,
        "extent": 1.8 * reach,
        "camera": [1.95 * reach, -1.67 * reach, 1.44 * reach],
    }
    return {name: short(value) for name, value in made.items()}
