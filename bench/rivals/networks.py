"""Rivals whose models or controllers are networks: SNN, PETS, NEAT, RMA.

The static SNN is to transfer, and not to recover; PETS is to be about as quick as BNS
with as many evaluations inside the networks. NEAT is as its authors had it: exclusive
or, then light following inside the SNNs. Stanley and Miikkulainen (2002), section 4.1:
of 100 runs none failed, in 4,755 evaluations on average (standard deviation 2,553),
with 2.35 hidden nodes. Their populations had 150 networks, here they have 100.

Domain randomisation and RMA are trained on damage at random, and learn nothing in the
world. Both circle the lamp in light following. Situations of the benches, damages and
starts, are new to them. The damages lie in the range that they were trained in.
"""

from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import torch

from bench.result import Result, bench
from bench.rivals import batches
from bns import presets
from bns.evolution.neat import Lineage, NeatSettings, bred
from bns.evolution.topology import SLOPE, Ends, Marks, networks, sizes
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.experiment.run import train
from bns.experiment.world_factory import make_models, make_world
from bns.learners import registry
from bns.learners.domain_randomised import Situations
from bns.worlds.world import CountedWorld

SLOW = "wheel_gain:wheel=left,factor=0.8"
RUNS, AFTER = 10, 5
TRANSFERS, RECOVERS = 0.5, 0.1
PRETORIUS = {"settings.commands": 5000, "settings.trainings": 20}
"""commands of Pretorius et al. (2009)"""


