"""Cases of the withheld-effect bench: recordings with an answer kept apart.

A case is a recording of the "real" robot: the nominal model, itself slightly wrong,
with a hidden effect (or two, or none, or one that the library lacks), seen by a noisy
tracker with drop-outs and jitter. How strong the effect is, is drawn relative to what
the recording can show.

On disk a case is a dataset directory (`worlds/data/dataset.py`) called by its name; all
answers lie in one `answers.json` elsewhere, by name: the attributes of `Answer`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bns import models, seeding
from bns.gap.core import fit, signatures
from bns.gap.core.aliases import accepted, likeness
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves
from bns.gap.models.base import GapModel
from bns.gap.planning import excitation
from bns.gap.recordings.recording_faults import faulty
from bns.gap.records import Candidate
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands, Trial

KINDS = ("single", "pair", "none", "off-library", "fault")
TRIALS, LENGTH = 5, 8.0  # recordings of a case, and how long each is [s]
SIZES = 0.5, 8.0  # magnitudes over what is detected, drawn evenly in the logarithm
PAIR_SIZES = 2.0, 8.0  # of each of two
LEAST = 0.4  # size below which an effect counts as not excited, and is drawn again


@dataclass(frozen=True)
class Answer:
    """What is true of a case.

    Attributes:
        kind: one of `KINDS`.
        names: candidates of the hidden effects.
        effects: as text.
        magnitudes: of each.
        sizes: whitened length of each effect's signature over the detected length.
        aliases: per hidden effect, the candidates that this recording cannot tell
            from it (itself included).
        near: per hidden effect, the candidates that come nearest to it with their
            whitened distances and angles [deg], see `aliases.Likeness`.
        nominal: how the robot departs from its model besides, as text.
        fault: of the data.
        detected: whitened length of a signature that is found with 90 % power.
        oracle: held-out loss with the true effects fitted.
    """

    kind: str
    names: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    magnitudes: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    aliases: tuple[tuple[str, ...], ...] = ()
    near: tuple[tuple[tuple[str, float, float], ...], ...] = ()
    nominal: tuple[str, ...] = ()
    fault: str = ""
    detected: float = 0.0
    oracle: float = float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Case:
    """A recording with its answer, and one without the effect for the edit test."""

    trials: tuple[Trial, ...]
    answer: Answer
    reality: tuple[Effect, ...]
    commands: tuple[Commands, ...]


def commands(
    rng: np.random.Generator, count: int = TRIALS, *, robot: str = "khepera3"
) -> list[Commands]:
    """Random wheel speeds that a robot takes, each held for 0.4 to 1.6 s.

    Args:
        rng: source of the speeds and times.
        count: number of lists of commands, one for each trial.
        robot: a wheeled robot, by name; its speed limit counts.
    """
    fastest = excitation.fastest(float(models.robot(robot).limits.min()))
    made = []
    for _ in range(count):
        number = int(rng.integers(5, 10))
        held = rng.uniform(0.4, 1.6, number)
        held = np.maximum(np.rint(held * LENGTH / held.sum() / 0.005), 20) * 0.005
        values = rng.uniform(-fastest, fastest, (number, 2))
        straight = rng.random(number) < 0.2
        values[straight, 1] = values[straight, 0]
        made.append(Commands(values, held))
    return made


def imperfection(rng: np.random.Generator) -> list[Effect]:
    """How a real robot departs from its model although nothing is wrong with it."""
    values = {
        "wheel_diameter": [
            {"wheel": side, "factor": float(np.clip(rng.normal(1, 0.002), 0.99, 1.01))}
            for side in ("left", "right")
        ],
        "axle_length": [{"factor": float(np.clip(rng.normal(1, 0.004), 0.98, 1.02))}],
        "floor_friction": [{"factor": float(rng.uniform(0.8, 1.2))}],
        "centre_of_mass": [{"dx": float(rng.normal(0, 3e-4))}],
    }
    return [registry.make(name, **row) for name, rows in values.items() for row in rows]


def tracker(rng: np.random.Generator) -> list[Effect]:
    """Noise and drop-outs of an overhead tracker."""
    position = float(np.exp(rng.uniform(np.log(0.5e-3), np.log(2e-3))))
    heading = float(np.exp(rng.uniform(np.log(4e-3), np.log(15e-3))))
    noise = {"position_sd": position, "heading_sd": heading}
    made = [registry.make("tracker_noise", **noise)]
    if rng.random() < 0.5:
        share = float(rng.uniform(0.005, 0.05))
        made.append(registry.make("tracker_dropouts", probability=share))
    return made


def record(
    told: Sequence[Commands], effects: Sequence[Effect], seed: int, robot: str
) -> tuple[Trial, ...]:
    """Run the robot; time stamps jitter by a few milliseconds.

    Args:
        told: commands of each trial.
        effects: what the robot departs by.
        seed: of the world and of the jitter.
        robot: a wheeled robot, by name.
    """
    world = MujocoWorld(robot, reality=effects, threads=2, name="real")
    seeds = [seeding.integer(seed, "case", "world", n) for n in range(len(told))]
    made = []
    for number, trial in enumerate(world.run(told, seeds=seeds)):
        rng = seeding.generator(seed, "case", "jitter", number)
        times = trial.times + rng.normal(0, 1.5e-3, len(trial.times))
        times[0] = trial.times[0]
        observed = trial.observed.copy()
        lost = ~np.isfinite(observed[0])
        observed[0, lost] = 0.0  # the start is known
        made.append(
            trial.replace(
                times=np.maximum.accumulate(times), observed=observed, conditions={}
            )
        )
    return tuple(made)


def build(
    seed: int,
    kind: str,
    model: GapModel,
    *,
    off_library: Sequence[Effect] = (),
    extra: Sequence[Effect] = (),
    wanted: str = "",
) -> Case:
    """Make a case.

    Args:
        seed: of everything in it.
        kind: one of `KINDS`.
        model: nominal model.
        off_library: effects to draw from for "off-library"; outside the registry.
        extra: further departures of reality (another solver).
        wanted: name of the candidate to plant; "" = drawn.
    """
    rng = seeding.generator(seed, "case", kind)
    told = commands(rng, robot=model.name)
    reality = (*imperfection(rng), *extra)
    noise = tracker(rng)
    plain = record(told, [*reality, *noise], seed, model.name)
    answer = Answer(kind, nominal=tuple(str(e) for e in reality))
    hidden: list[Effect] = []
    if kind in ("single", "pair"):
        answer, hidden = _hide(rng, plain, model, answer, 1 + (kind == "pair"), wanted)
    elif kind == "off-library":
        hidden = [off_library[int(rng.integers(len(off_library)))]]
        answer = replace(answer, effects=tuple(str(e) for e in hidden))
    order = {"command": 0, "actuator": 1, "body": 2, "tracking": 3}
    effects = sorted([*reality, *hidden], key=lambda e: order[e.stage])
    trials = record(told, [*effects, *noise], seed, model.name) if hidden else plain
    if kind == "fault":
        trials, name = faulty(rng, trials)
        answer = replace(answer, fault=name)
    return Case(tuple(trials), answer, (*reality, *noise), tuple(told))


def _hide(
    rng: np.random.Generator,
    plain: Sequence[Trial],
    model: GapModel,
    answer: Answer,
    count: int,
    wanted: str,
) -> tuple[Answer, list[Effect]]:
    candidates = model.candidates()
    problem = Problem.of(plain, model, candidates=candidates)
    curves = signatures.trace(problem, candidates)
    seen = Null.of(problem, curves).seen
    low, high = SIZES if count == 1 else PAIR_SIZES
    terms: list[fit.Term] = []
    while len(terms) < count:
        size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        taken = {t.candidate.effect for t in terms}
        taken |= {name for t in terms for name in t.candidate.aliases}
        term = _draw(rng, curves, size * seen, taken, wanted)
        reached = _length(problem, term) / seen if term else 0.0
        least = LEAST if count == 1 else 0.9 * low
        if least < reached < 3 * high:
            terms.append(term)
    effects = [term.effect() for term in terms]
    lengths = np.linalg.norm(problem.signatures([[e] for e in effects]), axis=1)
    found = [likeness(problem, curves, term) for term in terms]
    made = replace(
        answer,
        names=tuple(term.candidate.name for term in terms),
        effects=tuple(str(effect) for effect in effects),
        magnitudes=tuple(term.magnitude for term in terms),
        sizes=tuple((lengths / seen).tolist()),
        aliases=tuple(map(accepted, terms, found)),
        near=tuple(
            tuple((o.name, round(o.distance, 3), round(o.angle, 2)) for o in row)
            for row in found
        ),
        detected=seen,
    )
    return made, effects


def _length(problem: Problem, term: fit.Term) -> float:
    """Whitened length of what an effect does; the curves only estimate it."""
    return float(np.linalg.norm(problem.signatures([[term.effect()]])[0]))


def _draw(
    rng: np.random.Generator,
    curves: Curves,
    length: float,
    taken: set[str],
    wanted: str,
) -> fit.Term | None:
    """A candidate, evenly over effects, at the level nearest to a length."""
    pool = [item for item in curves.candidates if item.effect not in taken]
    pool = [item for item in pool if item.name == wanted] or pool
    effects = sorted({item.effect for item in pool})
    effect = effects[int(rng.integers(len(effects)))]
    pool = [item for item in pool if item.effect == effect]
    item = pool[int(rng.integers(len(pool)))]
    branch = int(rng.integers(len(item.branches)))
    number = curves.index(item.name)
    mine = np.flatnonzero((curves.owner == number) & (curves.branch == branch))
    side = curves.magnitude[mine] > item.nominal
    mine = mine[side == (rng.random() < 0.5)] if 0 < side.sum() < len(side) else mine
    lengths = signatures.strength(curves)[mine]
    if not len(mine) or lengths.max() < 0.5 * length:
        return None  # not excited by these commands
    if signatures.integer(item):
        fitting = np.abs(np.log(np.maximum(lengths, 1e-9) / length)).argmin()
        return fit.Term.at(item, branch, float(curves.magnitude[mine][fitting]))
    magnitude = _level(item, curves.magnitude[mine], lengths, length)
    term = fit.Term.at(item, branch, magnitude)
    turned = tuple(value + float(rng.uniform(-0.8, 0.8)) for value in term.extras)
    return replace(term, extras=tuple(np.clip(turned, -np.pi, np.pi).tolist()))


def _level(item: Candidate, magnitude, lengths, length: float) -> float:
    """Magnitude at which the signature first has a length, going from nominal."""
    order = np.argsort(np.abs(magnitude - item.nominal))
    at = np.append(item.nominal, magnitude[order])
    grown = np.append(0.0, lengths[order])
    over = np.flatnonzero(grown >= length)
    if not len(over):
        return float(at[-1])
    i = over[0]
    share = (length - grown[i - 1]) / max(grown[i] - grown[i - 1], 1e-12)
    return float(at[i - 1] + share * (at[i] - at[i - 1]))
