"""Diagnoses of other laboratories' wheeled robots; sensors mounted anywhere."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.gap.real_data import needed
from bench.result import Result, bench

BAR_VALUE = 3.0
TIED = {"axle", "both_diameters"}
MOUNT = {"mount_x": "l_x", "mount_y": "l_y", "mount_angle": "l_theta"}


@bench(
    "Khepera III odometry: place and angle of the laser against the published ones",
    bar="<= 3 sigma (published), axle or both diameters tied, plan a long "
    "straight drive",
)
def gap_khepera_odometry(quick: bool) -> Result:
    """One diagnosis of 4396 intervals; quick changes nothing."""
    from bns.gap.importers import khepera3_odometry
    from bns.gap.models.odometry import diagnosis
    from bns.gap.models.odometry.motions import NUMBERS, Motions

    home = needed("khepera3_odometry")
    trial = khepera3_odometry.read(home)
    published = khepera3_odometry.published(home)
    found = diagnosis.diagnose(Motions.of(trial, axle=khepera3_odometry.AXLE))
    verdict, supports = found.verdict, found.verdict.named
    best = found.fits[supports[0]] if supports else found.fits[()]
    values = dict(zip(NUMBERS, best.values.tolist(), strict=True))
    away = {
        name: abs(values[name] - published.values[theirs])
        / published.deviations[theirs]
        for name, theirs in MOUNT.items()
    }
    said = [TIED & set(support) for support in supports]
    tied = set().union(*said) == TIED and all(len(item) == 1 for item in said)
    planned = bool(found.plan) and found.plan[0][0].startswith("long straight")
    return Result(
        figure=round(float(max(away.values())), 3),
        unit="published sigma",
        holds=bool(max(away.values()) <= BAR_VALUE and tied and planned),
        n=len(trial.commands),
        details={
            "verdict": verdict.sentence,
            "tied": tied,
            "plan": dict(found.plan),
            "supports": {
                " + ".join(s): dict(found.fits[s].magnitudes) for s in supports
            },
            "costs": {
                " + ".join(s) or "nothing": f.cost for s, f in found.fits.items()
            },
            "angle_deg": verdict.angle,
            "held_out_gain_and_its_error": found.gain,
            "deviation_m_m_rad": found.noise.deviation,
            "published_sigmas": away,
            "changes": values,
            "published": published.values,
            "shares_alone_and_last_in": dict(found.shares),
            "inflation_of_variance": found.noise.inflation,
            "assumed_length_bias_mm": 1e3 * found.noise.length_bias,
        },
    )


SEED, CASES, QUICK = 2026, 50, 10
INTERVALS, SECONDS, AXLE = 1500, 0.8, 0.0884
SCATTER = np.array([7e-4, 5e-4, 1.7e-3])  # [m, m, rad] of a laser's scan matching
LOST = 0.005  # share of motions that are lost matches
BIAS = 2e-4  # [m] deviation of the common error of lengths, where there is one
LEVEL = 3.0
DRIVES = ("straights and spins", "arcs and spins", "arcs", "any", "spins")
WHEELS = (
    (),
    ("axle",),
    ("left_diameter",),
    ("right_diameter",),
    ("left_diameter", "right_diameter"),
    ("both_diameters",),
    ("axle", "left_diameter"),
    ("sensor_scale",),
)
IN_SPINS = ((), ("axle",), ("both_diameters",))
"""what turns on the spot show: no difference of the wheels, and no scale, which is a
mount farther out"""


@bench(
    "Odometry of made-up robots: wheels, axle and sensor's mount at any heading found",
    bar="50 of 50: all numbers within 3 sigma, with and without straight drives",
)
def gap_odometry_mounts(quick: bool) -> Result:
    """Fifty cases, ten of each way to drive; quick makes ten.

    The figure is of the fit of all numbers together. A support that is named holds the
    others nominal, within their slack; how often one of those named covers the truth is
    among the details. It does not where fewer errors explain as much as those planted.
    """
    rng = np.random.default_rng(SEED)
    rows = [case(number, rng) for number in range(QUICK if quick else CASES)]
    right = [row["all"] <= LEVEL for row in rows]
    failures = [row for row, held in zip(rows, right, strict=True) if not held]
    return Result(
        figure=sum(right),
        unit=f"of {len(rows)} cases",
        holds=all(right),
        n=len(rows),
        details={
            "a_named_support": sum(row["support"] <= LEVEL for row in rows),
            "wheels_named_or_tied": sum(row["named"] for row in rows),
            "by_drive": {
                drive: sum(right[at] for at in range(len(rows)) if at % 5 == number)
                for number, drive in enumerate(DRIVES)
            },
            "worst_deviations": [
                round(float(row[key]), 2) for row in rows for key in ("all", "support")
            ],
            "failures": failures,
        },
    )


def case(number: int, rng: np.random.Generator) -> dict[str, object]:
    """One robot: what is planted, and how far off it is found, in deviations."""
    from bns.gap.models.odometry import diagnosis, motions

    drive = DRIVES[number % len(DRIVES)]
    truth, wheels = planted(drive, rng)
    ways = driven(drive, rng)
    clean = motions.Motions(*ways.T, np.zeros((INTERVALS, 3)), AXLE)
    noise = rng.standard_t(4, (INTERVALS, 3)) / np.sqrt(2) * SCATTER
    seen = clean.predict(truth) + noise
    lost = rng.random(INTERVALS) < LOST
    seen[lost] += rng.normal(0, 0.1, (lost.sum(), 3))
    found = diagnosis.diagnose(motions.Motions(*ways.T, seen, AXLE))
    fits = [found.fits[names] for names in found.verdict.sets]
    return {
        "drive": drive,
        "truth": truth.round(5).tolist(),
        "all": off(found.full, truth),
        "support": min(off(item, truth) for item in fits),
        "named": any(set(wheels) <= set(names) for names in found.verdict.sets),
        "sentence": found.verdict.sentence,
    }


def planted(drive: str, rng: np.random.Generator) -> tuple[np.ndarray, tuple[str, ...]]:
    """Changes of all numbers, and the terms of the wheels among them."""
    from bns.gap.models.odometry import fit, motions

    choice = IN_SPINS if drive == "spins" else WHEELS
    wheels = choice[int(rng.integers(len(choice)))]
    values = np.zeros(len(motions.NUMBERS))
    for name in wheels:
        size = rng.choice([-1, 1]) * rng.uniform(0.01, 0.04)
        for one in fit.TERMS[name].numbers:
            values[motions.NUMBERS.index(one)] = size
    bearing, reach = rng.uniform(-np.pi, np.pi), rng.uniform(0.005, 0.08)
    place = reach * np.cos(bearing), reach * np.sin(bearing)
    bias = rng.normal(0, BIAS) * rng.integers(2)
    values[4:] = *place, rng.uniform(-np.pi, np.pi), bias
    return values, wheels


def driven(drive: str, rng: np.random.Generator) -> np.ndarray:
    """Ways of both wheels, ``(INTERVALS, 2)`` [m]."""
    signs = rng.choice([-1.0, 1.0], INTERVALS)
    straight = signs[:, None] * [1.0, 1.0]
    spin = signs[:, None] * [-1.0, 1.0]
    arc = signs[:, None] * rng.uniform(0.2, 1.0, (INTERVALS, 2))
    half = rng.random(INTERVALS)[:, None] < 0.5
    ways = {
        "straights and spins": np.where(half, straight, spin),
        "arcs and spins": np.where(half, arc, spin),
        "arcs": arc,
        "any": rng.uniform(-1, 1, (INTERVALS, 2)),
        "spins": spin,
    }[drive]
    way = np.exp(rng.uniform(np.log(0.008), np.log(0.06)))
    return ways * way * rng.uniform(0.95, 1.0, (INTERVALS, 2))


def off(found, truth: np.ndarray) -> float:
    """The largest error of a number but the bias, in deviations of the fit."""
    from bns.gap.models.odometry import motions

    error = found.values - truth
    error[motions.TURN] = motions.wrapped(error[motions.TURN])
    return float(np.abs(error / found.spread)[:-1].max())


LATE = ("command_lag[all]", "command_delay[all]")
"""which of them it is, smooth commands do not tell"""
GAIN = "command_gain[forward_speed]"


@bench(
    "MRCLAM 6: robots whose lag and forward gain are named with their shares",
    bar="5 of 5",
)
def gap_mrclam6(quick: bool) -> Result:
    """One diagnosis a robot, about 10 s each; quick: the first robot alone."""
    from bns.gap.importers import mrclam6

    home = needed("mrclam6")
    robots = mrclam6.robots(home)[: 1 if quick else None]
    rows = {robot: _one(home, robot) for robot in robots}
    named = [row["named"] for row in rows.values()]
    return Result(
        figure=sum(named) / len(named),
        unit="share",
        holds=all(named),
        n=len(named),
        details={f"robot {robot}": row for robot, row in rows.items()},
    )


def _one(home: Any, robot: int) -> dict[str, Any]:
    from bns.gap.diagnose import diagnose
    from bns.gap.models.unicycle import UnicycleModel
    from bns.gap.recordings import load_recordings

    model = UnicycleModel()
    trials = load_recordings.trials([str(home)], model, importer="mrclam6")
    trials = [t for t in trials if t.conditions["robot_number"] == robot]
    found = diagnose(trials, model, full=False)
    parts = {part["name"]: part for part in found.decomposition["parts"]}
    named = found.verdict.named  # where some tie, all sets of them
    return {
        "named": bool(named) and all(_right(names) for names in named),
        "verdict": found.verdict.kind,
        "sets": named,
        "trials": len(trials),
        "parts": {
            name: {key: part[key] for key in ("values", "low", "high", "last", "alone")}
            for name, part in parts.items()
        },
        "closed": found.closed["closed"],
        "left": found.decomposition["left"],
        "seconds": found.seconds,
    }


def _right(names: Sequence[str]) -> bool:
    """Whether a set of explanations has the gain and what makes the robot late."""
    return GAIN in names and any(name in names for name in LATE)
