"""Stages of a diagnosis, and which share of its time each takes as a rule.

How long a fit goes on is not known beforehand: it searches until nothing gets better.
What its stages took of the whole was measured on three recordings, on two cores that
other programs used as well (23 November 2026).
"""

from collections.abc import Mapping, Sequence

from bns.gap.models.base import GapModel
from bns.gap.models.light import model as light_model
from bns.gap.records import Diagnosis
from bns.worlds.trial import Trial

BY_TANGENT = {"nominal model": 0.12, "explanations": 0.86, "rivals": 0.02}
"""where a tangent tells rivals apart: the demo's run, trials 15 to 20 (0.13, 0.85 and
0.02 of 116 and 126 s)"""
BY_FITS = {"nominal model": 0.08, "explanations": 0.1, "rivals": 0.82}
"""where each rival is fitted by itself, as of robots of a user's own: the arm of the
examples, four trials with a damped elbow (0.07, 0.10 and 0.83 of 9.5 s). A hexapod's
nominal model takes more of it (124 s in one that was not measured to its end), so
that its first estimate may be too long"""
OF_MANY = {"nominal model": 0.06, "explanations": 0.9, "rivals": 0.04}
"""the same of robots of many drives, where the search is most of it: a Panda of seven
joints and a Go2 of twelve, eight trials each (0.05 to 0.1, 0.88 to 0.92 and 0.03 of
230 and 1830 s, 27 November 2026)"""
DRIVES = 6  # told channels, more of which are many
WITH_LIGHT = {
    "nominal model": 0.08, "explanations": 0.35, "rivals": 0.02, "light": 0.55
}  # fmt: skip
"""of motion and then of readings: `khepera-light`, six trials with a weak wheel (0.08,
0.35, 0.02 and 0.55 of 140 s)"""


def shares(model: GapModel, trials: Sequence[Trial]) -> Mapping[str, float]:
    """Stage -> its usual share of the time that a diagnosis takes.

    Args:
        model: nominal model.
        trials: recorded commands and observations.
    """
    if light_model.told_by(model, trials):
        return WITH_LIGHT
    if model.many and len(model.limits) > DRIVES:
        return OF_MANY
    return BY_FITS if model.many or model.singly else BY_TANGENT


def nominal(found: Diagnosis, trials: int) -> float:
    """How long the nominal model takes on other trials [s], by an earlier diagnosis.

    Args:
        found: the diagnosis, of trials of about the same length.
        trials: how many the others are.
    """
    each = found.seconds.get("fit", 0.0) / max(found.trials, 1)
    return BY_TANGENT["nominal model"] * each * trials