@bench(
    "runs of the static SNN whose transferred controller solves navigation, share",
    bar=">= 0.5 with 5,000 random commands, and <= 0.1 after the left wheel is 20 % "
    "slower",
)
def faithful_static_snn(quick: bool) -> Result:
    """`RUNS` runs, `AFTER` trials before the damage and after; quick: three, 360.

    The original reports that controllers transferred, and no share of them (thesis
    2.7); one half is this project's reading.
    """
    runs = 3 if quick else RUNS
    each = presets.load("khepera-simple").controller.max_commands
    told = {"settings.commands": 10 * each} if quick else PRETORIUS
    transfer = -(-told["settings.commands"] // each)
    onset = transfer + AFTER
    told = {**told, "world.damage": [f"{SLOW}@{onset}"]}
    trials = onset + AFTER
    seen = batches.columns("static_snn", runs=runs, trials=trials, **told)
    solved = seen["solved"]
    share, after = solved[:, transfer:onset].mean(), solved[:, onset:].mean()
    return Result(
        figure=round(float(share), 4),
        unit="1",
        holds=None if quick else bool(share >= TRANSFERS and after <= RECOVERS),
        n=runs,
        details={
            "random trials": transfer,
            "solved after the damage": round(float(after), 4),
            "objectives reached by each run": seen["reached"][:, transfer].tolist(),
            "error of a command's turn [rad]": {
                "undamaged": round(float(seen["snn_turn"][:, transfer].mean()), 4),
                "last trial": round(float(seen["snn_turn"][:, -1].mean()), 4),
            },
        },
    )


MOST, TIMES = 30, 1.5


@bench(
    "trials until PETS has solved navigation, over those of BNS (medians)",
    bar="<= 1.5 x, about as many evaluations inside the networks",
)
def faithful_pets(quick: bool) -> Result:
    """`RUNS` undamaged runs of `MOST` trials each; quick: 3 of 10 trials."""
    runs, trials = (3, 10) if quick else (RUNS, MOST)
    found = {}
    for learner in ("pets", "bns"):
        solved = batches.columns(learner, runs=runs, trials=trials)["solved"]
        first = np.where(solved.any(1), solved.argmax(1) + 1, trials + 1)
        found[learner] = {
            "trials until solved": first.tolist(),
            "median": float(np.median(first)),
            "solved, last ten trials": round(float(solved[:, -10:].mean()), 4),
        }
    figure = found["pets"]["median"] / found["bns"]["median"]
    known = found["pets"]["median"] <= trials
    return Result(
        figure=round(figure, 3),
        unit="x",
        holds=None if quick else bool(known and figure <= TIMES),
        n=runs,
        details={**found, "never": trials + 1},
    )


INPUTS = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
WANTED = np.array([0.0, 1.0, 1.0, 0.0])
ENDS = Ends(inputs=2, outputs=1)
RULE = NeatSettings(stale=15, stuck=20)
EVOLVED, GENERATIONS = 100, 200  # generations
PUBLISHED, SPREAD = 4755, 2553  # evaluations
TRIALS, LEAST = 15, 0.9  # share of the runs, as of BNS in `solve-light`


@bench(
    "NEAT: evaluations until exclusive or is solved; runs that circle the lamp in 15",
    bar="every run of exclusive or within 20,000, mean <= 7,308; lamp >= 0.9 of 30",
)
def faithful_neat(quick: bool) -> Result:
    """Both; quick: ten runs of exclusive or, two of light following for five trials."""
    runs = 10 if quick else EVOLVED
    rows = [exclusive_or(RULE, seed) for seed in range(runs)]
    solved = [row for row in rows if row is not None]
    spent = [row[0] * RULE.population for row in solved]
    mean = float(np.mean(spent)) if spent else float(GENERATIONS * RULE.population)
    first = circled(5 if quick else TRIALS, 2 if quick else 30)
    share = float(np.mean([trial > 0 for trial in first]))
    details: dict[str, object] = {
        "solved": len(solved),
        "longest": max(spent, default=0),
        "hidden nodes": float(np.mean([row[1] for row in solved])),
        "connections": float(np.mean([row[2] for row in solved])),
        "published": {"evaluations": PUBLISHED, "hidden nodes": 2.35, "failed": 0},
        "first trial at the lamp, 0 = never": first,
        "share at the lamp": share,
    }
    holds = len(solved) == runs and mean <= PUBLISHED + SPREAD and share >= LEAST
    return Result(
        figure=mean,
        unit="evaluations",
        holds=None if quick else holds,
        n=runs,
        details=details,
    )


def exclusive_or(rule: NeatSettings, seed: int) -> tuple[int, int, int] | None:
    """Generations until a network is right, its hidden nodes and its connections.

    Args:
        rule: settings.
        seed: of the run.

    Returns:
        None where none is after `GENERATIONS` generations.
    """
    rng, lineage, marks = np.random.default_rng(seed), Lineage(), Marks.of(ENDS)
    weights = rng.uniform(-rule.power, rule.power, (rule.population, ENDS.links))
    genes = ENDS.first(weights, rule.most)
    for generation in range(GENERATIONS):
        said = answers(genes)
        right = ((said > 0.5) == (WANTED > 0.5)).all(1)
        if right.any():
            found = genes[[right.argmax()]]
            return generation + 1, *next(iter(sizes(found, ENDS)))
        worth = (4 - np.abs(said - WANTED).sum(1)) ** 2
        genes = bred(genes, worth, lineage, marks, ENDS, rule, rng)
    return None


def answers(genes: np.ndarray) -> np.ndarray:
    """What networks ``(P, C, 5)`` say of the four inputs, ``(P, 4)``."""
    inner, outer, passes = networks(genes, ENDS)
    driven = outer @ np.column_stack([INPUTS, np.ones(4)]).T
    active = 1 / (1 + np.exp(-SLOPE * driven))
    for _ in range(passes):
        active = 1 / (1 + np.exp(-SLOPE * (inner @ active + driven)))
    said: np.ndarray = active[:, 0]
    return said


def circled(trials: int, runs: int) -> list[int]:
    """The first trial, from 1, in which each run circles the lamp; 0 = none."""
    config = with_learner(presets.load("khepera-light"), "neat")
    config = replace(config, trials=trials, replicates=runs, record_replicates=0)
    solved = train(replace(config, threads=1))["solved"] > 0
    first = np.where(solved.any(1), solved.argmax(1) + 1, 0)
    return first.tolist()


TRAINED, DRIVES = 3, 200
SEED = 1
"""the settings were chosen on seed 0"""
HOLDS = 0.8


class Driven(NamedTuple):
    """What came of policies.

    Attributes:
        learner: that trained them.
        points: what was wrong in the drives in range, ``(D, P)`` from 0 to 1.
        trials: of each run in range, D.
        undamaged, in_range: share that circled the lamp, of each run.
        cost: mean in range, of each run.
    """

    learner: Any
    points: np.ndarray
    trials: list[list[Any]]
    undamaged: list[float]
    in_range: list[float]
    cost: list[float]

    @property
    def shown(self) -> dict[str, list[float]]:
        """The figures of each run."""
        return {
            "solved undamaged": self.undamaged,
            "solved in range": self.in_range,
            "cost in range": self.cost,
        }


def _on_damage(name: str, runs: int, *, random: bool) -> RunConfig:
    base = presets.load("khepera-light-recover")
    base = replace(base, replicates=runs, seed=SEED, threads=1)
    told = {"prior.world": "light", "settings.random": random, "world.damage": []}
    return with_learner(base, name).with_(told)


@cache
def driven(name: str, runs: int, *, random: bool) -> Driven:
    """Train policies with the usual evaluations, and drive them.

    Args:
        name: of the learner.
        runs: replicates.
        random: whether they are trained on damage.
    """
    config = _on_damage(name, runs, random=random)
    learner: Any = registry.get(name)(
        [config] * runs,
        replicates=range(runs),
        onsets=[-1] * runs,
        models=make_models(config),
    )
    policies, world = learner.propose(0).tried, make_world(config)
    nominal = np.tile(learner.unknowns.nominal, (DRIVES, 1))
    counted = CountedWorld(world, 2 * runs * DRIVES)
    rng = np.random.default_rng(1)
    points = rng.random((DRIVES, len(learner.unknowns)))
    met = Situations(learner.task, learner.unknowns, counted, rng)
    found = Driven(learner, points, [], [], [], [])
    seeds = np.arange(DRIVES) + 1000
    for policy in policies:
        undamaged, trials = (
            met.drive([policy] * DRIVES, wrong, seeds) for wrong in (nominal, points)
        )
        found.undamaged.append(_mean(learner, undamaged, "solved"))
        found.in_range.append(_mean(learner, trials, "solved"))
        found.cost.append(_mean(learner, trials, "fitness"))
        found.trials.append(trials)
    return found


def _mean(learner: Any, trials: list[Any], column: str) -> float:
    return round(float(learner.task.measured(trials)[column].mean()), 4)


@bench(
    "success at damage in its range of a policy trained on such damage, as a share of "
    "what is possible undamaged",
    bar=">= 0.8, and more than the same policy trained without damage",
)
def faithful_domain_randomised(quick: bool) -> Result:
    """`TRAINED` policies each, `DRIVES` drives of each; quick: one.

    Possible undamaged is what the better of the two does with no damage.
    """
    runs = 1 if quick else TRAINED
    with_it, without = (
        driven("domain_randomised", runs, random=random) for random in (True, False)
    )
    both = [with_it.undamaged, without.undamaged]
    possible = max(float(np.max(np.mean(both, axis=1))), 1e-9)
    share = float(np.mean(with_it.in_range)) / possible
    other = float(np.mean(without.in_range)) / possible
    return Result(
        figure=round(share, 4),
        unit="1",
        holds=None if quick else bool(share >= HOLDS and share > other),
        n=runs,
        details={
            "trained on damage": with_it.shown,
            "trained without": without.shown,
            "share of the one trained without": round(other, 4),
        },
    )


@bench(
    "part of the variance of what is wrong that RMA's module explains, the least",
    bar="> 0 for each wheel, and success in range no less than `domain_randomised`",
)
def faithful_rma(quick: bool) -> Result:
    """`TRAINED` policies each, `DRIVES` drives of each; quick: one."""
    runs = 1 if quick else TRAINED
    mine, other = (
        driven(name, runs, random=True) for name in ("rma", "domain_randomised")
    )
    explained = [_explained(mine, run) for run in range(runs)]
    least = float(np.min(explained))
    better = np.mean(mine.in_range) >= np.mean(other.in_range)
    miss = [round(float(memory.miss), 4) for memory in mine.learner.memories]
    return Result(
        figure=round(least, 4),
        unit="1",
        holds=None if quick else bool(least > 0 and better),
        n=runs,
        details={
            "explained of left and right gain": explained,
            "error of the module in the model": miss,
            "rma": mine.shown,
            "domain_randomised": other.shown,
        },
    )


def _explained(found: Driven, run: int) -> list[float]:
    """Of the variance of each number, by a linear reading of what the module says.

    The reading is fitted on four drives of five, and judged cycle by cycle on others.
    """
    learner = found.learner
    told = learner.patterns(found.trials[run], found.points)
    module = torch.from_numpy(learner.memories[run].module).float()
    with torch.no_grad():
        said = learner.says(module, told.known)
    inputs = np.column_stack([said.double().numpy(), np.ones(len(told.known))])
    reading = np.linalg.lstsq(inputs[~told.held], told.wanted[~told.held])[0]
    right = told.wanted[told.held]
    off = ((inputs[told.held] @ reading - right) ** 2).mean(0)
    mean = told.wanted[~told.held].mean(0)
    found_share = 1 - off / ((right - mean) ** 2).mean(0)
    return [round(float(value), 4) for value in found_share]
