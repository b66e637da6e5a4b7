"""Withheld-effect cases of a walking robot: recordings with one effect hidden.

The robot walks short stretches of tripod gaits that are drawn for each case. It is
itself a little different from its model; the tracker is noisy and servos report in
steps. How strong the effect is, is drawn by how far it moves the recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.gap.candidates import legged
from bns.gap.core import signatures
from bns.gap.core.aliases import ALIKE, likeness
from bns.gap.core.problem import Problem
from bns.gap.core.support import Term
from bns.gap.diagnose import Analysis
from bns.gap.models.legged.model import TRACKER, WalkModel
from bns.gap.models.legged.signs import Signs
from bns.gap.models.legged.where import Suspects
from bns.models.legs import LEGS, PARTS, joints_of, names, parts
from bns.models.phantomx import gait
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.physics.legged_world import HexapodWorld
from bns.worlds.trial import Channel, Commands, Trial

TRIALS, COMMANDS = 2, 2  # recordings of a case, and commands in each
LIMIT = 1.0  # [s] of a command
SAMPLE = 0.04  # [s] between samples
SEEN = 5.5  # whitened length that is found nine times in ten, about
# Of an effect over that, drawn evenly in the logarithm: of all sizes, and of those that
# have to be named.
SIZES = {"single": (0.7, 10.0), "large": (3.3, 10.0)}
TRIES = 40
POSTURE = 0.4  # [rad] from the middle that joints are told at random; assumed
REST = (-0.4, 0.4)  # [rad] where a joint is locked


@dataclass(frozen=True, eq=False)
class WalkCase:
    """A recording, what is hidden in it (None = nothing), how else it departs."""

    trials: tuple[Trial, ...]
    term: Term | None
    nominal: tuple[Effect, ...]


def commands(rng: np.random.Generator, model: WalkModel) -> list[Commands]:
    """Tripod gaits of other strides, lifts and heights, forward and backward.

    Robots of one's own are told postures at random.
    """
    channels = tuple(Channel(name, row[2]) for name, row in model.limits.items())
    low, high = np.array([row[:2] for row in model.limits.values()]).T
    made: list[Commands] = []
    for number in range(TRIALS):
        heading = 1 if number % 2 == 0 else -1
        if model.name == "phantomx":
            goals = gait.drawn(rng, commands=COMMANDS, heading=heading)
        else:
            goals = rng.uniform(-POSTURE, POSTURE, (COMMANDS, len(channels)))
            goals = np.clip(goals, low, high)
        made.append(Commands(goals, np.full(COMMANDS, LIMIT), channels))
    return made


def imperfection(rng: np.random.Generator, shin: str = PARTS[-1]) -> list[Effect]:
    """How a real walker departs from its model although nothing is wrong; assumed.

    Args:
        rng: the only source of randomness.
        shin: the outermost part of its legs.
    """
    rows = (
        ("servo_gain", {"factor": rng.normal(1, 0.03)}),
        ("link_length", {"part": shin, "factor": rng.normal(1, 0.004)}),
        ("foot_slippery", {"factor": float(np.clip(rng.normal(1, 0.1), 0.7, 1.3))}),
        ("payload", {"mass": abs(rng.normal(0, 0.02))}),
    )
    return [
        registry.make(
            name, **{k: v if k == "part" else float(v) for k, v in row.items()}
        )
        for name, row in rows
    ]


def record(
    told: Sequence[Commands],
    effects: Sequence[Effect],
    seed: int,
    robot: str = "phantomx",
) -> tuple[Trial, ...]:
    """Let the robot walk, seen by a noisy tracker.

    Args:
        told: commands of each trial.
        effects: what the robot departs by; the tracker's noise is added.
        seed: of the world.
        robot: a walking robot, by name.
    """
    noise = registry.make(
        "tracker_noise", position_sd=TRACKER[0], heading_sd=TRACKER[2]
    )
    world = HexapodWorld(
        robot, reality=[*effects, noise], threads=1, sample_dt=SAMPLE, name="real"
    )
    seeds = [seeding.integer(seed, "walk case", n) for n in range(len(told))]
    made = world.run(told, seeds=seeds)
    return tuple(trial.replace(conditions={}) for trial in made)


def build(seed: int, kind: str, model: WalkModel) -> WalkCase:
    """Make a case.

    Args:
        seed: of everything in it.
        kind: of `SIZES`; "lost" (a leg, or a joint, as a whole); or "none".
        model: nominal model.

    Raises:
        BnsError: no effect of the kind was found that the robot can walk with.
    """
    rng = seeding.generator(seed, "walk case", kind)
    told = commands(rng, model)
    reality = imperfection(rng, parts(model.joints)[-1])
    if kind == "none":
        return WalkCase(record(told, reality, seed, model.name), None, tuple(reality))
    plain = record(told, reality, seed, model.name)
    problem = Problem.of(plain, model, candidates=model.candidates())
    for _ in range(TRIES):
        if kind == "lost":
            term = _lost(rng, model.joints)
        else:
            term = _drawn(rng, problem, SIZES[kind])
        if term is None:
            continue
        try:
            trials = record(told, [*reality, term.effect()], seed, model.name)
        except BnsError:  # it cannot stand with that
            continue
        if not any(trial.outcome.diverged or trial.outcome.fell for trial in trials):
            return WalkCase(trials, term, tuple(reality))
    raise BnsError(f"No effect could be hidden in case {seed}.")


def _lost(rng: np.random.Generator, joints: Sequence[str]) -> Term:
    """A leg that is held up, limp or gone, or a joint that is locked, as a whole."""
    legs = names(joints)
    leg = legs[int(rng.integers(len(legs)))]
    held = {joint: float(rng.uniform(*REST)) for joint in joints_of(leg, joints)}
    pool = legged.lost(Signs(held, (leg,), (leg,), (leg,)))
    effects = sorted({item.effect for item in pool})
    effect = effects[int(rng.integers(len(effects)))]
    pool = [item for item in pool if item.effect == effect]
    return Term.at(pool[int(rng.integers(len(pool)))], 0, 1.0)


def _drawn(
    rng: np.random.Generator, problem: Problem, sizes: tuple[float, float]
) -> Term | None:
    """A candidate, drawn evenly over effects, about as strong as drawn."""
    joints = problem.model.joints
    legs = names(joints)
    joint = joints[int(rng.integers(len(joints)))]
    leg = legs[int(rng.integers(len(legs)))]
    pool = tuple(
        item
        for item in legged.candidates(Suspects((joint,), (leg,), True), joints)
        if not any(other in item.name for other in LEGS if other != leg)
        or joint in item.name
    )
    effects = sorted({item.effect for item in pool})
    effect = effects[int(rng.integers(len(effects)))]
    pool = tuple(item for item in pool if item.effect == effect)
    item = pool[int(rng.integers(len(pool)))]
    branch = int(rng.integers(len(item.branches)))
    up = rng.random() < 0.5
    marks = [v for v in item.grid if (v > item.nominal) == up] or list(item.grid)
    marks = sorted(marks, key=lambda value: abs(value - item.nominal))
    wanted = SEEN * float(np.exp(rng.uniform(*np.log(sizes))))
    found = problem.signatures([[item.make(value, branch)] for value in marks])
    lengths = np.linalg.norm(found, axis=1)
    if not np.isfinite(lengths).all() or lengths.max() < 0.7 * wanted:
        return None
    reached = np.append(0.0, np.maximum.accumulate(lengths))
    magnitude = float(np.interp(wanted, reached, [item.nominal, *marks]))
    return Term.at(item, branch, magnitude)


def answer(case: WalkCase, made: Analysis) -> dict[str, Any]:
    """What is true of a case, as far as its diagnosis can tell it.

    Returns:
        name: of the candidate, effect: as text, size: whitened length of what it does
        over what is found nine times in ten, leg: it acts on ("" = several), aliases:
        candidates that the recording cannot tell from it, itself included.
    """
    term = case.term
    if term is None:
        return {"name": "", "effect": "", "size": 0.0, "leg": "", "aliases": []}
    name = term.candidate.name
    (shown,) = made.problem.signatures([[term.effect()]])
    gaps, _ = signatures.nearest(made.curves, shown)
    names = [item.name for item in made.curves.candidates]
    near = {names[number] for number in np.flatnonzero(gaps < ALIKE**2)}
    near |= {name, *term.candidate.aliases}
    said = made.verdict.named
    if said and said[0][0] not in near:  # curves are coarse: fits are surer
        found = likeness(made.problem, made.curves, term)
        near |= {other.name for other in found if other.alike}
    return {
        "name": name,
        "effect": str(term.effect()),
        "size": float(np.linalg.norm(shown)) / made.seen,
        "leg": next((leg for leg in LEGS if leg in name), ""),
        "aliases": sorted(near),
    }
