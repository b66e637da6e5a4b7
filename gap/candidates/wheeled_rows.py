"""Numbers of a wheeled robot that may be off, and how far they plausibly are."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.recordings import trial_conditions
from bns.worlds.effects import registry
from bns.worlds.effects.command import DIRECTION, TOP_SPEED
from bns.worlds.effects.parameter import Parameter
from bns.worlds.effects.surfaces import SLIDING
from bns.worlds.effects.wheels import CONE
from bns.worlds.trial import Trial

SIDES = ("left", "right", "both")
TURNS = "turns in place and arcs"
LEAD = "step_lead"
"""shift of the simulation in time that no effect is: its own steps lead or lag"""
REASON = 4.0  # standard deviations by which a nuisance may be off: beyond is an effect
BANDS = 10  # widths of a dead band that are tried, where there are more
RATIO = np.log(1.25)  # between two of them, beyond which up to twice as many are
CREEP = 0.004  # [m/s] slower than any dead band that matters; assumed
GRIPS = (0.02, 0.03, 0.045, 0.065, 0.09, 0.13, 0.2, 0.35)
"""friction over the model's, tried: between two of them a torque limit may do better"""
DRAGS = (0.007, 0.02, 0.06, 0.2, 0.6)  # friction coefficients of a caster, tried
STUCK = (0.02, 0.06, 0.2, 0.5, 1.0)  # how far a wheel may be stuck, tried

EXCITE = {
    "floor_slope": "long drives in several headings",
    "axle_length": TURNS,
    "dead_band": "slow commands",
    "speed_saturation": "fast commands",
    "torque_limit": "large, sudden changes of speed",
    "floor_friction": "large, sudden changes of speed",
    "payload": "large, sudden changes of speed",
    "centre_of_mass": "fast arcs and sudden changes of speed",
    "reverse_gain": "drives backwards",
    "motor_lag": "steps in speed",
    "command_latency": "steps in speed",
    "tracker_latency": "steps in speed",
}

# name, plausible departure (standard deviation), low, high, per wheel?, settings. The
# departures are what published figures and repairs of such robots show; slack is how
# well a nominal model is known: 0.3 to 0.4 % of a length, 1 ms, 10 g, 0.5 mm of a
# centre of mass, 0.2 mm and 1 mrad of a marker (all assumed).
_SMOOTH: tuple[tuple[str, float, float, float, bool, dict[str, Any]], ...] = (
    ("wheel_gain", 0.06, 0, 2, True, {"slack": 0.003, "levels": (0.0, 0.5, 0.85)}),
    ("reverse_gain", 0.06, 0, 2, True, {"slack": 0.003}),
    ("wheel_diameter", 0.04, 0.7, 1.3, True, {"levels": (0.93, 0.96, 1.04, 1.07)}),
    ("axle_length", 0.04, 0.7, 1.3, False, {"slack": 0.004}),
    ("motor_lag", 0.06, 0, 2, True, {"levels": (0.1, 0.25, 0.6), "step": 0.01}),
    ("command_latency", 0.05, 0, 1, False,
     {"levels": (0.1, 0.2, 0.4), "step": 0.01, "aliases": ("tracker_latency",)}),
    ("tracker_latency", 0.05, 0, 1, False,
     {"step": 0.01, "aliases": ("command_latency",)}),
    ("rolling_drag.torque", 0.004, 0, 0.03, True,
     {"step": 5e-4, "levels": (0.004, 0.01)}),
    ("rolling_drag.breakaway", 0.003, 0, 0.03, True,
     {"step": 5e-4, "levels": (0.002, 0.004, 0.008), "inexact": 0.05}),
    ("rolling_drag.viscous", 2e-4, 0, 0.01, True, {"step": 2e-5}),
    ("centre_of_mass.dx", 0.008, -0.02, 0.03, False,
     {"slack": 7e-4, "family": "centre_of_mass"}),
    ("centre_of_mass.dy", 0.008, -0.03, 0.03, False,
     {"slack": 5e-4, "family": "centre_of_mass"}),
    ("tracker_scale", 0.02, 0.8, 1.25, False, {}),
    ("clock_drift", 0.02, -0.1, 0.1, False, {}),
    ("marker_mount.dx", 0.008, -0.06, 0.06, False,
     {"slack": 2e-4, "family": "marker_mount"}),
    ("marker_mount.dy", 0.008, -0.06, 0.06, False,
     {"slack": 2e-4, "family": "marker_mount"}),
    ("marker_mount.yaw", 0.04, -0.5, 0.5, False,
     {"slack": 1e-3, "family": "marker_mount"}),
    ("battery_sag.per_second", 0.015, 0, 0.2, False, {}),
    ("battery_sag.per_metre", 0.08, 0, 2, False, {}),
    ("battery_fade", 0.01, 0, 0.2, False, {"per_trial": True}),
    ("dead_zone", 0.015, 0, 0.1, True, {}),
    ("wheel_backlash", 0.004, 0, 0.03, True, {"step": 1e-3, "levels": (0.005,)}),
)  # fmt: skip
# a mass that is carried, its moments about the middle of the axle and about the top
# plate, and its inertia about its own centre (a cube of 0.5 kg and 7 cm: 4e-4 kg m2)
_LOAD: tuple[tuple[str, float, float, float, str, dict[str, Any]], ...] = (
    ("payload.mass", 0.4, 0.0, 2.0, "kg", {"slack": 0.01, "levels": (0.3, 0.8)}),
    ("payload.mx", 0.015, -0.1, 0.1, "kg m", {"slack": 4e-4}),
    ("payload.my", 0.015, -0.1, 0.1, "kg m", {"slack": 4e-4}),
    ("payload.mz", 0.04, -0.1, 0.3, "kg m", {}),
    ("payload.inertia", 3e-4, 0.0, 0.01, "kg m2", {}),
)
_ROUND = (
    ("floor_slope", 0.03, 0.3, False, ()),
    ("wheel_eccentricity", 1e-3, 4e-3, True, (-1.5e-3, 1.5e-3)),
)
"""explanations with a size and a direction: two rows each, along x and y"""
PLANES = tuple(name for name, *_ in _ROUND)
STICKS = {"rolling_drag.breakaway": "rolling_drag.torque"}
"""rows that belong to the explanation of another: dry friction that breaks away"""


