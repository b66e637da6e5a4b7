"""RMA (Kumar et al. 2021): rapid motor adaptation; what is wrong is read off the past.

As `domain_randomised`, in light following, with two things more. The policy is told
what is wrong with its robot: an encoder makes a few numbers of the true damage, and
policy and encoder are trained together in the model. Then an adaptation module learns
to say these numbers from what was read and commanded in the last cycles, and takes the
encoder's place. It is trained on drives in which it steers itself, as in the original;
the first ones are steered by the encoder.

What trains the policy is CMA-ES, where the original has PPO. No trial in the world
teaches it anything.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from bns.learners.base import Curves, Panel
from bns.learners.domain_randomised import (
    DomainRandomised,
    RandomisedSettings,
    Situations,
    Trained,
)
from bns.snn.training import AdamState, adam
from bns.tasks.base import Space
from bns.tasks.light import lost, readings
from bns.tasks.light_controller import (
    OUTPUTS,
    READINGS,
    Controllers,
    LightController,
    brightness,
)
from bns.worlds.trial import Trial

CYCLE = READINGS + OUTPUTS
"""numbers that are remembered of a cycle"""
RATE, PART, HELD = 0.003, 256, 5
"""of Adam, patterns of a step, and every so-manieth drive that is not learned from"""
LOOK = 50
"""steps after which the module is judged by those drives; the best one is kept"""


@dataclass(frozen=True, kw_only=True)
class RmaSettings(RandomisedSettings):
    """Settings of RMA; the past and its share of the evaluations are our own."""

    latent: int = 2
    """numbers that say what is wrong"""
    past: int = 15
    """cycles from which the adaptation module says them"""
    neurons: int = 24
    """hidden neurons of the adaptation module"""
    adapting: float = 0.15
    """share of the evaluations on which it is trained"""
    rounds: int = 3
    """drives in turn with training; it steers in all but the first"""
    steps: int = 3000
    """training steps after each"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        **RandomisedSettings.bounds,
        "latent": (1, 100, "1"),
        "past": (1, 1000, "cycles"),
        "neurons": (1, 10_000, "neurons"),
        "adapting": (0.01, 0.9, "1"),
        "rounds": (1, 100, "1"),
        "steps": (1, 1e6, "steps"),
    }


@dataclass(frozen=True)
class Informed(Controllers):
    """Networks that are given readings and what is wrong.

    Attributes:
        latent: numbers that say it.
    """

    latent: int = 2

    @property
    def inputs(self) -> int:
        """See `Controllers.inputs`."""
        return READINGS + self.latent


@dataclass(frozen=True)
class RmaControllers(Informed):
    """Networks beside the numbers that say what is wrong, or the module that does.

    Genomes have the network's weights first, then these numbers or the module's
    weights: first layer ``(H, I)``, biases, second layer ``(latent, H)``, biases.

    Attributes:
        past: cycles that the module sees; 0 = the numbers are in the genome.
        neurons: of the module.
    """

    past: int = 0
    neurons: int = 24

    @cached_property
    def base(self) -> Informed:
        """The networks alone."""
        names = Informed.__dataclass_fields__
        return Informed(**{name: getattr(self, name) for name in names})

    @property
    def sizes(self) -> list[int]:
        """Weights of the module, layer by layer, or of the numbers in its place."""
        if not self.past:
            return [self.latent]
        hidden = self.neurons
        return [hidden * self.memory, hidden, self.latent * hidden, self.latent]

    @property
    def genes(self) -> int:
        """See `Controllers.genes`."""
        return self.base.genes + sum(self.sizes)

    @property
    def memory(self) -> int:
        """See `Controllers.memory`: what was read and told, the newest cycle last."""
        return CYCLE * self.past

    def layers(self, genomes: Tensor) -> tuple[Tensor, ...]:
        """See `Controllers.layers`; behind them those of the module."""
        first, *rest = genomes.split([self.base.genes, *self.sizes], dim=2)
        return (*self.base.layers(first), *(part.unsqueeze(2) for part in rest))

    def act(self, layers: tuple[Tensor, ...], inputs: list[Tensor]) -> list[Tensor]:
        """See `Controllers.act`."""
        seen, past = inputs[:READINGS], inputs[READINGS:]
        said = layers[4]  # (R, P, 1, latent)
        if self.past:
            known = torch.stack(past, dim=-1).transpose(1, 2)  # (R, P, S, I)
            said = self.said(layers[4:], known)
        numbers = said.transpose(1, 2).expand(-1, seen[0].shape[1], -1, -1)
        return self.base.act(layers[:4], [*seen, *numbers.unbind(-1)])

    def said(self, module: Sequence[Tensor], known: Tensor) -> Tensor:
        """What modules say is wrong.

        Args:
            module: their layers, each ``(..., 1, weights)``.
            known: what was remembered, ``(..., S, memory)``.

        Returns:
            ``(..., S, latent)``.
        """
        w1, b1, w2, b2 = module
        batch = w1.shape[:-2]
        first = w1.reshape(*batch, self.neurons, self.memory).mT
        second = w2.reshape(*batch, self.latent, self.neurons).mT
        found: Tensor = (known @ first + b1).tanh() @ second + b2
        return found

    def remembered(
        self,
        memory: np.ndarray,
        seen: np.ndarray,
        told: np.ndarray,
        speeds: np.ndarray,
    ) -> np.ndarray:
        """See `Controllers.remembered`; of outputs, what they commanded."""
        del told  # those in the dead band are one and the same
        return self.pushed(memory, seen, speeds) if self.past else memory

    def pushed(
        self, memory: np.ndarray, seen: np.ndarray, speeds: np.ndarray
    ) -> np.ndarray:
        """What is remembered once a cycle has taken the place of the oldest one.

        Args:
            memory: before it, ``(n, memory)``.
            seen: the readings as they were seen, ``(n, 2)``.
            speeds: that were commanded, ``(n, 2)`` [m/s].
        """
        return np.concatenate([memory[:, CYCLE:], seen, self.output(speeds)], axis=1)


