"""Candidate explanations for light sensors and lamps, from the library of effects."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bns.gap.records import Candidate
from bns.models.light_sites import NAMES, SIDES
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.effects.sensors import FORWARD, SINGLE

GROUPS = ("all", "left", "right")
BOTH_WAYS = np.array([0.02, 0.07, 0.25, 0.6])
SHARES = (0.05, 0.2, 0.5, 1.0)
HEADING = 0.005  # [rad] how well the tracker's zero of a heading is known; assumed
HERTZ = 0.05  # [Hz] in one step of the flicker that a fit adjusts
RHYTHMS = tuple({"beat": float(k)} for k in np.arange(1, 25.5, 0.25))
HEADINGS = tuple({"heading": k * np.pi / 4} for k in range(-3, 5))
SECTORS = tuple(
    {"azimuth": k * np.pi / 4, "width": width}
    for k in range(-3, 5)
    for width in (0.7, 1.5, 3.0)
)

# effect, parameter, grid, low, high, slack of a single sensor (assumed: what sensors of
# one kind differ by). Bounds narrower than the effect's own are assumed.
_SENSORS = (
    ("sensor_gain", "factor", (0.3, 0.7, 0.93, 1.07, 1.3, 2.5), 0.0, 3.0, 0.0),
    (
        "sensor_offset",
        "counts",
        (-2500, -800, -200, -50, 50, 200, 800, 2500),
        -4095,
        4095,
        0.0,
    ),
    ("sensor_stuck_max", "blend", SHARES, 0, 1, 0.0),
    ("sensor_stuck_min", "blend", SHARES, 0, 1, 0.0),
    ("sensor_intermittent", "every", (2, 3, 4, 5, 6, 8, 11, 15), 0, 20, 0.0),
    ("sensor_noise", "factor", (0.1, 0.5, 1.5, 2.5, 5, 12), 0, 20, 0.0),
    ("sensor_dead", "loss", SHARES, 0, 1, 0.01),
    ("sensor_frozen", "blend", SHARES, 0, 1, 0.0),
    ("sensor_drift", "rate", (-150, -40, -10, -2, 2, 10, 40, 150), -300, 300, 0.0),
    (
        "sensor_misaligned",
        "angle",
        (-1.5, -0.7, -0.3, -0.08, 0.08, 0.3, 0.7, 1.5),
        -2,
        2,
        0.01,
    ),
    ("sensor_saturation", "level", (150, 600, 1200, 2000, 3000, 3800), 0, 4095, 0.0),
    ("sensor_crosstalk", "share", (0.03, 0.1, 0.25, 0.5), 0, 0.5, 0.0),
    ("sensor_response_time", "time_constant", (0.1, 0.2, 0.4, 1, 3), 0, 10, 0.0),
)
# effect, parameter, grid, low, high, branches, extras, slack
_LIGHT = (
    ("sensor_swapped", "blend", SHARES, 0, 1, ({},), (), 0.0),
    ("light_ambient", "added", (0.01, 0.05, 0.2, 0.8), 0, 2, ({},), (), 0.0),
    (
        "light_dimmed",
        "factor",
        (0, 0.4, 0.75, 0.93, 1.07, 1.4, 3),
        0,
        5,
        ({},),
        (),
        0.01,
    ),
    (
        "light_displaced",
        "distance",
        (0.02, 0.08, 0.25, 0.6),
        0,
        1,
        HEADINGS,
        ("heading",),
        0.0,
    ),
    ("light_flicker", "depth", (0.15, 0.5, 1.0), 0, 1, RHYTHMS, ("beat",), 0.0),
    ("light_shadow", "loss", (0.3, 1.0), 0, 1, SECTORS, ("azimuth", "width"), 0.0),
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


@dataclass(frozen=True)
class LightCandidate(Candidate):
    """A candidate on sensors or lamps.

    A lamp is displaced by a distance in a direction, a flicker has a rhythm in steps
    of `HERTZ`: that is how their fits go on smoothly.
    """

    @property
    def whole(self) -> bool:
        """Whether only whole magnitudes make sense."""
        return self.effect == "sensor_intermittent"

    def make(
        self,
        magnitude: float,
        branch: int = 0,
        extras: Mapping[str, float] | None = None,
    ) -> Effect:
        """The effect at a magnitude, clipped to the bounds.

        Args:
            magnitude: in the candidate's unit; clipped to its bounds.
            branch: index into `branches`.
            extras: values beside the magnitude, by name, that go before those of the
                branch.
        """
        value = min(max(float(magnitude), self.low), self.high)
        values = {**self.fixed, **self.branches[branch], **(extras or {})}
        if self.effect == "light_displaced":
            way = values["heading"]
            x, y = value * np.cos(way), value * np.sin(way)
            return registry.make(self.effect, x=float(x), y=float(y))
        if self.effect == "light_flicker":
            hertz = min(max(values["beat"] * HERTZ, 0.001), 10.0)
            return registry.make(self.effect, depth=value, frequency=float(hertz))
        return super().make(magnitude, branch, extras)


def candidates(
    *, singles: bool, sensors: Collection[str] = NAMES
) -> tuple[Candidate, ...]:
    """All candidates, in a fixed order.

    Args:
        singles: whether each sensor was recorded; else the virtual two, which those
            behind are not part of.
        sensors: that the robot has. One that is all of a virtual sensor is no candidate
            of its own.
    """
    virtual = [set(side) & set(sensors) for side in SIDES.values()]
    own = [
        name
        for name in (SINGLE if singles else FORWARD)
        if f"ir_{name}" in sensors and {f"ir_{name}"} not in virtual
    ]
    return tuple(_sensors(own)) + tuple(_light())


def _sensors(names: Iterable[str]) -> Iterable[Candidate]:
    for effect, parameter, grid, low, high, slack in _SENSORS:
        about = next(p for p in registry.get(effect).parameters if p.name == parameter)
        for sensor in (*GROUPS, *names):
            yield LightCandidate(
                name=f"{effect}[{sensor}]",
                effect=effect,
                parameter=parameter,
                unit=about.unit,
                nominal=about.nominal,
                low=low,
                high=high,
                grid=tuple(map(float, grid)),
                fixed={"sensor": sensor},
                slack=_slack(effect, sensor, slack),
                aliases=(f"{TWINS[effect]}[{sensor}]",) if effect in TWINS else (),
                excite=EXCITE.get(effect, "drives in which these sensors see the lamp"),
            )


def _slack(effect: str, sensor: str, single: float) -> float:
    """How uncertain the nominal sensors are: each, and the robot's heading for all."""
    if sensor in GROUPS:
        return HEADING if (effect, sensor) == ("sensor_misaligned", "all") else 0.0
    return single


def _light() -> Iterable[Candidate]:
    for effect, parameter, grid, low, high, branches, extras, slack in _LIGHT:
        known = {p.name: p for p in registry.get(effect).parameters}
        about = known.get(parameter)
        yield LightCandidate(
            name=effect,
            effect=effect,
            parameter=parameter,
            unit=about.unit if about else "m",
            nominal=about.nominal if about else 0.0,
            low=low,
            high=high,
            grid=tuple(map(float, grid)),
            branches=branches,
            extras=extras,
            slack=slack,
            excite=EXCITE.get(effect, "drives in which the sensors see the lamp"),
        )
