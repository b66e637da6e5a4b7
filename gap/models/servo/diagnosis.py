"""Diagnosis of a servo from recordings of the same servo in which nothing changed.

A `Reference` is what a servo's own runs teach: the nominal law, how that law errs by
itself, and how far candidates seem to improve on it where nothing has changed. Every
threshold of a verdict is a quantile of the latter; none is set by hand.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.gap.models.servo import curves as servo_curves
from bns.gap.models.servo import nominal as servo_nominal
from bns.gap.models.servo import score
from bns.gap.models.servo.candidates import candidates as all_candidates
from bns.gap.models.servo.model import ServoModel, seen
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.repeats import sound
from bns.gap.models.servo.runs import Runs, cells, merged, runs
from bns.gap.models.servo.score import Discrepancy, Scores
from bns.gap.models.servo.verdict import Null, verdict
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.worlds.trial import Trial


@dataclass(frozen=True, eq=False)
class Reference:
    """What runs without a change teach of a servo.

    Attributes:
        nominal: the law.
        discrepancy: how it errs.
        null: what candidates reach where nothing has changed.
        candidates: by name.
        left_out: a line for each run that is not as its repeats, see `odd`.
    """

    nominal: Nominal
    discrepancy: Discrepancy
    null: Null
    candidates: Mapping[str, Row]
    left_out: tuple[str, ...] = ()


def learn(
    runs: Runs, nominal: Nominal, *, candidates: Sequence[Row] | None = None
) -> Reference:
    """What runs without a change teach: each setting is held against all others.

    Args:
        runs: of several settings, truly told; repeats and trajectories as they come.
            Runs that are not as their repeats are left out.
        nominal: the law.
        candidates: explanations to consider; None = all servo effects.

    Raises:
        BnsError: fewer than five settings.
    """
    chosen = tuple(all_candidates() if candidates is None else candidates)
    runs, left_out = sound(runs)
    runs = merged(runs)
    names, kinds = cells(runs), runs.labels["trajectory"]
    if len(set(names)) < 5:
        raise BnsError(
            f"Runs of {len(set(names))} settings do not show how the nominal law errs; "
            "record five settings or more without a change, or diagnose without a "
            "reference, by the law that is known of the servo."
        )
    residuals = servo_curves.residuals(runs, nominal)
    discrepancy = score.learn(residuals, names, kinds, step=servo_curves.STEP)
    curves = servo_curves.curves(runs, nominal, chosen)
    scores = {}
    for cell in discrepancy.cells:
        mine = np.array([name == cell for name in names])
        matrices = score.whiteners(runs.take(mine), discrepancy, [cell])
        own = [
            servo_curves.Curve(c.candidate, c.magnitudes, c.departures[mine])
            for c in curves
        ]
        scores[cell] = score.score(residuals[mine], own, matrices)
    null = Null.of(scores)
    named = {c.name: c for c in chosen}
    return Reference(nominal, discrepancy, null, named, left_out)


def diagnose(
    runs: Runs, reference: Reference, *, without: Sequence[object] = ()
) -> tuple[Verdict, Scores]:
    """Which effect, if any, explains the runs of one setting.

    Args:
        runs: of one setting, told as the nominal model believes it; repeats and
            trajectories as they come; runs that are not as their repeats are left
            out, and named in the sentence.
        reference: what runs without a change taught.
        without: cells of the reference to leave out, for tests in which the runs
            belong to one of them.

    Returns:
        The verdict, and the scores that it rests on.

    Raises:
        BnsError: runs of several settings, or a trajectory that the reference lacks.
    """
    runs, left_out = sound(runs)
    runs = merged(runs)
    if len(set(cells(runs))) != 1:
        raise BnsError(
            f"The runs are told {len(set(cells(runs)))} settings; diagnose one at a "
            "time."
        )
    nominal, chosen = reference.nominal, reference.candidates
    matrices = score.whiteners(runs, reference.discrepancy, without)
    residuals = servo_curves.residuals(runs, nominal)
    curves = servo_curves.curves(runs, nominal, list(chosen.values()))
    scores = score.score(residuals, curves, matrices)
    scores = score.refined(runs, nominal, scores, chosen, matrices)
    gain = cells(runs)[0][-1]
    null = reference.null.without(without)
    found = verdict(scores, null, chosen, gain)
    if left_out:
        said = f"{found.sentence} Left out: {' '.join(left_out)}"
        found = replace(found, sentence=said)
    return found, scores


FITTED = 20  # unchanged runs that the nominal law is fitted to, spread over settings
LISTED = 8  # candidates that are reported
NEEDED = ("mass", "lever", "gain", "trajectory")


def record(
    trials: Sequence[Trial],
    reference: Sequence[Trial],
    *,
    nominal: Nominal | None = None,
    seed: int = 0,
) -> Diagnosis:
    """Diagnose runs of one setting of a servo.

    The unchanged runs teach the nominal law, how it errs, and what candidates seem to
    explain where nothing has changed.

    Args:
        trials: of one setting, told as it is believed to be.
        reference: unchanged runs, of five settings or more, truly told; those that
            are among `trials` are left out.
        nominal: the law; None = fitted to the unchanged runs.
        seed: kept with the result; nothing is drawn.

    Raises:
        BnsError: conditions are missing, or runs of several settings or too few.
    """
    unchanged = _unchanged(trials, reference)
    every = [seen(trial) for trial in (*trials, *unchanged)]
    seconds = np.floor(min(trial.times[-1] for trial in every) * 10) / 10
    mine = runs(every[: len(trials)], seconds=seconds)
    others = runs(every[len(trials) :], seconds=seconds)
    others, without_repeat = sound(others)
    faults = (*sound(mine)[1], *without_repeat)
    law = nominal or servo_nominal.fit(others.take(_spread(others)))
    known = learn(others, law)
    own = cells(mine)[0]
    without = [own] if own in known.discrepancy.cells else []
    verdict, scores = diagnose(mine, known, without=without)
    slack = known.null.slack
    return Diagnosis(
        model=ServoModel.name,
        trials=len(trials),
        faults=tuple(f"Left out: {line}" for line in faults),
        verdict=verdict,
        fits=_fits(scores, known.candidates, slack),
        where={},
        signatures={
            "detectability": {},
            "ranked": [
                {"names": [name], "score": scores.worse(name)} for name in scores.ranked
            ],
        },
        floor={
            "source": f"{len(set(cells(others)))} unchanged settings",
            "repeats": 0,
            "sigma": ServoModel().resolution.tolist(),
            "process": ServoModel().process.tolist(),
            "channels": ["angle"],
        },
        closed={},
        warnings=tuple(f"The nominal {name} sits on a bound." for name in law.at_bound),
        seed=seed,
        partial={"where, closed": "not made beside unchanged recordings of a servo"},
        provenance={"law": dict(law.values)},
    )


def _unchanged(trials: Sequence[Trial], reference: Sequence[Trial]) -> list[Trial]:
    """Reference runs that are not among the trials.

    Raises:
        BnsError: conditions are missing, or nothing is left.
    """
    given = {trial.observed.tobytes() for trial in trials}
    unchanged = [t for t in reference if t.observed.tobytes() not in given]
    for trial in (*trials, *unchanged):
        missing = [name for name in NEEDED if name not in trial.conditions]
        if missing:
            raise BnsError(
                f"A servo's run does not say its {', '.join(missing)}; conditions "
                f"{', '.join(NEEDED)} are needed beside unchanged recordings."
            )
    if not unchanged:
        raise BnsError("No unchanged recording is left beside the ones to diagnose.")
    return unchanged


def _spread(others: Runs) -> np.ndarray:
    """Indices of runs to fit the law to: of each setting and trajectory in turn."""
    keys = list(zip(cells(others), others.labels["trajectory"], strict=True))
    order = sorted(range(len(keys)), key=lambda i: keys[i])
    first = {key: index for index, key in reversed(list(enumerate(keys)))}
    distinct = [i for i in order if first[keys[i]] == i]
    step = max(len(distinct) / FITTED, 1.0)
    places = np.arange(0, len(distinct), step).astype(int)
    return np.array([distinct[place] for place in places])


def _fits(
    scores: Scores, candidates: Mapping[str, Row], slack: float
) -> tuple[Fit, ...]:
    size = scores.size
    nothing = scores.nothing
    made = [Fit((), (), (), (), (), nothing, nothing / size, 0.0, nothing)]
    for name in scores.ranked[:LISTED]:
        cost, value = scores.costs[name], scores.magnitudes[name]
        tried, costs = scores.profiles[name]
        inside = tried[costs <= cost * np.exp(slack)]
        low, high = (inside.min(), inside.max()) if len(inside) else (value, value)
        made.append(
            Fit(
                names=(name,),
                effects=(str(candidates[name].make(value)),),
                magnitudes=(float(value),),
                intervals=((float(min(low, value)), float(max(high, value))),),
                units=(candidates[name].unit,),
                loss=float(cost),
                held_out=float(cost / size),
                held_out_se=0.0,
                evidence=float(cost),
            )
        )
    return tuple(made)
