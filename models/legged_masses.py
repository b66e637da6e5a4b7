"""Masses, centres and inertias of a walking robot made of a few numbers.

A shin is its servo, at the knee, and a rod; a part before it a box; so is the body.
"""

from typing import Any

from bns.models import solids
from bns.models.directory import short
from bns.models.new_legged import Legged

SHARES = {2: (0.3, 0.7), 3: (0.19, 0.38, 0.43)}  # of a leg's mass, by part; PhantomX's
SERVO = 0.6  # share of a shin's mass that its servo is; PhantomX's
KNEE, ROD = 0.165, 0.5  # where on the shin servo and rod have their centres; PhantomX's
CENTRE = SERVO * KNEE + (1 - SERVO) * ROD


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
    around = short(solids.box(body, size))
    return {"masses": made, "body_mass": short(body), "body_inertia": around}


def _part(known: Legged, part: str, share: float) -> dict[str, Any]:
    mass, length, thick = share * known.each_leg, known.lengths[part], known.thick
    if part != known.outer:
        return {
            "mass": short(mass),
            "centre": short(length / 2),
            "inertia": short(solids.box(mass, (length, thick, thick))),
            "where": "half-way",
            "like": "of a box of that mass, as long and thick as the part",
        }
    cube = solids.box(SERVO * mass, (thick, thick, thick))[0]
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
