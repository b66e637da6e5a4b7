"""Light following: drive to the lamp and stay at the goal radius (thesis 5.2.3)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import torch

from bns import seeding
from bns.errors import BnsError
from bns.experiment.task_settings import LightConfig
from bns.tasks.base import Arrays, Picture, Space, Task, seen_places
from bns.tasks.light_controller import Controllers, GenomePolicy, LightController
from bns.worlds.trial import Trial

if TYPE_CHECKING:
    from bns.learners.bns.problem import Problem

READINGS = ("light_left", "light_right")
"""channels of the two virtual light sensors"""

ARENA = (2.7, 1.8)  # [m] the board (thesis 4.2.1)
EDGE = 0.08  # [m] a robot is turned so near to the edge, as in the world; assumed
POOL = 4096


@dataclass(frozen=True)
class LampGoal:
    """Equation 5.2 and what counts as solved.

    Attributes:
        lamp: where the lamp stands, x and y [m].
        config: radii and limits.
    """

    lamp: tuple[float, float]
    config: LightConfig

    @classmethod
    def of(cls, config: LightConfig) -> "LampGoal":
        """The task of a configuration; its first lamp is the one to go to.

        Raises:
            BnsError: no lamp, one that cannot be read, or the first is off the board.
        """
        first = lamps(config)[0]
        x, y = first.get("x", 0.0), first.get("y", 0.0)
        if abs(x) > ARENA[0] / 2 or abs(y) > ARENA[1] / 2:
            raise BnsError(
                f"The first lamp, to which robots go, is at ({x:g}, {y:g}), off the "
                f"board of {ARENA[0]:g} m x {ARENA[1]:g} m around (0, 0): move it."
            )
        return cls((x, y), config)

    def cost(self, places: np.ndarray, stopped: np.ndarray | None = None) -> np.ndarray:
        """Equation 5.2 with its sign turned, for single executions.

        The dissertation maximises the negative sum over ten starts; here the cost of
        one is minimised (0 = best), and that of several is their mean, so that ten in
        the SNNs compare with one in the world.

        Args:
            places: after the start and after each cycle, ``(..., K + 1, 2)`` [m].
            stopped: cycles lost since somebody stopped the robot for good,
                ``(..., K)``; with `charge_stopped` = "start" they cost as the start
                would, with "far" as being the start's way beyond the goal. None =
                those that begin inside the safety boundary.

        Returns:
            ``(...)``: sum over the cycles of the distance from the goal radius, over
            the distance of the start from the lamp.
        """
        away = self.distances(places)
        if stopped is None:
            stopped = away[..., :-1] < self.config.safety
        begun, after = away[..., :1], away[..., 1:]
        if self.config.charge_stopped != "stand":
            beyond = self.config.goal if self.config.charge_stopped == "far" else 0.0
            after = np.where(stopped, begun + beyond, after)
        found: np.ndarray = np.abs(after - self.config.goal).sum(-1) / begun[..., 0]
        return found

    def distances(self, places: np.ndarray) -> np.ndarray:
        """Distance from the lamp [m], ``(..., K + 1)``."""
        found: np.ndarray = np.hypot(
            *np.moveaxis(places - np.asarray(self.lamp), -1, 0)
        )
        return found

    def reached(self, places: np.ndarray) -> np.ndarray:
        """Whether robots came to the goal radius, ``(...)`` bool; places as `cost`."""
        found: np.ndarray = self.distances(places).min(-1) <= self.config.goal
        return found

    def solved(self, places: np.ndarray, handled: np.ndarray) -> bool:
        """Whether a robot circles the lamp.

        The dissertation judges by eye ("circling the light", figures 5.1 and 5.33).
        Read here: in the last `circle_cycles` cycles its distance from the goal radius
        is `circle_within` on average, it gets `circle_sweep` round the lamp, see
        `circling`, and nobody stopped or turned it.

        Args:
            places: ``(K + 1, 2)`` [m].
            handled: cycles in which somebody did, ``(K,)``.
        """
        config, (off, sweep) = self.config, self.circling(places)
        return bool(
            off <= config.circle_within
            and abs(sweep) >= np.radians(config.circle_sweep)
            and not handled[-config.circle_cycles :].any()
        )

    def circling(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How robots go round the lamp in the last `circle_cycles` cycles.

        Args:
            places: ``(..., K + 1, 2)`` [m].

        Returns:
            Mean distance from the goal radius [m], and how far round they get [rad],
            positive with the lamp on their left; each ``(...)``.
        """
        last = places[..., -self.config.circle_cycles - 1 :, :]
        off = np.abs(self.distances(last) - self.config.goal)[..., 1:].mean(-1)
        ahead, left = np.moveaxis(last - np.asarray(self.lamp), -1, 0)
        azimuth = np.unwrap(np.arctan2(left, ahead))
        return off, azimuth[..., -1] - azimuth[..., 0]

    def start_pool(self) -> np.ndarray:
        """Places of the lamp in the frames of robots that start anywhere.

        Uniform on the board, not near the lamp or the edge, looking anywhere, as
        trials in the world start; always the same pool.

        Returns:
            ``(POOL, 2)`` ahead and left [m].

        Raises:
            BnsError: the lamp leaves no room.
        """
        rng = seeding.generator(0, "light", "starts")
        half = np.asarray(ARENA) / 2 - EDGE
        place = rng.uniform(-half, half, (16 * POOL, 2))
        way = np.asarray(self.lamp) - place
        way = way[np.hypot(*way.T) >= self.config.start_nearest][:POOL]
        if len(way) < POOL:
            raise BnsError(
                f"light.start_nearest = {self.config.start_nearest} leaves hardly any "
                "place on the board; give a smaller one."
            )
        yaw = rng.uniform(-np.pi, np.pi, POOL)
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.stack(
            [cos * way[:, 0] + sin * way[:, 1], cos * way[:, 1] - sin * way[:, 0]], 1
        )


