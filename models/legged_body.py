"""Masses and shapes of a robot that is made of a few numbers.

A shin is its servo, at the knee, and a rod; a part before it a box; so is the body.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from bns.models.directory import short
from bns.models.new_legged import Legged

ROWS = ("front", "middle", "rear")
SHARES = {2: (0.3, 0.7), 3: (0.19, 0.38, 0.43)}  # of a leg's mass, by part; PhantomX's
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
    shares = SHARES[len(known.lengths)]
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
