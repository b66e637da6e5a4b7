"""The physics world with lamps: robots that see light and steer themselves."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from bns import seeding
from bns.errors import BnsError, UnknownNameError
from bns.worlds import light_sensors
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.light_field import Lamp, LightField
from bns.worlds.mujoco_world import MujocoWorld
from bns.worlds.sensing import Sensing
from bns.worlds.supervisor import Supervisor

ROBOT_RADIUS = 0.067
"""m; from the axle's middle to the outermost sensor (Webots' Khepera III)"""

NEAREST = 0.5
"""m; trials start no nearer to a lamp than this; assumed"""


class LightWorld(MujocoWorld):
    """Robots that see light in MuJoCo and steer themselves, N at a time.

    What `MujocoWorld` is, and lamps: `drive` lets controllers drive by what the light
    sensors read. Lamps have no body to bump into; the safety boundary is around them.

    Args:
        lights: lamps, as `Lamp` or as tables with its fields.
        ambient: irradiance that is everywhere [W/m2].
        sensors: which way the sensors look, "thesis" or "public" headings.
        singles: whether trials have each single sensor beside the virtual two.
        supervisor: what happens at the lamp and at the edge.
        damage, reality, sample_dt, threads, start, arena, name, truth: those of
            `MujocoWorld`; `start` is that of `run`.

    Raises:
        BnsError: no lamp, a robot without light sensors.
    """

    stages = (*MujocoWorld.stages, "sensor")

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        lights: Sequence[Lamp | Mapping] = (Lamp(),),
        ambient: float = 0.02,
        sensors: str = "thesis",
        singles: bool = False,
        supervisor: Supervisor | None = None,
        damage: Damage | Sequence = (),
        reality: Damage | Sequence = (),
        sample_dt: float = 0.1,
        threads: int = 2,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        arena: Sequence[float] = (2.7, 1.8),
        name: str = "light",
        truth: bool = False,
    ):
        super().__init__(
            robot,
            damage=damage,
            reality=reality,
            sample_dt=sample_dt,
            threads=threads,
            start=start,
            arena=arena,
            name=name,
            truth=truth,
        )
        if robot != "khepera3":
            raise BnsError(
                f"Robot {robot!r} has no light sensors; the world {name!r} takes "
                "'khepera3'."
            )
        self.field = LightField(tuple(_lamp(item) for item in lights), ambient)
        self.sensors = light_sensors.khepera3(sensors)
        self.singles = singles
        self.supervisor = supervisor or Supervisor()

    def _supervisor(self) -> Supervisor:
        return self.supervisor

    @cached_property
    def _places(self) -> np.ndarray:
        return self.field.positions[:, :2]

    def _lamps(self) -> np.ndarray:
        return self._places

    def _sensing(
        self, stages: Sequence[Stages], seeds: Sequence[int], trial: int, reads: int
    ) -> Sensing:
        return Sensing(
            self.field,
            self.sensors,
            stages,
            seeds=seeds,
            trial=trial,
            reads=reads,
            singles=self.singles,
        )

    def _starts(self, n: int, seeds: Sequence[int], trial: int) -> np.ndarray:
        return np.array([self._start(seed, trial) for seed in seeds]).reshape(n, 3)

    def _start(self, seed: int, trial: int) -> tuple[float, float, float]:
        """Anywhere on the board, but not near a lamp or the edge."""
        rng = seeding.generator(seed, "world", trial, "start")
        half = np.asarray(self.arena) / 2 - max(self.supervisor.edge, 0.0)
        for _ in range(10_000):
            place = rng.uniform(-half, half)
            if np.hypot(*(self._places - place).T).min() >= NEAREST:
                return (*place.tolist(), float(rng.uniform(-np.pi, np.pi)))
        raise BnsError(
            f"There is no place on the board {NEAREST} m away from every lamp; give "
            "starts, or fewer lamps."
        )

    def _checked_starts(self, starts: object, n: int) -> np.ndarray:
        poses = super()._checked_starts(starts, n)
        for pose in poses:
            way = np.hypot(*(self._places - pose[:2]).T)
            lamp = int(way.argmin())
            where = (
                f"lamp {lamp} at ({', '.join(f'{v:g}' for v in self._places[lamp])})"
            )
            if way[lamp] < ROBOT_RADIUS:
                raise BnsError(
                    f"Start ({pose[0]:g}, {pose[1]:g}) puts {where} inside the robot; "
                    "start further away."
                )
            if way[lamp] < self.supervisor.safety:
                raise BnsError(
                    f"Start ({pose[0]:g}, {pose[1]:g}) is {way[lamp]:.3f} m from "
                    f"{where}, inside its safety boundary of "
                    f"{self.supervisor.safety:g} m; start further away."
                )
        return poses


def _lamp(given: Lamp | Mapping) -> Lamp:
    if isinstance(given, Lamp):
        return given
    if not isinstance(given, Mapping):
        raise BnsError(f"{given!r} is no lamp: give a Lamp or a table of its fields.")
    known = Lamp.__dataclass_fields__
    for key in given:
        if key not in known:
            raise UnknownNameError("field of a lamp", str(key), known)
    return Lamp(**given)
