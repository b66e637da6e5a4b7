"""The Khepera III's ambient light sensors, as data: `LightSensors`.

Pure NumPy: the same numbers serve the physics world and anything that has no physics.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from bns import models
from bns.errors import BnsError, UnknownNameError
from bns.models import numbers
from bns.worlds import light_law, sight
from bns.worlds.light_field import LightField
from bns.worlds.light_law import Screen, Sight
from bns.worlds.trial import Channel

VIRTUAL = (Channel("light_left", "count"), Channel("light_right", "count"))
"""Mean of the left three and of the right three forward sensors (thesis 5.2.1)."""

LEFT = ("ir_left_90", "ir_left_45", "ir_front_left")
RIGHT = ("ir_right_90", "ir_right_45", "ir_front_right")


@dataclass(frozen=True, eq=False)
class LightSensors:
    """Ambient light sensors of a robot.

    Attributes:
        names: of the S sensors.
        position: in the robot's frame, shape ``(S, 3)`` [m].
        heading: where each looks, counter-clockwise from forward, ``(S,)`` [rad].
        exponent: of the cosine in the angular response. Assumed: at 4 a single front
            sensor saturates over 30 degrees at the median distance in the arena, and
            the mean of three nowhere, as the dissertation has it (5.2.1, figure 5.6).
        full_light: irradiance at which a reading reaches `bright` [W/m2]; assumed,
            from the same 30 degrees with the assumed lamp.
        dark, bright: readings without light and in full light [counts]: 12 bits,
            full scale at the dark end (maker's test program; the dissertation writes
            0 to 4200).
        light_noise: standard deviation of the light, as a share of it; assumed.
        count_noise: standard deviation of a reading [counts]; assumed.
        sight: what the robot's own body leaves of the light, None = all.
    """

    names: tuple[str, ...]
    position: np.ndarray
    heading: np.ndarray
    exponent: float = 4.0
    full_light: float = 0.86
    dark: float = 4095.0
    bright: float = 0.0
    light_noise: float = 0.08
    count_noise: float = 30.0
    sight: Sight | None = None

    def law(self, field: LightField) -> dict[str, np.ndarray]:
        """All numbers of light and sensors, see `bns.worlds.light_law`."""
        scalars = (
            "exponent",
            "dark",
            "bright",
            "light_noise",
            "count_noise",
        )
        return field.law() | {
            "position": np.array(self.position, dtype=np.float64),
            "heading": np.array(self.heading, dtype=np.float64),
            "noise": np.ones(len(self.names)),
            "sensitivity": np.ones(len(self.names)),
            "full_light": np.full(len(self.names), float(self.full_light)),
            **{name: np.array(float(getattr(self, name))) for name in scalars},
        }

    def counts(
        self,
        field: LightField,
        poses: np.ndarray,
        times: np.ndarray | float = 0.0,
        *,
        rng: np.random.Generator | None = None,
        screen: Screen | None = None,
    ) -> np.ndarray:
        """Readings of each sensor at some poses; smaller is brighter.

        Args:
            field: lamps and ambient light.
            poses: in the world frame, shape ``(n, 3)`` [m, m, rad].
            times: of the readings [s], ``(n,)`` or one for all.
            rng: of the noise; None = none.
            screen: what objects leave of the light.

        Returns:
            Whole counts, shape ``(n, S)``.
        """
        law = self.law(field)
        light = light_law.irradiance(law, poses, times, sight=self.sight, screen=screen)
        noise = None
        if rng is not None:
            noise = tuple(rng.standard_normal((2, *light.shape)))
        return light_law.counts(law, light, noise)

    def virtual(self, counts: np.ndarray) -> np.ndarray:
        """The virtual left and right sensor: means of three.

        Args:
            counts: shape ``(..., S)``.

        Returns:
            Shape ``(..., 2)`` [counts].
        """
        left, right = (self._columns(side) for side in (LEFT, RIGHT))
        return np.stack(
            [counts[..., left].mean(-1), counts[..., right].mean(-1)], axis=-1
        )

    def _columns(self, side: tuple[str, ...]) -> list[int]:
        try:
            return [self.names.index(name) for name in side]
        except ValueError as error:
            raise BnsError(
                f"The sensors {', '.join(self.names)} have no virtual pair: it needs "
                f"{', '.join((*LEFT, *RIGHT))}."
            ) from error


@cache
def khepera3(table: str = "thesis") -> LightSensors:
    """The nine outward sensors of the Khepera III, in the order of its answers.

    Args:
        table: which headings: "thesis" (85, 45, 10 degrees; the default, as the
            dissertation's figures are reproduced with it) or "public" (76.7, 42.8,
            13.3 degrees, of the published models).

    Raises:
        UnknownNameError: no such table.
    """
    robot = models.robot("khepera3")
    tables = robot.options["ir_table"].headings
    if table not in tables:
        raise UnknownNameError("ir_table", table, tables)
    known = numbers.read(robot.directory)
    names = tuple(site for site in robot.sensor_sites if "ground" not in site)
    behind = {"ir_back_left": 129.2, "ir_back_right": -129.2, "ir_back": 180.0}
    headings = behind | dict(tables[table])
    return LightSensors(
        names=names,
        position=np.array([known[name].value for name in names]),
        heading=np.radians([headings[name] for name in names]),
        sight=sight.kept(robot.name, names),
    )
