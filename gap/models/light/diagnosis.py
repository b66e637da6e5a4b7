"""Diagnosis of recordings with light: motion and readings, each by itself, then one.

Given the poses that were seen, readings do not depend on what moves the robot; given
the commands that were told, motion does not depend on what the sensors read. So the
likelihood of a recording falls into two parts, which are diagnosed apart and put
together: losses add, supports join.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from bns.gap.models.base import GapModel
from bns.gap.models.light.model import SightModel
from bns.gap.recordings.trial_selection import narrowed
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.progress import Tell, unheard
from bns.worlds.trial import Commands, Trial

LEAST = 5  # commands between two in which the robot was handled, to be of use

Single = Callable[..., Diagnosis]
"""diagnosis of recordings by one model, see `bns.gap.diagnose.single`"""


def diagnose(
    trials: Sequence[Trial],
    model: GapModel,
    single: Single,
    *,
    reference: Sequence[Trial] = (),
    tell: Tell = unheard,
    **given: Any,
) -> Diagnosis:
    """Motion and readings of recordings with light, as one diagnosis.

    Args:
        trials: recordings with light.
        model: nominal model of the motion.
        single: diagnoses one of the two.
        reference: recordings of the same robot in which nothing was changed.
        tell: is told when a stage begins.
        **given: further arguments of `single`.
    """
    before = unhandled(reference, model)
    moved = unhandled(trials, model)
    motion = single(moved, model, reference=before, tell=tell, **given)
    deviations = motion.floor["sigma"]
    sight = SightModel(trials, robot=model.name, pose_sd=deviations)
    tell("light")
    seen = look(trials, sight, single, reference=reference, **given)
    return joined(motion, seen)


def look(
    trials: Sequence[Trial],
    sight: SightModel,
    single: Single,
    *,
    reference: Sequence[Trial] = (),
    **given: Any,
) -> Diagnosis:
    """What readings say by themselves.

    Args:
        trials: recordings with light.
        sight: model of the readings.
        single: diagnoses them.
        reference: recordings of the same robot in which nothing was changed.
        **given: further arguments of `single`.
    """
    ready, notes = sight.ready(trials)
    before = sight.ready(reference)[0] if reference else ()
    found = single(ready, sight, reference=before, checked=True, **given)
    return replace(found, faults=(*notes, *found.faults))


def unhandled(trials: Sequence[Trial], model: GapModel) -> list[Trial]:
    """Stretches in which the robot was left to itself, with its pose alone."""
    made = []
    for trial in trials:
        trial = narrowed(trial, model.channels)
        free = np.concatenate([[False], ~trial.handled, [False]])
        edges = np.flatnonzero(np.diff(free.astype(int)))
        if len(edges) == 2 and edges[1] - edges[0] == len(trial.commands):
            made.append(trial)
            continue
        for begin, end in edges.reshape(-1, 2):
            if end - begin >= LEAST:
                made.append(_stretch(trial, int(begin), int(end)))
    return made


def _stretch(trial: Trial, begin: int, end: int) -> Trial:
    first, last = trial.boundaries[begin], trial.boundaries[end]
    told = trial.commands
    return trial.replace(
        commands=Commands(
            told.values[begin:end], told.durations[begin:end], told.channels
        ),
        times=trial.times[first : last + 1],
        observed=trial.observed[first : last + 1],
        boundaries=trial.boundaries[begin : end + 1] - first,
        handled=trial.handled[begin:end],
        truth={},
    )


def joined(first: Diagnosis, second: Diagnosis) -> Diagnosis:
    """Both diagnoses written down as one.

    Args:
        first: of the motion.
        second: of the readings.
    """
    main = second if first.verdict.kind == "no gap" else first
    found = {
        **first.signatures["detectability"],
        **second.signatures["detectability"],
    }
    best = [*first.signatures["best"], *second.signatures["best"]]
    return replace(
        main,
        model=first.model,
        trials=second.trials,
        faults=(*first.faults, *second.faults),
        verdict=merged(first.verdict, second.verdict),
        fits=_fits(first, second),
        signatures={**main.signatures, "detectability": found, "best": best},
        floor={**first.floor, "light": second.floor},
        warnings=tuple(dict.fromkeys((*first.warnings, *second.warnings))),
        seconds={
            key: first.seconds.get(key, 0.0) + second.seconds.get(key, 0.0)
            for key in {**first.seconds, **second.seconds}
        },
        decomposition=_parts(main, first, second),
    )


def _parts(main: Diagnosis, first: Diagnosis, second: Diagnosis) -> dict[str, Any]:
    """Parts and statements of both; each share is one of its own gap."""
    words = [
        f"{name}: {line}"
        for name, part in (("Motion", first), ("Light", second))
        for line in part.decomposition["statements"]
    ]
    parts = [part for made in (first, second) for part in made.decomposition["parts"]]
    onset = first.decomposition["onset"] or second.decomposition["onset"]
    return {**main.decomposition, "parts": parts, "statements": words, "onset": onset}


def merged(motion: Verdict, seen: Verdict) -> Verdict:
    """One verdict from that on motion and that on readings."""
    p_gap = min(1.0, 2 * min(motion.p_gap, seen.p_gap))
    sets = tuple(a + b for a, b in product(motion.sets, seen.sets))
    strange = [v for v in (motion, seen) if v.kind == "none of the library"]
    gaps = [v for v in (motion, seen) if v.kind != "no gap"]
    words = f"Motion: {motion.sentence} Light: {seen.sentence}"
    if len(gaps) < 2:
        main = gaps[0] if gaps else motion
        return replace(main, p_gap=p_gap, sets=sets, sentence=words)
    second = min((motion, seen), key=lambda part: part.margin)
    both = replace(
        second,
        p_gap=p_gap,
        p_misfit=min(1.0, 2 * min(motion.p_misfit, seen.p_misfit)),
        angle=min(motion.angle, seen.angle),
        sets=sets,
        sentence=words,
        change=" ".join(dict.fromkeys(filter(None, (motion.change, seen.change)))),
    )
    if strange:
        return replace(both, kind="none of the library", named=())
    named = tuple(a + b for a, b in product(motion.named, seen.named))
    return replace(both, kind="together" if len(named) == 1 else "either", named=named)


def _fits(first: Diagnosis, second: Diagnosis) -> tuple[Fit, ...]:
    """Fits of either part with nothing in the other, and the best of both."""
    bare = [next(fit for fit in part.fits if not fit.names) for part in (first, second)]
    made = [_joined(fit, bare[1]) for fit in first.fits]
    made += [_joined(bare[0], fit) for fit in second.fits if fit.names]
    for a, b in product(_named(first), _named(second)):
        made.append(_joined(a, b))
    return tuple(made)


def _named(found: Diagnosis) -> list[Fit]:
    """Fits of the named supports; of many the first ones alone are listed."""
    fits = {frozenset(fit.names): fit for fit in found.fits}
    wanted = map(frozenset, found.verdict.named)
    return [fits[names] for names in wanted if names in fits]


def _joined(a: Fit, b: Fit) -> Fit:
    return Fit(
        names=a.names + b.names,
        effects=a.effects + b.effects,
        magnitudes=a.magnitudes + b.magnitudes,
        intervals=a.intervals + b.intervals,
        units=a.units + b.units,
        loss=a.loss + b.loss,
        held_out=a.held_out + b.held_out,
        held_out_se=float(np.hypot(a.held_out_se, b.held_out_se)),
        evidence=a.evidence + b.evidence,
        at_bound=a.at_bound + b.at_bound,
        condition=max(a.condition, b.condition),
    )
