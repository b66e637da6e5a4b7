"""Khepera speed units, as the dissertation's settings are given in them.

A command of 17500 asks for 0.1215 m/s with a firmware older than 3.0 (Khepera III
manual 2.2, p. 14: 144.01 units to the mm/s).
"""

SPEED_UNITS_PER_METRE_PER_SECOND = 144.01e3  # [units / (m/s)], manual 2.2, p. 14


def metres_per_second(speed_units: float) -> float:
    """A speed in Khepera speed units as m/s."""
    return speed_units / SPEED_UNITS_PER_METRE_PER_SECOND