def term(name: str) -> str:
    """The explanation that a row belongs to."""
    stem, bracket, rest = name.partition("[")
    if stem.startswith(PLANES) or stem.startswith("payload."):
        return name.rpartition(".")[0]
    if stem in STICKS:
        return STICKS[stem] + bracket + rest
    return name.partition("@")[0]


def rows(trials: Sequence[Trial]) -> tuple[Row, ...]:
    """All numbers of a wheeled robot that may be off, in a fixed order.

    Args:
        trials: a recording; levels of dead bands and limits lie between its speeds.
    """
    made = [row for entry in _SMOOTH for row in _smooth(*entry)]
    made += [
        Row(name, 0.0, sd, low, high, unit=unit, group="payload",
            covers=("centre_of_mass.dx", "centre_of_mass.dy"),
            excite=EXCITE["payload"], **given)
        for name, sd, low, high, unit, given in _LOAD
    ]  # fmt: skip
    lead = max(0.003, trial_conditions.moments_unknown(trials) / 2)
    edge = REASON * lead
    made.append(Row(LEAD, 0.0, lead, -edge, edge, unit="s", nuisance=True, step=0.001))
    for name, sd, high, sided, levels in _ROUND:
        for side in SIDES[:2] if sided else ("",):
            whole = f"{name}[{side}]" if side else name
            made += [
                Row(
                    f"{whole}.{axis}",
                    0.0,
                    sd,
                    -high,
                    high,
                    group=whole,
                    levels=levels,
                    unit=_unit(name),
                    excite=EXCITE.get(name, "any drive"),
                )
                for axis in "xy"
            ]
    for side in SIDES:
        made += _rough(side, trials)
    made += [
        Row(f"caster_drag@{cone}", 0.0, 0.2, 0.0, 1.0, smooth=False, levels=DRAGS,
            group="caster_drag", excite="any drive")
        for cone in CONE.options
    ]  # fmt: skip
    made = [_joining(row) if row.name.endswith("[both]") else row for row in made]
    made += [
        Row(f"floor_friction@{cone}", 1.0, 0.3, 0.01, 3.0, smooth=False, levels=GRIPS,
            group="floor_friction", excite=EXCITE["floor_friction"])
        for cone in SLIDING.options
    ]  # fmt: skip
    return tuple(made)


def _joining(row: Row) -> Row:
    """A row of both wheels, which is one of each that hold alike."""
    parts = tuple(row.name.replace("[both]", f"[{side}]") for side in SIDES[:2])
    return replace(row, joins=parts)


