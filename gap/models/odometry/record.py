"""A diagnosis of odometry in the form of every other diagnosis."""

import numpy as np
from scipy.stats import norm

from bns.gap.models.odometry.diagnosis import DRIVES, OdometryDiagnosis, diagnose
from bns.gap.models.odometry.fit import TERMS, OdometryFit
from bns.gap.models.odometry.motions import Motions
from bns.gap.planning.excitation import Excitation
from bns.gap.planning.plan import Option, Plan
from bns.gap.planning.plan_runs import repeats
from bns.gap.records import Diagnosis, Fit
from bns.worlds.trial import Commands, Trial

MODEL = "odometry"
LEVEL = 1.6449  # 90 % interval
SPEED = 0.1  # [m/s] of the faster wheel in a planned drive
LEFT_OUT = "motions over single intervals have neither horizons nor a path"


def record(trials: list[Trial], *, axle: float) -> Diagnosis:
    """Diagnose wheel speeds against a sensor's motion, interval by interval.

    Args:
        trials: one or more recordings of one robot.
        axle: nominal distance of the wheels [m].

    Raises:
        BnsError: commands that are no wheel speeds, or too few intervals.
    """
    motions = Motions.joined([Motions.of(trial, axle=axle) for trial in trials])
    return of(diagnose(motions), len(trials))


def of(found: OdometryDiagnosis, trials: int) -> Diagnosis:
    """The record; magnitudes are changes of nominal (ratios) or what is added."""
    fits = tuple(_fit(names, item) for names, item in found.fits.items())
    return Diagnosis(
        model=MODEL,
        trials=trials,
        faults=(),
        verdict=found.verdict,
        fits=tuple(sorted(fits, key=lambda fit: fit.evidence)),
        where={},
        signatures={
            "plan": [list(row) for row in found.plan],
            "shares": {name: list(pair) for name, pair in found.shares.items()},
        },
        floor={
            "source": "the fit's own residuals",
            "sigma": [float(value) for value in found.noise.deviation],
            "channels": ["forward", "left", "turn"],
            "length_bias": found.noise.length_bias,
            "inflation": found.noise.inflation,
        },
        closed={},
        warnings=(
            f"A common error of lengths of {1e3 * found.noise.length_bias:g} mm per "
            "interval is assumed.",
        ),
        partial={"where, closed": LEFT_OUT},
    )


def planned(found: Diagnosis) -> Plan:
    """The drives that a diagnosis of odometry stored, best first."""
    options = []
    for name, distance in found.signatures.get("plan", ()):
        ways = np.array([DRIVES[name]])
        held = np.rint([np.abs(ways).max() / SPEED / 0.005]) * 0.005
        told = Commands(ways / held[:, None], held)
        option = Option(
            Excitation(name, told), np.array([distance]), float(norm.sf(distance / 2))
        )
        options.append(option)
    tied = found.verdict.named
    if not options:
        return Plan(tied, (), 0, "Nothing is tied: one explanation stands alone.")
    count = repeats(options[0].distances[0])
    names = " or ".join(" + ".join(support) for support in tied)
    said = f"Tied: {names}. Run {options[0].excitation.name}"
    return Plan(
        tied,
        tuple(options),
        count,
        f"{said} and measure the pose before and after; it parts the first two by "
        f"{options[0].distances[0]:.2g} deviations.",
    )


def _fit(names: tuple[str, ...], fit: OdometryFit) -> Fit:
    values = [fit.magnitudes[name] for name in names]
    half = [LEVEL * fit.deviations[name] for name in names]
    return Fit(
        names=names,
        effects=tuple(f"{n}:{v:+.5g}" for n, v in zip(names, values, strict=True)),
        magnitudes=tuple(values),
        intervals=tuple((v - h, v + h) for v, h in zip(values, half, strict=True)),
        units=tuple(TERMS[name].unit for name in names),
        loss=fit.loss,
        held_out=fit.loss,
        held_out_se=0.0,
        evidence=fit.cost,
    )
