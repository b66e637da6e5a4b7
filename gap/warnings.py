"""What is said beside a verdict: candidates at bounds, effects that nothing excited."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel
from bns.gap.recordings import trial_conditions
from bns.gap.records import Diagnosis
from bns.worlds.trial import Trial

LISTED = 5  # effects that are listed at most
STILL = 1e-3  # share of the recorded motion that the model has to make, at least


def reproducible(trials: Sequence[Trial], model: GapModel) -> None:
    """Stop if the nominal model can not execute the recorded commands.

    Raises:
        BnsError: its simulation diverges, or it does not move at all.
    """
    (predicted,) = model.simulate(trials, [()])
    for number, (trial, made) in enumerate(zip(trials, predicted, strict=True)):
        bad = ~np.isfinite(made).all(axis=1)
        if bad.any():
            raise BnsError(
                f"The simulation of {trial_conditions.label(trial, number)} by the "
                f"nominal model {model.name!r} diverges at "
                f"{trial.times[bad.argmax()]:.2f} s; "
                "check its time step, its start and the commands."
            )
    recorded = max(_travel(trial.observed) for trial in trials)
    simulated = max(_travel(made) for made in predicted)
    if recorded > 0 and simulated < STILL * recorded:
        raise BnsError(
            f"Model {model.name!r} does not move on the recorded commands, although "
            "the robot did; check which actuator each command goes to."
        )


def _travel(observed: np.ndarray) -> float:
    seen = observed[np.isfinite(observed).all(axis=1)]
    return float(np.ptp(seen, axis=0).max()) if len(seen) else 0.0


def warnings(
    found: Diagnosis, rows: Sequence[Row], untried: Sequence[str] = ()
) -> tuple[str, ...]:
    """Further warnings on a diagnosis, one line each.

    Args:
        found: the diagnosis.
        rows: of its model.
        untried: effects that it does not consider, by name.
    """
    made = []
    searched = "unlisted" in found.decomposition
    if untried and found.verdict.kind != "no gap" and not searched:
        made.append(
            f"Not tried: {', '.join(untried)}; list what can be the case in [effects]."
        )
    change = found.change
    if change and not found.decomposition.get("onset"):
        made.append(
            f"The gap {change['direction']} at trial {change['trial']}, but effects "
            "are fitted as if they held throughout: diagnose what comes before and "
            "after apart (--trials)."
        )
    singles = [fit for fit in found.fits if len(fit.names) == 1]
    if singles and all(fit.at_bound for fit in singles):
        made.append(
            "Every fitted effect ends at a bound: the ranges are too narrow, or the "
            "model is of another robot."
        )
    elif found.fits and found.best.at_bound:
        made.append(
            f"{', '.join(found.best.at_bound)}: ends where its range does, and may be "
            "farther off than it says."
        )
    items = {row.term: row for row in rows}
    least = found.signatures.get("detectability", {})
    quiet = [name for name, size in least.items() if size is None and name in items]
    shown = [f"{name} ({items[name].excite})" for name in quiet[:LISTED]]
    if quiet:
        more = f" and {len(quiet) - LISTED} more" if len(quiet) > LISTED else ""
        made.append(
            f"Not excited, so neither found nor excluded: {', '.join(shown)}{more}; in "
            "brackets what would excite it."
        )
    return tuple(made)
