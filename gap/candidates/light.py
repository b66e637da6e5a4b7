"""Numbers of light sensors and lamps that may be off, and how far they may be."""

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from bns.gap.decomposition.row import Row
from bns.models.light_sites import NAMES, SIDES
from bns.worlds.effects import registry
from bns.worlds.effects.sensors import FORWARD, SINGLE

SHARE = 0.02  # slack of a number over its plausible departure; assumed
GROUPS = ("all", "left", "right")
FRAME = 1 / 30  # [s] of a picture: how well a reading's moment is known; assumed
HEADING = 0.005  # [rad] how well the tracker's zero of a heading is known; assumed
RHYTHMS = np.arange(0.05, 1.26, 0.025)  # [Hz] of a flicker that are tried
AZIMUTHS, WIDTHS = np.arange(-6, 6) * np.pi / 6, (0.7, 1.5, 3.0)  # [rad] of a shadow

# effect, parameter, plausible departure (standard deviation), low, high, slack of a
# single sensor (what sensors of one kind differ by), settings; all assumed.
_SENSORS: tuple[tuple[str, str, float, float, float, float, dict[str, Any]], ...] = (
    ("sensor_gain", "factor", 0.3, 0.0, 3.0, 0.0,
     {"step": -0.03, "levels": (0.3, 2.0)}),  # upwards, dark readings saturate
    ("sensor_offset", "counts", 500, -4095, 4095, 0.0,
     {"step": 20.0, "levels": (-2000, -600, 600, 2000)}),
    ("sensor_stuck_max", "blend", 0.3, 0, 1, 0.0, {"levels": (0.5, 1.0)}),
    ("sensor_stuck_min", "blend", 0.3, 0, 1, 0.0, {"levels": (0.5, 1.0)}),
    ("sensor_intermittent", "every", 1.0, 0, 20, 0.0,
     {"smooth": False, "stepped": True, "levels": (2, 3, 4, 5, 6, 8, 11, 15)}),
    ("sensor_noise", "factor", 1.0, 0, 20, 0.1, {"levels": (2.5, 6.0)}),
    ("sensor_dead", "loss", 0.3, 0, 1, 0.01, {"levels": (0.5, 1.0)}),
    ("sensor_frozen", "blend", 0.3, 0, 1, 0.0, {"levels": (0.5, 1.0)}),
    ("sensor_drift", "rate", 20, -300, 300, 0.0, {"levels": (-100, -30, 30, 100)}),
    ("sensor_misaligned", "angle", 0.3, -2, 2, 0.01,
     {"step": 0.02, "levels": (-1.2, -0.5, 0.5, 1.2)}),
    ("sensor_saturation", "level", 800, 0, 4095, 0.0,
     {"smooth": False, "levels": (150, 600, 1200, 2000, 3000, 3800)}),
    ("sensor_crosstalk", "share", 0.1, 0, 0.5, 0.0, {"levels": (0.3,)}),
    ("sensor_response_time", "time_constant", 0.3, 0, 10, FRAME,
     {"step": 0.1, "levels": (0.3, 1.0, 3.0)}),
)  # fmt: skip
_LIGHT: tuple[tuple[str, str, float, float, float, dict[str, Any]], ...] = (
    ("sensor_swapped", "blend", 0.3, 0, 1, {"levels": (0.5, 1.0)}),
    ("light_ambient", "added", 0.1, 0, 2, {"levels": (0.3, 0.8)}),
    ("light_dimmed", "factor", 0.3, 0, 5, {"slack": 0.01, "levels": (0.3, 2.0)}),
)
TWINS = {"sensor_gain": "sensor_stuck_min", "sensor_stuck_min": "sensor_gain"}
"""A reading partly stuck at zero is one with a gain below one, whatever is driven."""
EXCITE = {
    "sensor_drift": "longer drives",
    "sensor_response_time": "quick turns near the lamp",
    "sensor_saturation": "readings in full light: drives near the lamp",
    "light_flicker": "standing in the light",
    "light_shadow": "drives all around the lamp",
    "light_displaced": "drives all around the lamp",
}


def rows(*, singles: bool, sensors: Collection[str] = NAMES) -> tuple[Row, ...]:
    """All numbers that may be off, in a fixed order.

    Args:
        singles: whether each sensor was recorded; else the virtual two, which those
            behind are not part of.
        sensors: that the robot has. One that is all of a virtual sensor has no number
            of its own.
    """
    virtual = [set(side) & set(sensors) for side in SIDES.values()]
    own = [
        name
        for name in (SINGLE if singles else FORWARD)
        if f"ir_{name}" in sensors and {f"ir_{name}"} not in virtual
    ]
    return (*_sensors(own), *_light(), *_displaced(), *_flicker(), *_shadow())


def _sensors(names: Iterable[str]) -> Iterable[Row]:
    for effect, parameter, sd, low, high, slack, more in _SENSORS:
        for sensor in (*GROUPS, *names):
            yield _row(
                effect, parameter, sd, low, high, f"{effect}[{sensor}]",
                fixed={"sensor": sensor}, slack=_slack(effect, sensor, slack),
                aliases=(f"{TWINS[effect]}[{sensor}]",) if effect in TWINS else (),
                **more,
            )  # fmt: skip


def _slack(effect: str, sensor: str, single: float) -> float:
    """How uncertain the nominal sensors are: each, and the robot's heading for all."""
    if sensor not in GROUPS or effect in ("sensor_noise", "sensor_response_time"):
        return single
    return HEADING if (effect, sensor) == ("sensor_misaligned", "all") else 0.0


def _light() -> Iterable[Row]:
    for effect, parameter, sd, low, high, more in _LIGHT:
        yield _row(effect, parameter, sd, low, high, effect, **more)


def _displaced() -> Iterable[Row]:
    """A lamp elsewhere: two numbers of one explanation."""
    for axis in "xy":
        yield _row(
            "light_displaced", axis, 0.15, -1, 1, f"light_displaced.{axis}",
            group="light_displaced", step=0.01, levels=(-0.5, 0.5),
        )  # fmt: skip


def _flicker() -> Iterable[Row]:
    """A rhythm has no slope: each is tried, and how deep it is fitted."""
    for hertz in RHYTHMS:
        yield _row(
            "light_flicker", "depth", 0.3, 0, 1, f"light_flicker@{hertz:.4g}",
            group="light_flicker", fixed={"frequency": float(hertz)}, smooth=False,
            levels=(0.15, 0.5),
        )  # fmt: skip


def _shadow() -> Iterable[Row]:
    """A shadow has edges: each sector is tried, and how dark it is fitted."""
    for azimuth in AZIMUTHS:
        for width in WIDTHS:
            yield _row(
                "light_shadow", "loss", 0.5, 0, 1,
                f"light_shadow@{azimuth:.3g},{width:.3g}", group="light_shadow",
                fixed={"azimuth": float(azimuth), "width": width}, smooth=False,
                levels=(0.2, 0.5, 1.0),
            )  # fmt: skip


def _row(
    effect: str,
    parameter: str,
    sd: float,
    low: float,
    high: float,
    name: str,
    **more: Any,
) -> Row:
    known = registry.get(effect).parameters
    about = next(p for p in known if p.name == parameter)
    usual = "drives in which these sensors see the lamp"
    return Row(
        name=name,
        nominal=float(about.nominal),
        sd=sd,
        low=low,
        high=high,
        unit=about.unit,
        excite=EXCITE.get(effect, usual),
        effect=effect,
        parameter=parameter,
        **{**more, "slack": more.get("slack") or SHARE * sd},
    )
