"""Walking: lists of servo goals that carry a legged robot as far as they can.

Of gaits that repeat themselves (36 numbers, Cully et al. 2015) each leg's coxa and
femur follow a square wave of their own amplitude, phase and duty cycle, smoothed over a
tenth of its period; the tibia does the opposite of the femur, so that the foot stays
below the knee. A controller samples it at its commands, `PERIOD` of them a period.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import torch

from bns.evolution.chromosome import Population
from bns.evolution.goals import Goals
from bns.tasks.base import Arrays, Curve, Picture, Space, Task
from bns.worlds.trial import Commands, Trial

if TYPE_CHECKING:
    from bns.experiment.record import RunRecord
    from bns.learners.bns.problem import Problem

CENTIMETRES = 100.0  # [cm/m] scores are in the dissertation's unit
FLAGS = ("fell", "collided", "overloaded", "overheated", "unrested")
"""of the outcome, each a column of 0 and 1"""


def distance(poses_world: np.ndarray) -> np.ndarray:
    """From the first to the last pose that was seen, along axis -2 [m].

    Args:
        poses_world: ``(..., K + 1, 3)``, NaN where lost; the first is known.

    Returns:
        ``(...,)``.
    """
    places = poses_world[..., :2]
    seen = np.isfinite(places).all(-1)
    last = places.shape[-2] - 1 - seen[..., ::-1].argmax(-1)
    end = np.take_along_axis(places, last[..., None, None], axis=-2)[..., 0, :]
    found: np.ndarray = np.hypot(*np.moveaxis(end - places[..., 0, :], -1, 0))
    return found


def cost(ways: np.ndarray) -> np.ndarray:
    """Fitness, lower is better: the square of distances [m], its sign turned [cm2].

    Its sum over the trials after damage is equation 7.4, the sign turned.
    """
    return -((CENTIMETRES * ways) ** 2)


def of_trials(trials: Sequence[Trial]) -> np.ndarray:
    """How far N robots got, ``(N,)`` [m]; one whose physics diverged got nowhere."""
    ways = distance(np.stack([trial.command_poses_world for trial in trials]))
    good = [trial.outcome.usable for trial in trials]
    return np.where(good, np.nan_to_num(ways), 0.0)


class WalkTask(Task):
    """Get far from the start; a gait is adequate from `walk.adequate` on.

    Controllers are `walk.commands` commands of a goal a servo; a vector holds them
    command by command [rad from half-way].
    """

    sections = ("walk",)
    keys = ()
    from_zero = True
    makes_controllers = ("walk.commands", "walk.limit", "walk.reach")
    columns: ClassVar[Mapping[str, str]] = {
        "distance": "from start to end [m]",
        "seconds": "what the trial took [s]",
        "fell": "1 where belly or hip touched the floor",
        "collided": "1 where parts of the robot touched each other",
        "overloaded": "1 where a servo pushed in vain for too long",
        "overheated": "1 where a servo became too hot",
        "unrested": "1 where a command ended by its time limit",
    }

    @cached_property
    def goals(self) -> Goals:
        """What the goals may be.

        Raises:
            BnsError: a robot without legs.
        """
        return Goals.of(self.config)

    def surroundings(self) -> dict[str, Any]:
        """Nothing: the robot starts in the middle of the board, at rest."""
        return {}

    @property
    def space(self) -> Space:
        """See `Task.space`."""
        goals, count = self.goals, self.goals.max_commands
        lowest, highest = goals.low.cpu(), goals.high.cpu()
        first = lowest.clamp(min=-goals.initial), highest.clamp(max=goals.initial)
        low, high, first_low, first_high = (
            np.tile(edge.double().numpy(), count) for edge in (lowest, highest, *first)
        )
        return Space(low, high, first_low, first_high, self._decode)

    def _decode(self, vectors: np.ndarray) -> list[Commands]:
        shape = (len(vectors), 1, *self.goals.gene_shape)
        genes = torch.from_numpy(vectors.reshape(shape))
        lengths = torch.full(shape[:2], self.goals.max_commands)
        return self.goals.commands(Population(genes, lengths))

    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `cost`."""
        return cost(of_trials(trials))

    def worth(self, trials: Sequence[Trial]) -> np.ndarray:
        """Distances [m], ``(N,)``."""
        return of_trials(trials)

    @property
    def genotypes(self) -> dict[str, Space]:
        """See `Task.genotypes`; six legs of three servos have "gait" (`gaits`), too."""
        found, count = super().genotypes, SIZE
        if len(self.goals.channels) == 18:
            none, all_of_it = np.zeros(count), np.ones(count)
            found["gait"] = Space(none, all_of_it, none, all_of_it, self._gaits)
        return found

    def _gaits(self, genes: np.ndarray) -> list[Commands]:
        reach = min(self.config.walk.reach, REACH)
        found = goals(genes, self.goals.max_commands, reach)
        return self.space.controllers(found.reshape(len(genes), -1))

    def behaviour(self, trials: Sequence[Trial]) -> np.ndarray:
        """Share of commands in which each leg is not told to be up, ``(N, L)``."""
        names = [channel.name for channel in self.goals.channels]
        femurs = [at for at, name in enumerate(names) if name.endswith("_femur")]
        told = np.stack([trial.commands.values for trial in trials])
        return down(told, np.array(femurs))

    @property
    def unknowns(self) -> tuple[str, ...]:
        """How far each leg is held up."""
        names = [channel.name.rpartition("_")[0] for channel in self.goals.channels]
        legs = dict.fromkeys(names)
        return tuple(f"leg_raised:legs={leg},blend=0..1" for leg in legs)

    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """See `Task.measured`; sent are goals ``(R, K, C)`` [rad]."""
        ways, walk = of_trials(tried), self.config.walk
        flags = {
            name: np.array([float(getattr(trial.outcome, name)) for trial in tried])
            for name in FLAGS
        }
        solved = (ways >= walk.adequate) * (1.0 - flags["fell"] * walk.upright)
        return {
            "fitness": cost(ways),
            "distance": ways,
            "solved": solved,
            "reached": solved,
            "seconds": np.array([float(t.times[-1] - t.times[0]) for t in tried]),
            "commands": np.array([float(len(trial.commands)) for trial in tried]),
            **flags,
            "sent": np.stack([trial.commands.values for trial in tried]),
            "poses": np.stack([trial.command_poses_world for trial in tried]),
        }

    def durations(self, record: "RunRecord", at: tuple[Any, Any]) -> np.ndarray:
        """See `Task.durations`; all commands of a trial count as equally long."""
        seconds = np.asarray(record["seconds"][at])[..., None]
        count = record.sent.shape[2]
        return np.repeat(seconds / max(count, 1), count, axis=-1)

    @property
    def picture(self) -> Picture:
        """See `Task.picture`."""
        enough = self.config.walk.adequate
        return Picture(
            name="walking",
            solved=f"{enough:g} m walked",
            order=("",),
            objectives={"": (0.0, 0.0)},
            radius=enough,
            discs=(
                "An adequate gait gets out of the disc. The body is drawn level, its "
                "legs as the servos reported them."
            ),
            curve=Curve(
                column="distance",
                label="distance [m] (higher is better)",
                title="Distance walked in the world",
                log=False,
                chart="Distance walked over trials [m] (brown: damaged)",
                marks=((enough, ""),),
            ),
            reached="Adequate gait",
            wheels=False,
            titles={"solved": "Adequate gaits"},
            captions=CAPTIONS,
        )

    def problem(self) -> "type[Problem]":
        """See `Task.problem`."""
        from bns.learners.bns.walking import WalkProblem

        return WalkProblem


