"""What of a walking robot made of a few numbers touches, and what only shows."""

import math
from itertools import pairwise
from typing import Any

from bns.models.directory import short
from bns.models.new_legged import Legged

ROWS = ("front", "middle", "rear")


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
    made = {
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
