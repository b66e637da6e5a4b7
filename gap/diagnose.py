"""One call from a recording to a verdict."""

from collections.abc import Sequence
from typing import Any

from bns.errors import BnsError
from bns.gap.decomposition import diagnosis
from bns.gap.decomposition.reference import Corrected
from bns.gap.models.base import BLOCK, FEW, GapModel
from bns.gap.models.light import diagnosis as light
from bns.gap.models.light import model as light_model
from bns.gap.recordings import check
from bns.gap.records import Diagnosis
from bns.progress import Tell, unheard
from bns.worlds.trial import Trial

LEAST = 2  # trials


def diagnose(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    rows: Sequence[str] | None = None,
    full: bool = True,
    reference: Sequence[Trial] = (),
    tell: Tell = unheard,
) -> Diagnosis:
    """Where a recording and a nominal model part, why, and how far it can be closed.

    Args:
        trials: recorded commands and observations.
        model: nominal model.
        seed: of what is drawn (bootstraps).
        rows: names of the explanations to consider; None = all of the model's.
        full: with localisation; False = the verdict alone.
        reference: recordings of the same robot in which nothing was changed; they tell
            how far the nominal model is off anyway.
        tell: is told when a stage begins (`bns.gap.stages`).

    Raises:
        BnsError: too few trials, faults that cannot be repaired, channels that do not
            fit the model.
    """
    given: Any = dict(seed=seed, rows=rows, full=full, reference=reference, tell=tell)
    if light_model.told_by(model, (*trials, *reference)):
        return light.diagnose(trials, model, single, **given)
    return single(trials, model, **given)


def single(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    rows: Sequence[str] | None = None,
    full: bool = True,
    reference: Sequence[Trial] = (),
    checked: bool = False,
    tell: Tell = unheard,
) -> Diagnosis:
    """A diagnosis by one model; arguments as `diagnose`.

    Args:
        trials: recorded commands and observations.
        model: nominal model.
        seed: of what is drawn.
        rows: names of the explanations to consider.
        full: with localisation.
        reference: recordings in which nothing was changed.
        checked: whether recordings are as the model compares them.
        tell: is told when a stage begins.

    Raises:
        BnsError: too few usable trials.
    """
    tell("nominal model")
    usable, faults = (tuple(trials), ()) if checked else check.check(trials, model)
    if lacking := too_few(usable):
        raise BnsError(lacking)
    if reference:
        unchanged = reference if checked else check.check(reference, model)[0]
        model = Corrected.of(unchanged, model)
    return diagnosis.diagnose(
        usable, model, seed=seed, faults=faults, full=full, rows=rows, tell=tell
    )


def too_few(trials: Sequence[Trial]) -> str:
    """Why usable trials are too few for a diagnosis, in a sentence; "" = they do."""
    seconds = sum(trial.commands.duration for trial in trials)
    if len(trials) >= LEAST or seconds >= FEW * BLOCK:
        return ""
    return (
        f"{len(trials)} usable trial: a diagnosis needs {LEAST} at least, or one of "
        f"{FEW * BLOCK:g} s, to fit on some and test on others; record more."
    )
