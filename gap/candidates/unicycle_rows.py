"""Numbers of a robot told speed and turning rate that may be off, and how far."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from bns.gap.candidates.mjcf import EXCITE
from bns.gap.decomposition.row import Row
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect, Parameter
from bns.worlds.effects.command import TWIST

LATE = (0.1, 0.2, 0.4)  # [s] delays and lags that fits are started from
ZONES = (0.05, 0.15, 0.4)  # dead zones, likewise, of the largest
LARGEST = {TWIST[0]: (0.1, "m/s"), TWIST[1]: (0.3, "rad/s")}
"""offset and dead zone of each channel; assumed"""


@cache
def rows() -> tuple[Row, ...]:
    """Gains, delay, lag, offsets, dead zones, what turning costs, and how the tracker
    sees the robot; in the order in which they act.

    Plausible departures are assumed: 10 % of a gain, a third of the largest offset,
    0.1 s, a marker 2 cm and 2 degrees askew.
    """
    return tuple(_rows())


def _rows() -> Iterator[Row]:
    for channel in TWIST:
        yield _row(f"command_gain[{channel}]", 0.1, 0.4, 1.6, slack=0.003)
    for name in ("command_delay[all]", "command_lag[all]"):
        yield _row(name, 0.1, 0.0, 1.0, levels=LATE, step=0.01)
    for channel, (size, unit) in LARGEST.items():
        yield _row(f"command_offset[{channel}]", size / 3, -size, size, unit=unit)
        yield _row(
            f"command_dead_band[{channel}]", size / 3, 0.0, size, unit=unit,
            smooth=False, levels=tuple(size * share for share in ZONES),
        )  # fmt: skip
    yield _row("turning_loss", 0.05, 0.0, 0.3)
    mount: dict[str, Any] = {"family": "marker_mount"}
    for axis in ("dx", "dy"):
        yield _row(f"marker_mount.{axis}", 0.02, -0.2, 0.2, slack=2e-4, **mount)
    yield _row("marker_mount.yaw", 0.04, -0.5, 0.5, slack=1e-3, **mount)


def _row(name: str, sd: float, low: float, high: float, **more: Any) -> Row:
    effect, fixed, about = _parts(name)
    more.setdefault("unit", about.unit)
    return Row(
        name,
        float(about.nominal),
        sd,
        low,
        high,
        excite=EXCITE.get(effect, "arcs and turns"),
        effect=effect,
        parameter=about.name,
        fixed=fixed,
        **more,
    )


def _parts(name: str) -> tuple[str, dict[str, str], Parameter]:
    """Effect, fixed values and parameter that a row's name stands for."""
    stem, _, part = name.partition("[")
    effect, _, wanted = stem.partition(".")
    every = registry.get(effect).parameters
    about = next(p for p in every if not wanted or p.name == wanted)
    return effect, {"part": part.rstrip("]")} if part else {}, about


def effects(values: Mapping[str, float]) -> list[Effect]:
    """The effects of rows, in the order in which they act.

    Args:
        values: of the rows that are not nominal, by name.
    """
    return [row.make(values[row.name]) for row in rows() if row.name in values]
