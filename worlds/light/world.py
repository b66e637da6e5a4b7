"""The physics world with lamps: robots that see light and steer themselves."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from math import inf
from typing import Unpack

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.worlds import checks, objects
from bns.worlds.active import Placed, Stages
from bns.worlds.damage import Damage
from bns.worlds.light import sensors as light_sensors
from bns.worlds.light.closed_loop import LEAD, Sensing, Supervisor
from bns.worlds.light.law import Lamp, LightField
from bns.worlds.objects import Objects, Post, RayScreen
from bns.worlds.physics import observe
from bns.worlds.physics.rollout import Motion
from bns.worlds.physics.wheeled_world import MujocoWorld, Plan
from bns.worlds.physics.world import Settings
from bns.worlds.trial import Trial


class LightWorld(MujocoWorld):
    """Robots that see light in MuJoCo and steer themselves, N at a time.

    What `MujocoWorld` is, and lamps: `drive` lets controllers drive by what the light
    sensors read. Lamps have no body to bump into; the safety boundary is around them.

    Args:
        lights: lamps, as `Lamp` or as tables with its fields.
        ambient: irradiance that is everywhere [W/m2].
        posts: things in the way, as `Post` or as tables with its fields.
        sensors: which way the sensors look, where the robot offers several: of a
            Khepera III "thesis" (the usual) or "public".
        singles: whether trials have each single sensor beside the virtual two.
        supervisor: what happens at the lamp and at the edge, as `Supervisor` or as a
            table with its fields.
        name: of the world in the trials.
        settings: those of `MujocoWorld`; `start` is that of `run`.

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
        posts: Sequence[Post | Mapping] = (),
        sensors: str = "",
        singles: bool = False,
        supervisor: Supervisor | Mapping | None = None,
        name: str = "light",
        **settings: Unpack[Settings],
    ):
        super().__init__(robot, name=name, **settings)
        self.field = LightField(checks.several(Lamp, "lamp", lights), ambient)
        self.posts = checks.several(Post, "object", posts)
        self.sensors = light_sensors.of(robot, sensors)
        self.radius = self.sensors.radius
        objects.checked(self.posts, self._places, np.zeros((0, 2)), self.radius)
        self._screen = RayScreen(self.posts) if self.posts else None
        self.singles = singles
        told = {} if supervisor is None else supervisor
        self.supervisor = checks.one(Supervisor, "supervisor", told)

    def _refuse(self, damage: Damage) -> None:
        light_sensors.refuse_absent(damage, self.robot)

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
            screen=self._screen,
            singles=self.singles,
        )

    def _stages(self, damage: Damage, trial: int, duration: float) -> Stages:
        stages = super()._stages(damage, trial, duration)
        if not self.posts:
            return stages
        placed = Placed(Objects(self.posts), 0.0, inf, ("objects",))
        return replace(stages, body=(placed, *stages.body))

    def _about(self) -> dict[str, object]:
        about = {"lights": [asdict(lamp) for lamp in self.field.lamps]}
        if self.posts:
            about["objects"] = [asdict(post) for post in self.posts]
        return super()._about() | about | {"ambient": self.field.ambient}

    def _observe(self, plan: Plan, motion: Motion, trial: int) -> Trial:
        """The trial of a list of commands, with what was read after each."""
        made = super()._observe(plan, motion, trial)
        ends = np.concatenate([[0], np.cumsum(plan.counts)])
        sensing = self._sensing([plan.stages], [plan.seed], trial, len(ends))
        for before, end in zip([0, *ends], ends, strict=False):
            at = max(end - round(LEAD / self.dt), before)
            free = motion.states[at, 1:8][None]
            moment = np.array([at * self.dt])
            sensing.read(end * self.dt, observe.flat(free), moment)
        held = np.searchsorted(made.boundaries, np.arange(len(made.times)), "right") - 1
        return made.replace(
            observed=np.hstack([made.observed, sensing.readings[0][held]]),
            channels=made.channels + sensing.channels,
        )

    def _starts(self, n: int, seeds: Sequence[int], trial: int) -> np.ndarray:
        return np.array([self._start(seed, trial) for seed in seeds]).reshape(n, 3)

    def _start(self, seed: int, trial: int) -> tuple[float, float, float]:
        """Anywhere on the board, but not near a lamp, an object or the edge."""
        rng = seeding.generator(seed, "world", trial, "start")
        taken = [(p.x, p.y, p.radius + self.radius) for p in self.posts]
        return anywhere(
            rng, self.arena, self._places, edge=self.supervisor.edge, taken=taken
        )

    def _checked_starts(self, starts: object, n: int) -> np.ndarray:
        poses = super()._checked_starts(starts, n)
        objects.checked(self.posts, self._places, poses, self.radius)
        for pose in poses:
            way = np.hypot(*(self._places - pose[:2]).T)
            lamp = int(way.argmin())
            where = (
                f"lamp {lamp} at ({', '.join(f'{v:g}' for v in self._places[lamp])})"
            )
            if way[lamp] < self.radius:
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


NEAREST = 0.5
"""m; trials start no nearer to a lamp than this; assumed"""

TRIES = 10_000


def anywhere(
    rng: np.random.Generator,
    arena: tuple[float, float],
    lamps: np.ndarray,
    *,
    edge: float = 0.0,
    taken: Iterable[tuple[float, float, float]] = (),
) -> tuple[float, float, float]:
    """A pose anywhere on the board, but not near a lamp, the edge or what is taken.

    Args:
        rng: the only source of randomness.
        arena: size of the board [m], its centre the origin.
        lamps: where the lamps are, shape ``(L, 2)`` [m].
        edge: kept free along the board's edge [m]; negative = nothing.
        taken: other places: x, y and what to keep free around them [m].

    Returns:
        x, y, yaw [m, m, rad].

    Raises:
        BnsError: there is no such place.
    """
    half = np.asarray(arena) / 2 - max(edge, 0.0)
    x, y, room = np.array([*((*place, NEAREST) for place in lamps), *taken]).T
    for _ in range(TRIES):
        place = rng.uniform(-half, half)
        if (np.hypot(x - place[0], y - place[1]) > room).all():
            return (*place.tolist(), float(rng.uniform(-np.pi, np.pi)))
    raise BnsError(
        f"There is no place on the board {NEAREST} m away from every lamp; give "
        "starts, or fewer lamps."
    )
