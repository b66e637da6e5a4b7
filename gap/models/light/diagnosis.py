"""Diagnosis of recordings with light: motion and readings, each by itself, then one.

Given the poses that were seen, readings do not depend on what moves the robot; given
the commands that were told, motion does not depend on what the sensors read. So the
likelihood of a recording falls into two parts, which are diagnosed apart and put
together: losses add, supports join.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from bns.gap import diagnose as single
from bns.gap.core.cross_trial_check import confirmed
from bns.gap.core.problem import narrowed
from bns.gap.core.verdict import Calibration, calibration
from bns.gap.diagnose import Analysis
from bns.gap.models.base import GapModel
from bns.gap.models.light.model import SightModel
from bns.gap.models.light.ranking import weighed
from bns.gap.records import Candidate, Diagnosis, Fit, Verdict
from bns.worlds.trial import Commands, Trial

MORE, MINOR = 40.0, 0.08  # see `light_rules`; found on cases that are not scored
LEAST = 5  # commands between two in which the robot was handled, to be of use


def analyse(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    candidates: Sequence[Candidate] | None = None,
    rules: Calibration | None = None,
    most: int = 3,
    reference: Sequence[Trial] = (),
) -> tuple[Analysis, Analysis]:
    """Motion and readings of recordings with light, each analysed by itself.

    Args:
        trials: recordings with light.
        model: nominal model of the motion.
        seed: of what is drawn.
        candidates: explanations to consider, of motion and light; None = all.
        rules: thresholds, None = those of the package.
        most: largest number of effects at once.
        reference: recordings of the same robot in which nothing was changed.
    """
    given = {"seed": seed, "most": most}
    names = {item.name for item in model.candidates()}
    split: list = [None, None]
    if candidates is not None:
        split[0] = tuple(item for item in candidates if item.name in names)
        split[1] = tuple(item for item in candidates if item.name not in names)
    motion = single.analyse(
        unhandled(trials, model),
        model,
        candidates=split[0],
        reference=unhandled(reference, model),
        rules=rules,
        **given,
    )
    sight = SightModel(trials, robot=model.name, pose_sd=motion.problem.floor.sigma)
    seen = look(
        trials,
        sight,
        candidates=split[1],
        reference=reference,
        rules=rules,
        **given,
    )
    return motion, seen


def look(
    trials: Sequence[Trial],
    sight: SightModel,
    *,
    rules: Calibration | None = None,
    **given: Any,
) -> Analysis:
    """What readings say by themselves; arguments as `diagnose.analyse`.

    Args:
        trials: recordings with light.
        sight: model of the readings.
        rules: thresholds, None = those of the package.
        **given: further arguments of `diagnose.analyse`.
    """
    made = single.analyse(trials, sight, rules=light_rules(rules), **given)
    return confirmed(weighed(made))


def light_rules(rules: Calibration | None = None) -> Calibration:
    """Thresholds on readings: a further effect has to explain more than on motion.

    Where a sensor became noisy its readings scatter more than they are whitened for,
    and improvements by chance are as much larger.
    """
    rules = rules or calibration()
    return replace(rules, more=max(rules.more, MORE), minor=max(rules.minor, MINOR))


def unhandled(trials: Sequence[Trial], model: GapModel) -> list[Trial]:
    """Stretches in which the robot was left to itself, with its pose alone."""
    made = []
    for trial in trials:
        trial = narrowed(trial, model)
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


def report(motion: Analysis, seen: Analysis, *, full: bool = True) -> Diagnosis:
    """Both analyses written down as one.

    Args:
        motion: analysis of the motion.
        seen: analysis of the readings.
        full: with localisation and closed fractions.
    """
    first, second = (single.report(part, full=full) for part in (motion, seen))
    answer = merged(first.verdict, second.verdict)
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
        verdict=answer,
        fits=_fits(first, second),
        signatures={**main.signatures, "detectability": found, "best": best},
        floor={**first.floor, "light": second.floor},
        warnings=tuple(dict.fromkeys((*first.warnings, *second.warnings))),
        seconds={
            key: first.seconds.get(key, 0.0) + second.seconds.get(key, 0.0)
            for key in {**first.seconds, **second.seconds}
        },
    )


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