class Adapted(Trained):
    """What one run knows; all attributes are arrays.

    Attributes:
        encoder: layer ``(latent, P)`` and biases ``(latent,)``, one after another.
        module: weights of the adaptation module, ``(W,)``.
        miss: its error on drives that it has not learned from, as a share of the
            standard deviation of what it is to say, ``()``.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder, self.module = np.empty(0), np.empty(0)
        self.miss = np.array(np.nan)


class Patterns(NamedTuple):
    """What the adaptation module learns from.

    Attributes:
        known: what was remembered, ``(M, memory)``.
        wanted: what the encoder says, ``(M, latent)``.
        held: those of drives that it does not learn from, ``(M,)`` bool.
    """

    known: np.ndarray
    wanted: np.ndarray
    held: np.ndarray


class Rma(DomainRandomised):
    """R runs of RMA; arguments as `Learner`."""

    Settings = RmaSettings
    columns: ClassVar[Mapping[str, str]] = {
        **DomainRandomised.columns,
        "encoding_miss": "error of the adaptation module in the model, as a share of "
        "the standard deviation of what it is to say",
    }
    figures = (
        *DomainRandomised.figures,
        Curves(
            name="encoding_miss",
            title="Error of the adaptation module",
            caption="On drives in the model that it has not learned from. {band}",
            label="share of the standard deviation",
            panels=(Panel("encoding_miss", "in the model"),),
        ),
    )
    memories: list[Any]

    def memory(self) -> Adapted:
        """See `DomainRandomised.memory`."""
        return Adapted()

    def begin(self) -> None:
        """See `DomainRandomised.begin`."""
        super().begin()
        plain = replace(self.light.controllers, recurrent=False)
        self.rule: RmaSettings = cast(RmaSettings, self.config.settings)
        rule = self.rule
        names = Controllers.__dataclass_fields__
        common = {name: getattr(plain, name) for name in names}
        self.told = RmaControllers(**common, latent=rule.latent)
        self.adapting = replace(self.told, past=rule.past, neurons=rule.neurons)

    @property
    def space(self) -> Space:
        """See `DomainRandomised.space`: weights of network and encoder."""
        light = self.config.light
        ones = np.ones(self.told.base.genes + self.rule.latent * (self._truths + 1))
        return Space(
            low=-light.weight_limit * ones,
            high=light.weight_limit * ones,
            first_low=-light.weights * ones,
            first_high=light.weights * ones,
            decode=lambda vectors: [*vectors],
        )

    @property
    def _truths(self) -> int:
        return len(self.unknowns)

    def candidates(self, vectors: np.ndarray, points: np.ndarray) -> list[Any]:
        """See `DomainRandomised.candidates`: the encoder tells what is wrong."""
        weights, encoders = np.split(vectors, [self.told.base.genes], axis=1)
        said = self.encoded(encoders, points)
        return self._driving(self.told, np.concatenate([weights, said], axis=1))

    def encoded(self, encoders: np.ndarray, points: np.ndarray) -> np.ndarray:
        """What N encoders make of what is wrong, ``(N, latent)``, -1 to 1.

        Args:
            encoders: ``(N, latent (P + 1))``.
            points: what is wrong, ``(N, P)`` from 0 to 1.
        """
        latent = self.rule.latent
        layer, bias = np.split(encoders, [latent * self._truths], axis=1)
        layer = layer.reshape(-1, latent, self._truths)
        driven = np.einsum("nlp,np->nl", layer, 2 * points - 1) + bias
        return np.tanh(driven / 4)  # the weights' range is that of the network's

    def _driving(self, kind: RmaControllers, genomes: np.ndarray) -> list[Any]:
        light, rows = self.config.light, torch.from_numpy(genomes).float()
        return [LightController(kind, row, light.cycles, light.cycle) for row in rows]

    def deployed(self, memory: Trained) -> Any:
        """See `DomainRandomised.deployed`: network and adaptation module."""
        known = cast(Adapted, memory)
        genome = np.concatenate([known.policy, known.module])
        return self._driving(self.adapting, genome[None])[0]

    def train(self, memory: Trained, situations: Situations) -> None:
        """See `DomainRandomised.train`; then the adaptation module."""
        known = cast(Adapted, memory)
        drives = int(self.rule.adapting * situations.model.left) // self.rule.rounds
        most = situations.model.left - drives * self.rule.rounds
        self.search(known, situations, most)
        whole = known.policy
        known.policy, known.encoder = np.split(whole, [self.told.base.genes])
        patterns: list[Patterns] = []
        for number in range(self.rule.rounds):
            points, seeds = situations.draw(drives)
            tried = self.candidates(np.tile(whole, (drives, 1)), points)
            if number > 0:
                tried = [self.deployed(known)] * drives
            trials = situations.drive(tried, points, seeds)
            said = self.encoded(np.tile(known.encoder, (drives, 1)), points)
            patterns.append(self.patterns(trials, said))
            self.fit(known, patterns, situations.rng)

    def patterns(self, trials: Sequence[Trial], said: np.ndarray) -> Patterns:
        """What was remembered before each cycle of N drives, and what is to be said.

        Args:
            trials: N.
            said: by the encoder, ``(N, latent)``.
        """
        kind = self.adapting
        seen = np.stack([kind.see(brightness(readings(t)))[:-1] for t in trials])
        speeds = np.stack([trial.commands.values for trial in trials])
        memory, cycles = np.zeros((len(trials), kind.memory)), []
        for cycle in range(seen.shape[1]):
            cycles.append(memory)
            memory = kind.pushed(memory, seen[:, cycle], speeds[:, cycle])
        known = np.stack(cycles, 1)
        own = ~lost(trials) & np.isfinite(known).all(2)
        held = np.arange(len(trials)) % HELD == HELD - 1
        robots = np.nonzero(own)[0]
        return Patterns(known[own], said[robots], held[robots])

    def says(self, module: Tensor, known: np.ndarray) -> Tensor:
        """What an adaptation module says is wrong, ``(M, latent)``.

        Args:
            module: its weights, ``(W,)``.
            known: what was remembered, ``(M, memory)``.
        """
        parts = [part.unsqueeze(0) for part in module.split(self.adapting.sizes)]
        return self.adapting.said(parts, torch.from_numpy(known).float())

    def fit(
        self, memory: Adapted, rounds: Sequence[Patterns], rng: np.random.Generator
    ) -> None:
        """Train the adaptation module of a run.

        Args:
            memory: whose module and `miss` it is.
            rounds: patterns of all drives so far, those of each round.
            rng: of all that is drawn.
        """
        kind = self.adapting
        known, wanted, held = (
            np.concatenate(part) for part in zip(*rounds, strict=True)
        )
        if not len(memory.module):
            fan = [kind.memory, 1, kind.neurons, 1]
            scale = np.repeat(np.sqrt([1 / fan[0], 0, 1 / fan[2], 0]), kind.sizes)
            memory.module = scale * rng.standard_normal(len(scale))
        theta = torch.from_numpy(memory.module).float()
        inputs, targets = known[~held], torch.from_numpy(wanted[~held]).float()
        state, rate = AdamState.fresh(theta), torch.tensor(RATE)
        best, miss = theta, self._miss(theta, known[held], wanted[held])
        for step in range(self.rule.steps):
            rows = rng.integers(len(inputs), size=PART)
            leaf = theta.detach().requires_grad_()
            error = (self.says(leaf, inputs[rows]) - targets[rows]).square().mean()
            (grad,) = torch.autograd.grad(error, leaf)
            number = torch.tensor(float(step + 1))
            theta, state = adam(theta, grad, state, rate, number)
            if (step + 1) % LOOK == 0:
                now = self._miss(theta, known[held], wanted[held])
                best, miss = (theta, now) if now <= miss else (best, miss)
        memory.module = best.double().numpy()
        memory.miss = np.array(miss / max(float(wanted.std(0).mean()), 1e-9))

    def _miss(self, theta: Tensor, known: np.ndarray, wanted: np.ndarray) -> float:
        """Root mean square error of a module; infinite where there is nothing."""
        if not len(known):
            return float(np.inf)
        with torch.no_grad():
            made = self.says(theta, known).double().numpy()
        return float(np.sqrt(((made - wanted) ** 2).mean()))

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`; nothing is learned."""
        miss = np.array([float(memory.miss) for memory in self.memories])
        return super().observe(trial, tried, best) | {"encoding_miss": miss}


LEARNER = Rma
