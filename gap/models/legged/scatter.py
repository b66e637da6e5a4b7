"""What a walking robot scatters although nothing is wrong with it.

Contact makes walking chaotic: a robot that is a little heavier, or grips a little
better, than its model soon puts a foot down elsewhere, and how far that carries is not
in proportion to the difference. So the nominal model is simulated with all that it is
not sure of drawn at random, many times. What these walks do otherwise than the one in
their midst are directions along which a recording may depart: nuisances of the fit.
"""

from collections.abc import Sequence

import numpy as np

from bns import seeding
from bns.gap.decomposition.row import Row
from bns.worlds.effects.base import Effect

WALKS = 48  # drawn
NAME = "walk[{}]"


def rows() -> tuple[Row, ...]:
    """How far a recording departs along each walk: together as far as walks do."""
    sd = 1 / np.sqrt(WALKS)
    return tuple(
        Row(NAME.format(number), 0.0, sd, -3.0, 3.0, nuisance=True, step=sd)
        for number in range(WALKS)
    )


def number(name: str) -> int:
    """Number of the walk that a row stands for; -1 = it is another row."""
    stem, _, rest = name.partition("[")
    return int(rest.rstrip("]")) if stem == "walk" else -1


def robots(uncertain: Sequence[Row], count: int = WALKS) -> list[list[Effect]]:
    """Robots that the nominal model may stand for: what is uncertain, drawn together.

    Args:
        uncertain: rows with a slack.
        count: of robots; always the same ones.
    """
    rng = seeding.generator(0, "gap", "walk floor")
    return [_drawn(rng, uncertain) for _ in range(count)]


def _drawn(rng: np.random.Generator, uncertain: Sequence[Row]) -> list[Effect]:
    """One robot of those that the nominal model stands for."""
    made = []
    for row in uncertain:
        off = row.slack * float(rng.standard_normal())
        made.append(row.make(row.nominal + (abs(off) if _oneway(row) else off)))
    return made


def _oneway(row: Row) -> bool:
    return row.low == row.nominal
