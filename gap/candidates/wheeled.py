"""Candidate explanations for a wheeled robot, from the library of effects."""

from collections.abc import Iterable, Sequence

import numpy as np

from bns.gap.models.surrogate import WEAKER, on_lattice
from bns.gap.records import Candidate
from bns.worlds.effects import registry
from bns.worlds.effects.base import BodyEffect
from bns.worlds.effects.common import TOP_SPEED
from bns.worlds.trial import Trial

SIDES = ("left", "right", "both")
HEADINGS = tuple({"direction": k * np.pi / 2} for k in (-1, 0, 1, 2))
WAYS = tuple({"direction": way} for way in ("forward", "backward", "commanded"))
FACTORS = (0.75, 0.93, 1.07, 1.25)
BANDS = (0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.075, 0.09, 0.11, 0.13)
STEPS = 10  # of a dead band that are told apart; wider ones lie on the grid
TURNS = "turns in place and arcs"

# effect, parameter, grid, low, high, per wheel?, further settings. Grids span the
# effect's range, denser near the nominal; bounds narrower than the effect's own are
# where a fit would stop to make sense for this robot (assumed). Slack is how well the
# nominal model is believed to be known (assumed: half of what published figures differ
# by, 10 g, 1 ms); "both_slack" belongs to both wheels together.
_TABLE = (
    ("axle_length", "factor", FACTORS, 0.7, 1.3, False, {"slack": 0.005}),
    ("battery_sag", "per_second", (0.003, 0.02, 0.1), 0, 0.2, False, {}),
    ("battery_sag", "per_metre", (0.05, 0.3, 1.5), 0, 2, False, {}),
    (
        "centre_of_mass",
        "dx",
        (-0.02, -0.01, 0.01, 0.02),
        -0.02,
        0.03,
        False,
        {"slack": 5e-4},
    ),
    ("centre_of_mass", "dy", (-0.025, -0.01, 0.01, 0.025), -0.03, 0.03, False, {}),
    ("clock_drift", "rate", (-0.1, -0.02, 0.02, 0.1), -0.1, 0.1, False, {}),
    (
        "command_latency",
        "delay",
        (0.05, 0.1, 0.2, 0.4, 0.8),
        0,
        1,
        False,
        {"aliases": ("tracker_latency",)},
    ),
    ("dead_band", "speed", BANDS, 0, 0.2, True, {"stepped": True}),
    ("floor_friction", "factor", (0.01, 0.03, 0.1, 0.3), 0.01, 3, False, {}),
    (
        "motor_lag",
        "time_constant",
        (0.03, 0.1, 0.3, 0.8),
        0,
        2,
        True,
        {"both_slack": 1e-3},
    ),
    ("payload", "mass", (0.2, 0.7, 2.0), 0, 2, False, {"slack": 0.01}),
    ("rolling_drag", "torque", (0.0003, 0.001, 0.003, 0.01), 0, 0.03, True, {}),
    ("rolling_drag", "viscous", (5e-5, 4e-4, 3e-3), 0, 0.01, True, {}),
    (
        "speed_saturation",
        "limit",
        (0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14),
        0,
        TOP_SPEED,
        True,
        {},
    ),
    ("torque_limit", "factor", (0.02, 0.05, 0.09, 0.13, 0.2), 0, 1, True, {}),
    (
        "tracker_latency",
        "delay",
        (0.05, 0.1, 0.2, 0.4, 0.8),
        0,
        1,
        False,
        {"aliases": ("command_latency",)},
    ),
    ("tracker_scale", "factor", (0.85, 0.95, 1.05, 1.2), 0.8, 1.25, False, {}),
    ("wheel_diameter", "factor", FACTORS, 0.7, 1.3, True, {"slack": 0.003}),
    ("wheel_gain", "factor", (0, 0.5, 0.85, 1.15, 1.7), 0, 2, True, {}),
    ("wheel_intermittent", "every", (2, 3, 4, 5, 6, 8), 2, 12, True, {"nominal": 0}),
    ("wheel_stuck_max", "blend", (0.1, 0.4, 1), 0, 1, True, {"branches": WAYS}),
    ("wheel_stuck_min", "blend", (0.1, 0.4, 1), 0, 1, True, {"branches": WAYS}),
)
EXCITE = {
    "floor_slope": "long drives in several headings",
    "axle_length": TURNS,
    "dead_band": "slow commands",
    "speed_saturation": "fast commands",
    "torque_limit": "large, sudden changes of speed",
    "floor_friction": "large, sudden changes of speed",
    "payload": "large, sudden changes of speed",
    "centre_of_mass": "fast arcs and sudden changes of speed",
    "motor_lag": "steps in speed",
    "command_latency": "steps in speed",
    "tracker_latency": "steps in speed",
}


def candidates() -> tuple[Candidate, ...]:
    """All candidates of a wheeled robot, in a fixed order."""
    found = [item for row in _TABLE for item in _rows(*row)]
    found.append(
        Candidate(
            name="floor_slope",
            effect="floor_slope",
            parameter="angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.35,
            grid=(0.02, 0.1),
            branches=HEADINGS,
            extras=("direction",),
            excite=EXCITE["floor_slope"],
        )
    )
    return tuple(found)


def steps(candidate: Candidate, trials: Sequence[Trial]) -> tuple[float, ...]:
    """Widths of a dead band, one between each two speeds that were told.

    Args:
        candidate: a dead band.
        trials: a recording; between two of its speeds a width makes no difference.
    """
    columns = {"left": [0], "right": [1]}.get(candidate.fixed.get("wheel"), [0, 1])
    told = [np.abs(trial.commands.values[:, columns]).ravel() for trial in trials]
    speeds = np.unique(np.concatenate(told).round(9))
    speeds = speeds[(speeds > 0) & (speeds < candidate.high)]
    between = (speeds + np.append(speeds[1:], candidate.high)) / 2
    few = between[:STEPS]
    more = [value for value in candidate.grid if value > few.max(initial=0.0)]
    return (*few.tolist(), *more)


def _rows(
    effect: str,
    parameter: str,
    grid: tuple[float, ...],
    low: float,
    high: float,
    sided: bool,
    more: dict,
) -> Iterable[Candidate]:
    described = registry.get(effect)
    about = next(p for p in described.parameters if p.name == parameter)
    several = sum(p.scales for p in described.parameters) > 1
    if issubclass(described, BodyEffect) and effect not in WEAKER:
        grid = on_lattice(effect, parameter, [v for v in grid if low <= v <= high])
        grid = tuple(value for value in grid if low <= value <= high)
    stem = f"{effect}.{parameter}" if several else effect
    for side in SIDES if sided else ("",):
        settings = {"nominal": about.nominal, **more}
        slack, shared = settings.pop("slack", 0.0), settings.pop("both_slack", 0.0)
        yield Candidate(
            name=f"{stem}[{side}]" if side else stem,
            effect=effect,
            parameter=parameter,
            unit=about.unit,
            low=min(low, settings["nominal"]),
            high=high,
            grid=grid,
            fixed={"wheel": side} if side else {},
            slack=shared if side == "both" else slack,
            excite=EXCITE.get(effect, "any drive"),
            **settings,
        )