def lamps(config: LightConfig) -> list[dict[str, float]]:
    """The lamps of a configuration as fields with their values.

    Raises:
        BnsError: no lamp, or text that cannot be read.
    """
    if not config.lamps:
        raise BnsError('light.lamps is empty: give one or more, as "x=0,y=0".')
    return [_lamp(text) for text in config.lamps]


def _lamp(text: str) -> dict[str, float]:
    fields = {}
    for piece in filter(None, text.split(",")):
        key, _, value = piece.partition("=")
        try:
            fields[key.strip()] = float(value)
        except ValueError:
            raise BnsError(
                f"Lamp {text!r} cannot be read: give FIELD=NUMBER,... as in "
                '"x=0,y=0,height=0.2,power=10".'
            ) from None
    return fields


def places(trials: Sequence[Trial]) -> np.ndarray:
    """Positions at the start and after each cycle; a lost one is the last seen.

    Returns:
        ``(N, K + 1, 2)`` [m].
    """
    return np.stack([seen_places(trial.command_poses_world) for trial in trials])


def lost(trials: Sequence[Trial]) -> np.ndarray:
    """Cycles from which on a robot was handled to the end: stopped, ``(N, K)`` bool.

    The cycle in which it was stopped was still its own.
    """
    handled = np.stack([trial.handled for trial in trials])
    since = np.logical_and.accumulate(handled[:, ::-1], axis=1)[:, ::-1]
    since[:, 1:] &= since[:, :-1].copy()
    since[:, 0] = False
    return since


