"""A robot's ambient light sensors, as data, and what its own body hides from them.

Pure NumPy: the same numbers serve the physics world and anything that has no physics.

Which directions are free is found by casting rays in MuJoCo, once, and kept in the
robot's directory, so that what has no physics sees the same: for each sensor and
elevation the stretch of azimuths that is free. `python -m bns.worlds.light.sensors`
casts them anew for our robots; for one of the user's they are cast when it is first
used.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from bns import models
from bns.errors import BnsError, FormatError, UnknownNameError
from bns.models import light_sites
from bns.models.robot_model import RobotModel
from bns.storage import files, reading
from bns.storage.reading import Finite
from bns.worlds.damage import Damage
from bns.worlds.effects.sensors import columns
from bns.worlds.light import law as light_law
from bns.worlds.light.law import LightField, Screen, Sight
from bns.worlds.trial import Channel

FILE = "sight.json"
ELEVATIONS = np.radians(np.arange(0, 90, 10))
"""rad; of the kept stretches, the nearest one holds"""

AZIMUTHS = np.radians(np.arange(-180, 180, 1))
LENS = 0.001  # [m] in front of a sensor's place the rays begin; its lens is no obstacle
CLEAR = 0.01  # [m] so far at most is a sensor moved out of the hull it sits in


@dataclass(frozen=True, eq=False)
class BodySight:
    """Free directions, as `bns.worlds.light.law` wants them.

    Attributes:
        middle: azimuth of the middle of the free stretch in the robot's frame, for
            each sensor and elevation, shape ``(S, E)`` [rad].
        half: half its width, ``(S, E)`` [rad].
    """

    middle: np.ndarray
    half: np.ndarray

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        """1 where a direction is free, else 0.

        Args:
            unit: unit vectors in the robot's frame, ``(..., S, L, 3)``.
        """
        step = ELEVATIONS[1] - ELEVATIONS[0]
        at = np.rint(np.arcsin(np.clip(unit[..., 2], 0.0, 1.0)) / step).astype(int)
        at = np.minimum(at, len(ELEVATIONS) - 1)
        sensor = np.arange(len(self.middle))[:, None]
        off = np.arctan2(unit[..., 1], unit[..., 0]) - self.middle[sensor, at]
        off = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        return np.where(off <= self.half[sensor, at], 1.0, 0.0)


@cache
def kept(robot: str, names: tuple[str, ...]) -> BodySight:
    """What is kept for a robot's sensors; where it keeps nothing, it is cast.

    Raises:
        BnsError: nothing is kept for one of them, but for others.
    """
    file = models.path(robot) / FILE
    if file.is_file():
        kind = dict[str, list[tuple[Finite, Finite]]]
        read = reading.typed(reading.read_json(file), kind, file)
        known = {name: [[*pair] for pair in pairs] for name, pairs in read.items()}
    else:
        known = cast(robot)
    missing = [name for name in names if name not in known]
    if missing:
        raise BnsError(
            f"Robot {robot!r} has no kept sight for {', '.join(missing)}; "
            f"cast it anew (python -m bns.worlds.light.sensors) or delete {file}."
        )
    rows = {name: len(known[name]) for name in names}
    if set(rows.values()) - {len(ELEVATIONS)}:
        raise FormatError(f"{file}: sensors need {len(ELEVATIONS)} pairs each.")
    degrees = np.array([known[name] for name in names], dtype=np.float64)
    return BodySight(np.radians(degrees[..., 0]), np.radians(degrees[..., 1]))


def cast(robot: str) -> dict[str, list[list[float]]]:
    """Middle and half width of the free stretch [deg], by sensor and elevation."""
    rays = Rays(robot)
    return {
        site: [
            _stretch(np.array([rays.free(site, a, e) for a in AZIMUTHS]))
            for e in ELEVATIONS
        ]
        for site in light_sites.present(models.robot(robot).sensor_sites)
    }


def _stretch(free: np.ndarray) -> list[float]:
    """The free azimuths as one stretch; they are one for a body without hollows."""
    if free.all():
        return [0.0, 180.0]
    if not free.any():
        return [0.0, -1.0]
    ends = np.flatnonzero(free & ~np.roll(free, -1))
    begins = np.flatnonzero(free & ~np.roll(free, 1))
    width, begin = max(
        ((ends[ends >= b].min(initial=len(free) + ends[0]) - b), b) for b in begins
    )
    middle = np.degrees(AZIMUTHS[0]) + begin + width / 2
    return [float((middle + 180) % 360 - 180), float(width / 2)]


class Rays:
    """Rays from a robot's sensors, in the robot's frame.

    Args:
        robot: name of the robot model.
    """

    def __init__(self, robot: str):
        import mujoco

        spec = models.spec(robot, scene=False)
        for geom in list(spec.geoms):
            if geom.name.startswith("lens_"):
                spec.delete(geom)
        self._ray, self._model = mujoco.mj_ray, spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._hit = np.zeros(1, np.int32)

    def free(self, site: str, azimuth: float, elevation: float) -> bool:
        """Whether nothing of the robot is in a direction [rad] from a sensor.

        Args:
            site: name of the sensor's site.
            azimuth: of the direction [rad].
            elevation: of the direction above the horizontal [rad].
        """
        level = np.cos(elevation)
        way = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        return self._first(self._start(site), np.array(way)) < 0

    def _start(self, site: str) -> np.ndarray:
        """In front of the lens, and of the hull where a sensor sits in it."""
        found = self._data.site(site)
        ahead = found.xmat.reshape(3, 3)[:, 2]
        outside = found.xpos + CLEAR * ahead
        hull = self._first(outside, -ahead)
        deep = CLEAR - hull if 0 <= hull < CLEAR else 0.0
        return found.xpos + (deep + LENS) * ahead

    def _first(self, start: np.ndarray, way: np.ndarray) -> float:
        """Distance to what a ray hits first [m]; negative = nothing."""
        # mj_multiRay is faster, but misses geoms whose bounds the start lies in
        return self._ray(
            self._model, self._data, start, way, None, 1, -1, self._hit, None
        )


def main() -> None:
    """Cast anew for every robot that has light sensors, and keep the result."""
    for robot in models.names():
        if light_sites.present(models.robot(robot).sensor_sites):
            rows = (
                f' "{name}": {json.dumps(stretches)}'
                for name, stretches in cast(robot).items()
            )
            text = "{\n" + ",\n".join(rows) + "\n}\n"
            files.write_text(models.path(robot) / FILE, text)


VIRTUAL = (Channel("light_left", "count"), Channel("light_right", "count"))
"""Mean of the left and of the right forward sensors, of which the Khepera III has three
on each side (thesis 5.2.1)."""


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
        """All numbers of light and sensors; shapes and units as in
        `bns.worlds.light.law`.
        """
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
        """The virtual left and right sensor: means of the forward ones of a side.

        Args:
            counts: shape ``(..., S)``.

        Returns:
            Shape ``(..., 2)`` [counts].
        """
        sides = [counts[..., side].mean(-1) for side in self.sides]
        return np.stack(sides, axis=-1)

    @property
    def radius(self) -> float:
        """From the robot's middle to its outermost sensor [m]."""
        return float(np.hypot(*self.position[:, :2].T).max().round(3))

    @cached_property
    def sides(self) -> tuple[list[int], ...]:
        """Columns of the left and of the right forward sensors.

        Raises:
            BnsError: there are none on a side.
        """
        found = tuple(
            [self.names.index(name) for name in side if name in self.names]
            for side in light_sites.SIDES.values()
        )
        if not all(found):
            raise BnsError(
                f"The sensors {', '.join(self.names)} have no virtual pair: it needs "
                f"one of {', '.join(light_sites.SIDES['left'])} and its twin."
            )
        return found