CAPTIONS = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went, command by "
        "command. {foreseen}An "
        "adequate gait gets out of the disc."
    ),
    "fitness": (
        "Distance from start to end of the controller tried in each trial, higher is "
        "better; the dotted line is an adequate gait ({adequate:g} m). The fitness "
        "stored is its square with the sign turned (equation 7.4). {band}"
    ),
    "solved": (
        "First: whether the gait was adequate ({adequate:g} m). Then: share of runs "
        "whose trial was. {band}"
    ),
    "waits": (
        "Share of runs that had found an adequate gait{again}. A curve that ends below "
        "100 % tells of runs that never did. The dotted line drops from the median."
    ),
}
"""How to read figures where walking reads otherwise than navigation."""

TASK = WalkTask


SIZE = 36
PERIOD = 4
"""commands of a period; assumed"""
REACH = 0.6
"""[rad] largest amplitude; assumed, as far as BNS lets its goals go"""
SMOOTHED = 0.1
"""share of a period over which the wave changes sides (Cully et al. 2015)"""
_POINTS = 20


def goals(genes: np.ndarray, commands: int, reach: float = REACH) -> np.ndarray:
    """Servo goals of gaits.

    Args:
        genes: each from 0 to 1, ``(N, 36)``: leg by leg amplitude, phase and duty cycle
            of the coxa, then of the femur.
        commands: K.
        reach: amplitude of 1 [rad].

    Returns:
        ``(N, K, 18)`` [rad] from half-way, leg by leg coxa, femur, tibia.
    """
    amplitude, phase, duty = np.moveaxis(genes.reshape(-1, 1, 6, 2, 3), -1, 0)
    times = np.arange(commands)[None, :, None, None] / PERIOD + phase
    around = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    wave = np.zeros(np.broadcast_shapes(times.shape, duty.shape))
    for offset in SMOOTHED * around:
        wave += np.where((times + offset) % 1.0 < duty, 1.0, -1.0) / _POINTS
    angles = reach * amplitude * wave
    coxa, femur = angles[..., 0], angles[..., 1]
    found: np.ndarray = np.stack([coxa, femur, -femur], axis=-1)
    return found.reshape(len(genes), commands, 18)


def down(goals: np.ndarray, lifting: np.ndarray) -> np.ndarray:
    """Share of commands in which each leg is not told to be up.

    Args:
        goals: ``(N, K, C)`` [rad] from half-way.
        lifting: the channel of each leg that lifts it, ``(L,)``.

    Returns:
        ``(N, L)``, from 0 to 1: what duty factors a gait asks for.
    """
    found: np.ndarray = (goals[:, :, lifting] <= 0.0).mean(1)
    return found
