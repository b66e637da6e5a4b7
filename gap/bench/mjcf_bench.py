"""Blind cases of a user's own robot: recordings with a hidden effect, answers apart."""

from dataclasses import replace

import numpy as np

from bns import seeding
from bns.gap.bench import mjcf_cases
from bns.gap.bench.cases import Answer, Case
from bns.gap.core import signatures
from bns.gap.core.aliases import accepted, likeness
from bns.gap.core.fit import Term
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves
from bns.gap.models.mjcf import effects as own_effects
from bns.gap.models.mjcf.model import OwnModel
from bns.worlds.effects.base import Effect

SIZES = 1.0, 8.0  # of an effect over what is detected, drawn evenly in the logarithm
TRIES = 50


def build(seed: int, kind: str, model: OwnModel, *, count: int = 6) -> Case:
    """Make a case.

    The nominal model departs from the robot where the description gives a slack.

    Args:
        seed: of everything in it.
        kind: "single", "pair", "none", "off-library" (an effect that the description
            does not list) or "fault".
        model: nominal model.
        count: trials.
    """
    rng = seeding.generator(seed, "own case", kind)
    told = tuple(mjcf_cases.commands(model, rng, count))
    reality = tuple(
        item.make(item.nominal + item.slack * rng.standard_normal())
        for item in model.candidates()
        if item.slack > 0
    )
    plain = mjcf_cases.record(model, told, reality, seed=seed)
    answer = Answer(kind, nominal=tuple(str(effect) for effect in reality))
    hidden: list[Effect] = []
    if kind in ("single", "pair"):
        answer, hidden = _hide(rng, plain, model, answer, 1 + (kind == "pair"))
    elif kind == "off-library":
        hidden = [_unlisted(rng, model)]
        answer = replace(answer, effects=tuple(str(effect) for effect in hidden))
    trials = mjcf_cases.record(model, told, [*reality, *hidden], seed=seed)
    if kind == "fault":
        from bns.gap.recordings.recording_faults import faulty

        trials, name = faulty(rng, trials)
        answer = replace(answer, fault=name)
    return Case(tuple(trials), answer, reality, told)


def _hide(
    rng: np.random.Generator, plain, model: OwnModel, answer: Answer, count: int
) -> tuple[Answer, list[Effect]]:
    problem = Problem.of(plain, model, candidates=model.candidates())
    curves = signatures.trace(problem, model.candidates())
    seen = Null.of(problem, curves).seen
    terms: list[Term] = []
    for _ in range(TRIES):
        term = _draw(rng, curves, seen, {t.candidate.name for t in terms})
        if term:
            terms.append(term)
        if len(terms) == count:
            break
    effects = [term.effect() for term in terms]
    lengths = np.linalg.norm(problem.signatures([[e] for e in effects]), axis=1)
    made = replace(
        answer,
        names=tuple(term.candidate.name for term in terms),
        effects=tuple(str(effect) for effect in effects),
        magnitudes=tuple(term.magnitude for term in terms),
        sizes=tuple((lengths / seen).tolist()),
        aliases=tuple(
            accepted(term, likeness(problem, curves, term)) for term in terms
        ),
        detected=seen,
    )
    return made, effects


def _draw(
    rng: np.random.Generator, curves: Curves, seen: float, taken: set[str]
) -> Term | None:
    """A candidate at a level whose signature has about a drawn length."""
    number = int(rng.integers(len(curves.candidates)))
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    item, mine = curves.candidates[number], curves.levels(number)
    lengths = signatures.strength(curves)[mine]
    if item.name in taken or not len(mine) or lengths.max() < size * seen:
        return None
    near = mine[np.abs(np.log(np.maximum(lengths, 1e-9) / (size * seen))).argmin()]
    return Term.at(item, int(curves.branch[near]), float(curves.magnitude[near]))


def _unlisted(rng: np.random.Generator, model: OwnModel) -> Effect:
    """An effect on signals that the description does not list, clearly felt."""
    listed = {item.effect for item in model.candidates()}
    strengths = {
        "command_gain": ("factor", 0.7),
        "command_delay": ("delay", 0.1),
        "command_lag": ("time_constant", 0.1),
        "reading_gain": ("factor", 0.8),
        "reading_delay": ("delay", 0.1),
    }
    names = [name for name in strengths if name not in listed] or list(strengths)
    name = names[int(rng.integers(len(names)))]
    parameter, value = strengths[name]
    return own_effects.make(name, {parameter: value})
