"""Networks from two light readings to two wheel speeds (thesis 5.2.2), as policies.

A genome is a row of weights in the order: first layer ``(H, I)``, its biases ``(H,)``,
second layer ``(2, H)``, its biases ``(2,)``. Readings come as brightness, 0 in the dark
to 1 in full light; a recurrent controller is fed back its last two outputs. Both
layers are tanh (silent); an output of -1 is the lowest speed, 1 the highest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import metres_per_second

READINGS = 2
OUTPUTS = 2

DARK = 4095.0  # [counts] reading in the dark, 12 bits (Khepera III test program)

Numbers = TypeVar("Numbers", np.ndarray, Tensor)


def brightness(counts: Numbers) -> Numbers:
    """Readings (smaller is brighter) as 0 in the dark to 1 in full light."""
    return (DARK - counts) / DARK


def counts(bright: Numbers) -> Numbers:
    """The reading of a brightness."""
    return DARK * (1 - bright)


@dataclass(frozen=True)
class Controllers:
    """What all controllers of a batch have in common.

    Attributes:
        hidden: neurons H.
        recurrent: whether outputs are fed back.
        slowest, fastest: speeds of the outputs -1 and 1 [m/s].
        dead_band: speeds of a smaller magnitude mean stop [m/s].
        balanced: whether a reading is seen as -1 to 1 instead of 0 to 1.
    """

    hidden: int
    recurrent: bool
    slowest: float
    fastest: float
    dead_band: float
    balanced: bool = False

    @classmethod
    def of(cls, config: RunConfig) -> "Controllers":
        """Those a configuration asks for."""
        return cls(
            hidden=config.light.hidden,
            recurrent=config.light.recurrent,
            slowest=metres_per_second(config.controller.speed_low),
            fastest=metres_per_second(config.controller.speed_high),
            dead_band=metres_per_second(config.controller.dead_band),
            balanced=config.light.readings == "balanced",
        )

    @property
    def inputs(self) -> int:
        """Inputs of a controller: the readings, and what is fed back."""
        return READINGS + (OUTPUTS if self.recurrent else 0)

    @property
    def memory(self) -> int:
        """Numbers that a controller remembers from cycle to cycle."""
        return OUTPUTS if self.recurrent else 0

    @property
    def genes(self) -> int:
        """Weights of a controller."""
        return self.hidden * (self.inputs + 1) + OUTPUTS * (self.hidden + 1)

    def see(self, bright: Numbers) -> Numbers:
        """A brightness, 0 to 1, as the networks take it."""
        return 2 * bright - 1 if self.balanced else bright

    def layers(self, genomes: Tensor) -> tuple[Tensor, ...]:
        """The weights of genomes, the individual as the last axis.

        Args:
            genomes: ``(R, P, genes)``.

        Returns:
            ``(R, I, H, P)``, ``(R, H, P)``, ``(R, 2, H, P)``, ``(R, 2, P)``.

        Raises:
            BnsError: genomes of another length.
        """
        runs, count, length = genomes.shape
        if length != self.genes:
            raise BnsError(
                f"A genome has {length} weights; a controller of {self.hidden} hidden "
                f"neurons and {self.inputs} inputs has {self.genes}."
            )
        sizes = [self.hidden * self.inputs, self.hidden, OUTPUTS * self.hidden, OUTPUTS]
        w1, b1, w2, b2 = genomes.transpose(1, 2).split(sizes, dim=1)
        return (
            w1.reshape(runs, self.hidden, self.inputs, count).transpose(1, 2).clone(),
            b1.contiguous(),
            w2.reshape(runs, OUTPUTS, self.hidden, count),
            b2.contiguous(),
        )

    def act(self, layers: tuple[Tensor, ...], inputs: list[Tensor]) -> list[Tensor]:
        """The outputs, -1 to 1.

        Args:
            layers: as `layers` gives them.
            inputs: brightness left and right, then what is fed back, each
                ``(R, S, P)``.

        Returns:
            Left and right, each ``(R, S, P)``.
        """
        w1, b1, w2, b2 = layers
        total = b1.unsqueeze(2)
        for weight, value in zip(w1.unbind(1), inputs, strict=True):
            total = total + weight.unsqueeze(2) * value.unsqueeze(1)
        active = _tanh(total)  # (R, H, S, P)
        return [
            _tanh((active * w2[:, side].unsqueeze(2)).sum(1) + b2[:, side, None])
            for side in range(OUTPUTS)
        ]

    def remembered(
        self,
        memory: np.ndarray,
        seen: np.ndarray,
        told: np.ndarray,
        speeds: np.ndarray,
    ) -> np.ndarray:
        """What n controllers remember after a cycle, ``(n, memory)``.

        Args:
            memory: before it, ``(n, memory)``.
            seen: the readings as they were seen, ``(n, 2)``.
            told: the outputs, ``(n, 2)``.
            speeds: that these command, ``(n, 2)`` [m/s].
        """
        del seen, speeds
        return told if self.memory else memory

    @property
    def _range(self) -> tuple[float, float]:
        """Middle and half of the range of speeds [m/s]."""
        return (self.fastest + self.slowest) / 2, (self.fastest - self.slowest) / 2

    def speed(self, output: Tensor) -> Tensor:
        """A wheel's speed [m/s] from an output."""
        middle, half = self._range
        speed = middle + half * output
        return torch.where(speed.abs() < self.dead_band, 0.0, speed)

    def output(self, speed: Numbers) -> Numbers:
        """The output that commands a wheel's speed [m/s]; one of those that stop it."""
        middle, half = self._range
        return (speed - middle) / half


