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
from bns.gap.models.servo import discrepancy as servo_discrepancy
from bns.gap.models.servo import score
from bns.gap.models.servo.candidates import candidates as all_candidates
from bns.gap.models.servo.discrepancy import Discrepancy
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.repeats import sound
from bns.gap.models.servo.runs import Runs, cells, merged
from bns.gap.models.servo.score import Scores
from bns.gap.models.servo.verdict import Null, verdict
from bns.gap.records import Verdict


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
            "record five settings or more without a change, or diagnose with "
            "bns.gap.models.servo.model, which assumes it."
        )
    residuals = servo_curves.residuals(runs, nominal)
    discrepancy = servo_discrepancy.learn(
        residuals, names, kinds, step=servo_curves.STEP
    )
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
