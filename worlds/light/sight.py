"""Which directions a robot's own body hides from its light sensors.

Found by casting rays in MuJoCo, once, and kept in the robot's directory, so that what
has no physics sees the same: for each sensor and elevation the stretch of azimuths
that is free. `python -m bns.worlds.light.sight` casts them anew for our robots;
for one of the user's they are cast when it is first used.
"""

import json
from dataclasses import dataclass
from functools import cache

import numpy as np

from bns import models
from bns.errors import BnsError, FormatError
from bns.models import light_sites
from bns.storage import files, reading
from bns.storage.reading import Finite

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
            f"cast it anew (python -m bns.worlds.light.sight) or delete {file}."
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


if __name__ == "__main__":
    main()