def _smooth(
    name: str, sd: float, low: float, high: float, sided: bool, more: dict
) -> Iterable[Row]:
    stem = name.partition(".")[0]
    about = parameter(name)
    for side in SIDES if sided else ("",):
        given = dict(more)
        if name == "motor_lag" and side == "both":
            given["slack"] = 1e-3
        full = f"{name}[{side}]" if side else name
        yield Row(
            full,
            float(about.nominal),
            sd,
            low,
            high,
            unit=about.unit,
            group=term(full),
            excite=EXCITE.get(stem, "any drive"),
            **given,
        )


def parameter(name: str) -> Parameter:
    """The parameter that a row stands for, by the row's name."""
    stem, _, wanted = name.partition("[")[0].partition("@")[0].partition(".")
    every = registry.get(stem).parameters
    return next(p for p in every if not wanted or p.name == wanted)


def _unit(effect: str) -> str:
    return registry.get(effect).parameters[0].unit


def _rough(side: str, trials: Sequence[Trial]) -> list[Row]:
    """What has no slope at the nominal, of one wheel or both."""
    columns = {"left": [0], "right": [1]}.get(side, [0, 1])
    told = np.concatenate([trial.commands.values[:, columns] for trial in trials])
    speeds = np.unique(np.abs(told).round(6))
    speeds = speeds[speeds > 0]
    made = [
        Row(f"torque_limit[{side}]", 1.0, 0.05, 0.0, 1.0, smooth=False,
            levels=(0.05, 0.09, 0.13, 0.2), excite=EXCITE["torque_limit"]),
        Row(f"wheel_intermittent[{side}]", 0.0, 1.0, 0.0, 12.0, smooth=False,
            stepped=True, levels=(2.0, 3.0, 4.0, 5.0, 6.0, 8.0), excite="any drive"),
    ]  # fmt: skip
    if bands := _bands(speeds):
        made.append(
            Row(f"dead_band[{side}]", 0.0, 0.05, 0.0, 0.2, unit="m/s", smooth=False,
                stepped=True, levels=bands, excite=EXCITE["dead_band"])
        )  # fmt: skip
    if limits := _limits(speeds):
        made.append(
            Row(f"speed_saturation[{side}]", TOP_SPEED, 0.05, 0.0, TOP_SPEED,
                unit="m/s", smooth=False, levels=limits,
                excite=EXCITE["speed_saturation"])
        )  # fmt: skip
    for kind in ("wheel_stuck_max", "wheel_stuck_min"):
        made += [
            Row(f"{kind}[{side}]@{way}", 0.0, 1.0, 0.0, 1.0, smooth=False,
                levels=STUCK, group=f"{kind}[{side}]", excite="any drive")
            for way in DIRECTION.options
        ]  # fmt: skip
    return made


def _bands(speeds: np.ndarray) -> tuple[float, ...]:
    """Widths between the speeds told: between two of them a width does not matter. Of
    more than `BANDS`, some from a creep on, each in the middle of what was the widest
    ratio between two with others inside."""
    between = (speeds + np.append(speeds[1:], speeds[-1:] * 1.2)) / 2
    between = between[between < 0.2]
    if len(between) <= BANDS:
        return tuple(between.tolist())
    size = np.log(between)
    first = min(int(np.searchsorted(between, CREEP)), len(between) - BANDS)
    kept = [first, len(between) - 1]
    while len(kept) < 2 * BANDS:
        pairs = [(i, k) for i, k in itertools.pairwise(kept) if k - i > 1]
        wide = [(size[k] - size[i], i, k) for i, k in pairs]
        most, low, high = max(wide, default=(0.0, 0, 0))
        if len(kept) >= BANDS and most <= RATIO:
            break
        inside = np.arange(low + 1, high)
        middle = np.abs(size[inside] - (size[low] + size[high]) / 2).argmin()
        kept = sorted([*kept, int(inside[middle])])
    return tuple(between[kept].tolist())


def _limits(speeds: np.ndarray) -> tuple[float, ...]:
    """Limits that cut a part of the speeds told."""
    if not len(speeds):
        return ()
    share = np.array([0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 0.97])
    found = np.quantile(speeds, share) if len(speeds) > 5 else speeds
    return tuple(np.unique(found * 0.98).tolist())