class LightTask(Task):
    """Drive to the first lamp by sight, and circle it."""

    sections = ("light", "controller")
    keys = ()
    columns: ClassVar[Mapping[str, str]] = {
        "edge_turns": "how often it was turned at the board's edge",
        "lamp_stops": "how often it was stopped, or turned, at a lamp",
        "turned": "net turn, counter-clockwise positive [rad]",
    }
    closed_loop = True

    @cached_property
    def goal(self) -> LampGoal:
        """Where to be, and what counts as solved."""
        return LampGoal.of(self.config.light)

    @cached_property
    def controllers(self) -> Controllers:
        """What all controllers have in common."""
        return Controllers.of(self.config)

    def surroundings(self) -> dict[str, Any]:
        """The lamps, and who watches over the robots."""
        light = self.config.light
        return {
            "lights": lamps(light),
            "ambient": light.ambient,
            "supervisor": {"safety": light.safety, "at_lamp": light.at_lamp},
        }

    def execute(
        self, world: Any, tried: Sequence[Any], *, trial: int, seeds: Sequence[int]
    ) -> list[Trial]:
        """See `Task.execute`; each controller drives a robot from where the world
        starts it."""
        driven: list[Trial] = world.drive(
            GenomePolicy.of(tried),
            cycles=tried[0].cycles,
            cycle=tried[0].cycle,
            trial=trial,
            seeds=seeds,
        )
        return driven

    @property
    def space(self) -> Space:
        """See `Task.space`: the weights of a network."""
        light, ones = self.config.light, np.ones(self.controllers.genes)
        return Space(
            low=-light.weight_limit * ones,
            high=light.weight_limit * ones,
            first_low=-light.weights * ones,
            first_high=light.weights * ones,
            decode=lambda v: self.attempts(torch.from_numpy(v).float()),
        )

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The gains of both wheels; below one half no command drives straight."""
        gain = "wheel_gain:wheel={},factor=0.5..1.2"
        return tuple(gain.format(side) for side in ("left", "right"))

    def attempts(self, genomes: torch.Tensor) -> list[LightController]:
        """Genomes ``(N, genes)`` as controllers, each for one trial."""
        light = self.config.light
        return [
            LightController(self.controllers, row, light.cycles, light.cycle)
            for row in genomes.cpu()
        ]

    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `LampGoal.cost`."""
        return self.goal.cost(places(trials), lost(trials))

    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """See `Task.measured`.

        `commands` counts the cycles until the robot was stopped, `reached` is 1 where
        it came to the goal radius; beside, readings ``(R, K + 1, 2)`` [counts].
        """
        went = places(tried)
        counted = {
            name: np.array([getattr(t.outcome, name) for t in tried], np.float64)
            for name in ("edge_turns", "lamp_stops")
        }
        sent = [
            np.column_stack([t.commands.values[:, :2], t.commands.durations])
            for t in tried
        ]
        solved = [
            self.goal.solved(path, trial.handled)
            for path, trial in zip(went, tried, strict=True)
        ]
        return {
            "sent": np.stack(sent),
            "poses": np.stack([trial.command_poses_world for trial in tried]),
            "readings": np.stack([readings(trial) for trial in tried]),
            "fitness": self.goal.cost(went, lost(tried)),
            "reached": self.goal.reached(went).astype(np.float64),
            "solved": np.array(solved, np.float64),
            "commands": np.array([_moving(trial) for trial in tried], np.float64),
            "turned": np.array([_turned(trial) for trial in tried]),
            **counted,
        }

    @property
    def picture(self) -> Picture:
        """See `Task.picture`."""
        light = self.config.light
        return Picture(
            name="light following",
            solved="the lamp circled",
            order=("lamp",),
            objectives={"lamp": self.goal.lamp},
            radius=light.goal,
            discs=(
                "The disc has the radius at which the robot is to circle the lamp; at "
                "the orange ring it is stopped."
            ),
            figures=("path", "starts", "readings"),
            captions=CAPTIONS,
            lamps=tuple(lamps(light)),
            ring=light.safety,
        )

    def problem(self) -> "type[Problem]":
        """See `Task.problem`."""
        from bns.learners.bns.light.problem import LightProblem

        return LightProblem


def readings(trial: Trial) -> np.ndarray:
    """What the sensors read at the start and after each cycle, ``(K + 1, 2)``."""
    seen = np.stack([trial.channel(name) for name in READINGS], axis=1)
    found: np.ndarray = seen[trial.boundaries]
    return found


def _turned(trial: Trial) -> float:
    """Net turn over all command ends; less than half a turn a command [rad]."""
    yaw = trial.command_poses_world[:, 2]
    yaw = np.unwrap(yaw[np.isfinite(yaw)])
    return float(yaw[-1] - yaw[0]) if len(yaw) else 0.0


def _moving(trial: Trial) -> int:
    """Cycles until a robot was stopped for good."""
    free = np.flatnonzero(~trial.handled)
    return int(free[-1]) + 1 if len(free) else 0


CAPTIONS = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went. {foreseen}"
        "The disc has the "
        "radius at which the robot is to circle the lamp. Jumps of the heading are "
        "where the robot was turned at the board's edge."
    ),
    "fitness": (
        "Cost of the controller tried in each trial (equation 5.2 with its sign "
        "turned), lower is better, on a logarithmic axis: the distance from the goal "
        "radius, summed over the cycles, over the distance of the start. The dotted "
        "line is the mean. {band}"
    ),
    "solved": (
        "First: whether the robot came to the goal radius. Then: share of runs whose "
        "trial ended with the robot circling the lamp. {band}"
    ),
    "snn_error": (
        "How wrong the motion SNN was about each trial before it was trained on it, "
        "per cycle and output. {band}"
    ),
    "readings": (
        "What the two virtual light sensors read in the trials shown (smaller is "
        "brighter){read}."
    ),
    "starts": (
        "The last trials of the same run, each from its own random start (dots); "
        "crosses: stopped at the lamp's safety boundary."
    ),
}
"""How to read figures where light following reads otherwise than navigation."""

TASK = LightTask
