"""What one robot of a closed loop does in a cycle: controls and models for physics."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from bns.worlds.active import Placed, Stages
from bns.worlds.effects.base import ControlSignal
from bns.worlds.physics import compile
from bns.worlds.physics.rollout import Compiled, Segment


class LoopSignal:
    """The commands of one robot, as they come, after the effects on them.

    Args:
        effects: of the command and actuator stages, with when they hold.
        steps: of a cycle.
        cycles: of the trial.
        dt: step [s].
        channels: what the robot is told.
        seed, trial: of what is random.
    """

    def __init__(
        self,
        effects: Sequence[Placed],
        *,
        steps: int,
        cycles: int,
        dt: float,
        channels: tuple[str, ...],
        seed: int,
        trial: int,
    ):
        self._steps, self._dt, self._channels = steps, dt, channels
        self._effects = [
            (item, rng, rng.bit_generator.state)
            for item in effects
            for rng in [item.generator(seed, trial)]
        ]
        self._told, self._count = np.empty((cycles, len(channels))), 0
        self._memoryless = all(
            getattr(item.effect, "memoryless", False) for item in effects
        )

    def __bool__(self) -> bool:
        return bool(self._effects)

    def cycle(self, told: np.ndarray) -> np.ndarray:
        """The next command, ``(C,)``, at each step of its cycle, ``(steps, C)``."""
        self._told[self._count] = told
        self._count += 1
        count = self._count
        first = count - 1 if self._memoryless else 0
        command = np.repeat(np.arange(first, count), self._steps)
        given = ControlSignal(
            times=np.arange(first * self._steps, count * self._steps) * self._dt,
            values=self._told[command],
            command=command,
            channels=self._channels,
            dt=self._dt,
        )
        for item, rng, begin in self._effects:
            rng.bit_generator.state = begin
            values = item.effect.apply(given, item.active(given.times), rng)
            given = replace(given, values=values)
        return given.values[-self._steps :]


class LoopControl:
    """From the commands of one robot, as they come, to segments of its motion.

    Args:
        robot: name of the robot model.
        stages: what holds in this trial.
        steps: physics steps of a cycle.
        cycles: of the trial.
        dt: physics step [s].
        channels: what the robot is told.
        ctrl_per_command: see `RobotModel`.
        seed, trial: of what is random.
    """

    def __init__(
        self,
        robot: str,
        stages: Stages,
        *,
        steps: int,
        cycles: int,
        dt: float,
        channels: tuple[str, ...],
        ctrl_per_command: float,
        seed: int,
        trial: int,
    ):
        self._steps, self._scale, self._count = steps, ctrl_per_command, 0
        self._signal = LoopSignal(
            stages.control,
            steps=steps,
            cycles=cycles,
            dt=dt,
            channels=channels,
            seed=seed,
            trial=trial,
        )
        blank = np.zeros((steps * cycles, 0))
        pieces = compile.segments(robot, stages.body, blank, dt)
        ends = np.cumsum([0, *(len(piece.control) for piece in pieces)]).tolist()
        self._pieces: list[tuple[int, int, Compiled]] = [
            (begin, end, piece.compiled)
            for (begin, end), piece in zip(pairwise(ends), pieces, strict=True)
        ]

    @property
    def first(self) -> Compiled:
        """The model that the trial starts with."""
        return self._pieces[0][2]

    def cycle(self, held: np.ndarray, controls: np.ndarray) -> tuple[Segment, ...]:
        """The next cycle's motion.

        Args:
            held: the command at each physics step of the cycle, ``(steps, C)``.
            controls: of the actuators if nothing changes it, ``(steps, nu)``.
        """
        begin = self._count * self._steps
        self._count += 1
        if self._signal:
            controls = self._signal.cycle(held[0]) * self._scale
        if len(self._pieces) == 1:
            return (Segment(self._pieces[0][2], controls),)
        end = begin + self._steps
        return tuple(
            Segment(model, controls[max(a, begin) - begin : min(b, end) - begin])
            for a, b, model in self._pieces
            if a < end and b > begin
        )
