"""A servo's diagnosis against its own unchanged recordings, as a `Diagnosis`."""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.gap.models.servo import diagnosis
from bns.gap.models.servo import nominal as servo_nominal
from bns.gap.models.servo.model import ServoModel, seen
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.repeats import sound
from bns.gap.models.servo.runs import Runs, cells, runs
from bns.gap.models.servo.score import Scores
from bns.gap.records import Diagnosis, Fit
from bns.worlds.trial import Trial

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
    known = diagnosis.learn(others, law)
    own = cells(mine)[0]
    without = [own] if own in known.discrepancy.cells else []
    verdict, scores = diagnosis.diagnose(mine, known, without=without)
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
