"""The learner's hot loops beside the same ones written for JAX.

Navigation as in `khepera-simple`: thirty runs of a hundred controllers. A trial evolves
its population inside the networks and trains these on what was seen; both are timed,
ours and JAX in turn, each on all cores. In JAX the evolution of a trial is one compiled
call, random numbers included, written an individual at a time and mapped over
individuals and runs. Before anything is timed, both are given the same random numbers
and have to come to the same children, costs and weights.

EvoTorch is not compared: its operators know no lists of different lengths.
"""

from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np
import torch

from bench.result import Result, bench
from bench.speed.learners import BATCH, simple
from bench.speed.overhead import interleaved
from bns.errors import BnsError, MissingDependencyError

BAR = 0.5
PATTERNS = 640  # of each run: some sixty trials
CLOSE = 2e-3  # of costs and weights, relative; float32
FEW = 5  # generations and epochs after which they are compared


@bench(
    "navigation, 30 runs: evolution and training of a trial, ours over JAX on 2 cores",
    bar="<= 0.5 x",
)
def learner_peers(quick: bool) -> Result:
    """`khepera-simple`; quick: three rounds. Needs the extra `peers`."""
    peer, own = _peer(), Own()
    apart = agreement(peer, own)
    if max(apart.values()) > CLOSE:
        raise BnsError(
            f"Ours and JAX differ by {apart}: what is timed is not the same."
        )
    calls = {
        "evolution, ours": own.evolve,
        "evolution, JAX": lambda: peer.evolve(own),
        "training, ours": own.train,
        "training, JAX": lambda: peer.train(own),
    }
    rounds = 3 if quick else 15
    # the first of each compiles
    seconds = interleaved(tuple(calls.values()), rounds + 1)[1:, :, 0]
    bred, bred_there, trained, trained_there = map(median, seconds.T.tolist())
    ratio = (bred + trained) / (bred_there + trained_there)
    taken = (bred, bred_there, trained, trained_there)
    return Result(
        figure=round(ratio, 3),
        unit="x",
        holds=None if quick else ratio <= BAR,
        n=rounds,
        details={
            **{
                f"{name} [s]": round(found, 4)
                for name, found in zip(calls, taken, strict=True)
            },
            "evolution alone": round(bred / bred_there, 3),
            "training alone": round(trained / trained_there, 3),
            "differ by": apart,
        },
    )


def _peer() -> Any:
    try:
        import jax
    except ImportError as error:
        raise MissingDependencyError(
            "learner-peers", "jax", "pip install 'bns-testbed[peers]'"
        ) from error
    from bench.speed.navigation_in_jax import Peer

    return Peer(jax)


def agreement(peer: Any, own: "Own") -> dict[str, float]:
    """How far both are apart on the same random numbers, relative."""
    population, cost = own.population, own.cost
    lists, costs = peer.arrays(population, cost)
    for _ in range(FEW):
        coins = own.problem.breeder.draw(own.problem.draws, own.rates)
        population, cost = own.problem.generation(
            [own.memory], population, cost, own.rates, coins
        )
        lists, costs = peer.generation(own, lists, costs, coins)
    theta, there = own.trained(FEW), peer.trained(own, FEW)
    return {
        "genes": _apart(population.genes.numpy(), np.asarray(lists[0])),
        "costs": _apart(cost.numpy(), np.asarray(costs)),
        "weights": _apart(theta.numpy(), np.asarray(there)),
    }


def _apart(mine: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.abs(mine - theirs).max() / np.abs(mine).max())


class Own:
    """The learner of this package, with patterns to train on."""

    def __init__(self) -> None:
        from bns.snn.training import Patterns, epoch_of

        batch, _ = simple(BATCH)
        learner: Any = batch.learner
        self.config = learner.config
        self.problem = learner.problem
        (self.memory,) = learner.memories
        self.population = learner.population
        self.rates = self.problem.rates(0)
        self.cost = self.problem.cost([self.memory], self.population)
        rng = np.random.default_rng(0)
        shape = self.problem.shape
        self.inputs = rng.uniform(-1, 1, (BATCH, shape.inputs, PATTERNS))
        mixed = rng.normal(size=(BATCH, 3, shape.inputs)) @ self.inputs
        self.targets = np.tanh(mixed)
        self.patterns = Patterns(
            torch.from_numpy(self.inputs).float(),
            torch.from_numpy(self.targets).float(),
            torch.ones(BATCH, 1, 1, PATTERNS),
        )
        self.epoch = torch.compile(epoch_of(shape, self.config.snn), dynamic=False)

    def evolve(self) -> object:
        """The generations of a trial."""
        return self.problem.evolve(
            [self.memory],
            self.population,
            self.cost,
            self.rates,
            self.config.evolution.generations,
        )

    def train(self) -> object:
        """The epochs of a trial."""
        return self.trained(self.config.snn.epochs)

    def trained(self, epochs: int) -> torch.Tensor:
        """Weights after some epochs."""
        from bns.snn.training import fit

        snn, problem = replace(self.config.snn, epochs=epochs), self.problem
        given = problem.shape, snn, self.memory.theta, self.patterns
        return fit(*given, problem.draws, self.epoch)[0]