def _tanh(total: Tensor) -> Tensor:
    """tanh by a sigmoid, which compiled code computes several times as fast."""
    return 2 * (2 * total).sigmoid() - 1


@dataclass(frozen=True, eq=False)
class LightController:
    """One controller that is to drive one robot for one trial.

    Attributes:
        controllers: what it has in common with others.
        genome: its weights, ``(genes,)``.
        cycles, cycle: how many commands, and how long each lasts [s].
    """

    controllers: Controllers
    genome: Tensor
    cycles: int
    cycle: float


@dataclass(frozen=True, eq=False)
class GenomePolicy:
    """N genomes, one a robot; a `bns.worlds.world.Policy`.

    Attributes:
        controllers: what they have in common.
        genomes: ``(N, genes)``.

    Raises:
        BnsError: a weight that is NaN or infinite, genomes of the wrong length.
    """

    controllers: Controllers
    genomes: Tensor

    @classmethod
    def of(cls, controllers: Sequence[LightController]) -> "GenomePolicy":
        """Attempts with controllers of one kind as one batch."""
        genomes = torch.stack([one.genome for one in controllers])
        return cls(controllers[0].controllers, genomes)

    def __post_init__(self) -> None:
        bad = ~torch.isfinite(self.genomes).all(1)
        if bad.any():
            raise BnsError(
                f"Genome {int(bad.nonzero()[0, 0])} holds NaN or infinity; give finite "
                "weights."
            )
        _ = self._layers  # refuses genomes of the wrong length

    def __len__(self) -> int:
        return len(self.genomes)

    @cached_property
    def _layers(self) -> tuple[Tensor, ...]:
        return self.controllers.layers(self.genomes.unsqueeze(1))

    def memory(self, n: int) -> np.ndarray:
        """What n controllers remember at the start, shape ``(n, M)``."""
        return np.zeros((n, self.controllers.memory))

    def act(
        self, readings: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wheel speeds ``(N, 2)`` [m/s] from readings ``(N, 2)`` [counts].

        Raises:
            BnsError: another number of robots or sensors.
        """
        if np.shape(readings) != (len(self), 2):
            raise BnsError(
                f"Readings of shape {np.shape(readings)} for {len(self)} controllers: "
                f"they need ({len(self)}, 2), the left and the right light sensor."
            )
        seen = self.controllers.see(brightness(readings))
        known = np.concatenate([seen, memory], axis=1).astype(np.float32)
        inputs = torch.from_numpy(known).T[..., None, None]
        outputs = self.controllers.act(self._layers, list(inputs))
        commands = [self.controllers.speed(output) for output in outputs]
        told, speeds = (
            torch.cat([part[:, 0] for part in parts], dim=1).double().numpy()
            for parts in (outputs, commands)
        )
        return speeds, self.controllers.remembered(memory, seen, told, speeds)