@cache
def of(robot: str, headings: str = "") -> LightSensors:
    """The light sensors of a robot, in the order of its `sensor_sites`.

    Args:
        robot: its name, or its directory.
        headings: which of the tables that it offers (`ir_table`), "" = its usual one.

    Raises:
        UnknownNameError: no such robot or table.
        BnsError: it has no light sensors, or they cannot be used.
    """
    model = models.robot(robot)
    faults = light_sites.faults(model)
    if faults:
        raise BnsError(
            f"The light sensors of robot {robot!r}: {'; '.join(faults)} "
            "(docs/your_robot.md)."
        )
    placed = light_sites.placed(model)
    if not placed:
        raise BnsError(
            f"Robot {robot!r} has no light sensors; 'khepera3' has, and one of your "
            "own may (docs/your_robot.md)."
        )
    turned = _table(model, headings)
    own = {
        name: model.light[name] for name in light_sites.NUMBERS if name in model.light
    }
    return LightSensors(
        names=tuple(placed),
        position=np.array([site.position for site in placed.values()]),
        heading=np.radians([turned.get(n, site.heading) for n, site in placed.items()]),
        sight=kept(robot, tuple(placed)),
        **own,  # type: ignore[arg-type]
    )


def can_see(robot: str) -> bool:
    """Whether there is such a robot and it has light sensors."""
    known = models.known(robot)
    return known and bool(light_sites.present(models.robot(robot).sensor_sites))


def refuse_absent(damage: Damage, robot: str) -> None:
    """Stop if damage is of a sensor that the robot lacks.

    Raises:
        BnsError: it is so, or the robot has no light sensors.
    """
    names = of(robot).names
    for effect in (event.effect for event in damage.events):
        chosen = effect.values.get("sensor")
        if chosen and not columns(effect, names):
            raise BnsError(
                f"{effect}: {robot!r} has no sensor {chosen!r}; it has "
                f"{', '.join(name.removeprefix('ir_') for name in names)}."
            )


def _table(model: RobotModel, headings: str) -> Mapping[str, float]:
    """Headings [deg] that differ from the model's."""
    option = model.options.get("ir_table")
    tables = option.headings if option else {}
    chosen = headings or str(model.light.get("headings", ""))
    if not chosen:
        return {}
    if chosen not in tables:
        raise UnknownNameError(f"headings of {model.name}", chosen, tables)
    return tables[chosen]


if __name__ == "__main__":
    main()
