"""Numbers of a model of the user's own that may be off, and how far they may be."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from bns.gap.candidates import mjcf_ends
from bns.gap.candidates.mjcf import EXCITE
from bns.gap.candidates.mjcf_usual import ENDING, TOUCHING
from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import masses
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.masses import Body
from bns.gap.recordings import trial_conditions
from bns.worlds.effects.parts import ALL
from bns.worlds.trial import Trial

LEAD = "step_lead"
"""shift of the simulation in time that no effect is"""
LAGS = 1.5  # half steps that a simulation may lead by; a robot that is later is late
STEP = "fine_steps"
"""share of what finer steps change of the motion: 0 = as by the model's own step, 1 =
as by finer ones; a third more = as by ever finer ones, where errors go with the step"""
GROUPED = (
    "joint_damping",
    "joint_friction",
    "joint_armature",
    "geom_radius",
    "actuator_gain",
    "actuator_gear",
    "actuator_kp",
    "actuator_lag",
    "command_delay",
    "command_lag",
)
"""effects that may be on all parts alike: one kind of bearing, wheel, motor or supply;
a loop's damping, `actuator_kd`, is left to that of all joints"""
LATE = ("command_delay", "command_lag", "reading_delay")
LATER = 0.01  # [s] for derivatives: a lag has next to none where there is none
CUT = (0.15, 0.3, 0.5, 0.7, 0.9)  # of what was told at most: levels of a limit of it
TAKEN = (0.4, 0.6, 0.75, 0.88, 0.95, 0.99)  # quantiles of forces, for their limits
PEAKS = (0.8, 0.88, 0.95)  # of the largest force: what cuts short peaks alone
MORE, FULL = (1.25, 1.6), 0.98  # limits that are tried where the model's own is reached
TOLD = (0.05, 0.12, 0.2, 0.3, 0.4, 0.55)  # quantiles of what was told, for dead zones
FADING = 3  # trials from which one sees that less is done in each
EIGHTH = 0.125  # of the largest value: the plausible one
OFFSET = 0.0625  # of the span of an offset

# plausible departure and slack of what has no scale of its own (assumed): a gain of a
# motor is known to 10 %, of a sensor, a gear, a lever arm and a tyre to 3 %, a delay to
# 40 ms, a battery to 1 % a trial; loops run at 1 kHz, or at some 200 Hz; what balances
# a weight is known as a motor is, and drag no better. A clock is known to 1 %; its
# slack is that of gains, which make a robot as much faster or slower
PLAUSIBLE = {
    "actuator_gain": (0.1, 0.003),
    "actuator_kp": (0.05, 0.003),
    "actuator_kd": (0.15, 0.01),
    "actuator_gear": (0.03, 0.001),
    "actuator_lag": (0.04, 8e-4),
    "actuator_period": (0.004, 4e-4),
    "command_gain": (0.1, 0.003),
    "reading_gain": (0.03, 0.001),
    "geom_friction": (0.3, 0.0),
    "geom_radius": (0.03, 0.001),
    "geom_compliance": (0.5, 0.02),
    "command_fade": (0.01, 0.0),
    "command_delay": (0.04, 8e-4),
    "command_lag": (0.04, 8e-4),
    "reading_delay": (0.04, 8e-4),
    "body_length": (0.03, 0.001),
    "body_tilt": (0.03, 0.001),
    "tendon_arm": (0.03, 0.001),
    "coupling_ratio": (0.03, 0.001),
    "encoder_offset": (0.01, 0.0),
    "fluid_density": (0.1, 0.01),
    "fluid_viscosity": (0.3, 0.03),
    "gravity_compensation": (0.1, 0.003),
    "log_clock": (0.01, 0.003),
    "marker_mount": (0.01, 2e-4),
}
SLIPPERY = (0.15, 0.4)  # of a grip: no slope tells that what rolls slides with less
SHARE = 0.02  # slack of a number over its plausible departure
SIZES = ("command_dead_zone", "command_play")  # of which everything has a little


def rows(
    candidates: Sequence[Row],
    trials: Sequence[Trial],
    dt: float,
    bodies: Mapping[str, Body],
    *,
    stepped: bool = False,
    forces: Mapping[str, np.ndarray] | None = None,
    ends: Mapping[str, np.ndarray] | None = None,
) -> tuple[Row, ...]:
    """All numbers that may be off, with those of all joints alike.

    Args:
        candidates: of the model.
        trials: a recording; levels of dead bands lie between what it was told.
        dt: physics step [s].
        bodies: whose mass may be off, by name.
        stepped: whether finer steps change the motion. Robots know no steps, and what
            was simulated by the model's own is a recording, too; neither is a gap.
        forces: by actuator with a limit, those of the nominal motion over it, each
            ``(n,)``.
        ends: of joints that are stopped sooner than the nominal motion, by name:
            lowest and highest position recorded, and in the nominal motion, ``(2, 2)``.
    """
    lead = max(0.002, 0.5 * dt)
    late = max(lead, trial_conditions.moments_unknown(trials) / 2)
    made: list[Row] = []
    for item in candidates:
        if item.effect == "body_mass":
            body = bodies[item.fixed["part"]]
            made += masses.rows(item, body, EXCITE[item.effect])
        elif item.later:
            made.append(item)
        elif item.effect in ENDING:
            made += mjcf_ends.rows(item, (ends or {}).get(item.fixed["part"]))
        else:
            made += _of(item, trials, forces or {})
    edge = max(0.02, late)
    made.append(
        Row(LEAD, 0.0, late, -LAGS * lead, edge, unit="s", nuisance=True, step=0.001)
    )
    if stepped:
        made.append(Row(STEP, 1.0, 0.5, -1.0, 2.0, nuisance=True, step=0.5))
    return tuple(made)


def centres(bodies: Mapping[str, Body]) -> list[Row]:
    """Candidates that masses of bodies cover: where their centres of mass lie.

    Args:
        bodies: whose mass may be off, by name.
    """
    excite = EXCITE["body_centre"]
    return [
        row
        for part, body in bodies.items()
        for row in masses.centre(part, body, excite)
    ]


def grouped(candidates: Sequence[Row]) -> list[Row]:
    """Further candidates: an effect alike on all parts that are considered singly,
    where it has the same unit on all (a slide's damping is no hinge's)."""
    made = []
    for name in GROUPED:
        parts = [item for item in candidates if item.effect == name]
        if len({item.unit for item in parts}) > 1:
            continue
        if len(parts) > 1 and all(item.fixed["part"] != ALL for item in parts):
            made.append(_alike(parts, ALL))
    return made


def _alike(parts: Sequence[Row], which: str) -> Row:
    """One candidate for an effect on parts that a name or pattern stands for."""
    low = max(item.low for item in parts)
    high = max(item.high for item in parts)
    grid = tuple(value for value in parts[0].levels if low <= value <= high)
    return replace(
        parts[0],
        name=f"{parts[0].effect}[{which}]",
        low=low,
        high=high,
        sd=max(item.sd for item in parts),
        levels=grid or (high,),
        fixed={"part": which},
        slack=0.0,
        joins=tuple(item.name for item in parts),
    )


def gyros(candidates: Sequence[Row], config: OwnConfig) -> list[Row]:
    """Further candidates: a gyro whose axes all read alike more, or less, where the
    names of its channels differ in their last letter alone.

    Args:
        candidates: of the model.
        config: the description.
    """
    every = [item.channel.name for item in config.seen]
    axes: dict[str, list[str]] = {}
    for item in config.seen:
        if item.quantity == "gyro":
            axes.setdefault(item.part, []).append(item.channel.name)
    made = []
    for names in axes.values():
        stem = names[0][:-1]  # of "gyro_x"
        alike = [name for name in every if name.startswith(stem)]
        gains = [f"reading_gain[{name}]" for name in names]
        parts = [item for item in candidates if item.name in gains]
        if stem and alike == names and len(parts) == len(names) > 1:
            made.append(_alike(parts, f"{stem}*"))
    return made


def motors(candidates: Sequence[Row]) -> list[Row]:
    """Further candidates: a motor of another strength, in the place of both gains of
    its servo where these hold alike. In a search it stands in the place of dampings.

    Args:
        candidates: of a model.
    """
    sd, _ = PLAUSIBLE["actuator_kp"]
    known = {item.name: item for item in candidates}
    made = []
    for item in candidates:
        part = item.fixed.get("part")
        pair = tuple(f"actuator_{gain}[{part}]" for gain in ("kp", "kd"))
        name = f"actuator_gain[{part}]"
        if item.name == pair[0] and pair[1] in known and name not in known:
            made.append(
                replace(
                    item,
                    name=name,
                    effect="actuator_gain",
                    sd=sd,
                    slack=0.0,
                    later=True,
                    levels=(),
                    joins=pair,
                    excite=EXCITE["actuator_gain"],
                )
            )
    return made


def touching(candidates: Sequence[Row], names: Collection[str]) -> tuple[Row, ...]:
    """Candidates without those on surfaces that touch nothing.

    Args:
        candidates: of a model, groups included.
        names: of the geoms that touch something.
    """
    whole = {ALL} if names else set()
    return tuple(
        item
        for item in candidates
        if item.effect not in TOUCHING or item.fixed["part"] in {*names, *whole}
    )


def _of(
    item: Row, trials: Sequence[Trial], forces: Mapping[str, np.ndarray]
) -> Iterable[Row]:
    excite = EXCITE.get(item.effect, "any command")
    row = partial(
        Row,
        low=item.low,
        high=item.high,
        unit=item.unit,
        excite=excite,
        fixed=item.fixed,
        joins=item.joins,
    )
    third = (item.high - item.low) / 3
    if item.effect == "command_dead_band":
        if levels := _levels(item, trials):
            yield row(item.name, 0.0, third, smooth=False, stepped=True, levels=levels)
        return
    if item.effect == "command_limit":
        told = np.abs(_told(item, trials))
        levels = tuple(share * float(told.max()) for share in CUT)
        levels = tuple(v for v in levels if item.low < v < item.high)
        yield row(item.name, item.nominal, third, smooth=False, levels=levels)
        return
    if item.effect == "actuator_torque_limit":
        taken = forces.get(item.fixed["part"], np.ones(1))
        usual = np.quantile(taken, TAKEN)
        peaks = [share * taken.max() for share in PEAKS]
        levels = tuple(sorted(float(x) for x in (*usual, *peaks) if x < 1.0))
        levels += MORE if usual[-1] > FULL else ()
        if levels:
            yield row(item.name, 1.0, third, smooth=False, levels=levels)
        return
    if item.effect == "command_fade" and len(trials) < FADING:
        return
    sd, slack = _plausible(item)
    late, sliding = item.effect in LATE, item.effect == "geom_friction"
    step = LATER if late else sd if item.effect in TOUCHING else 0.0
    yield row(
        item.name,
        item.nominal,
        sd,
        slack=item.slack or slack,
        levels=(0.15, 0.3) if late else SLIPPERY if sliding else (),
        step=step,  # of a small one contacts show their chatter
        per_trial=item.effect == "command_fade",
    )


def _plausible(item: Row) -> tuple[float, float]:
    """Plausible departure of a number, and how well it is known."""
    sd, slack = PLAUSIBLE.get(item.effect, (0.0, 0.0))
    if item.effect.startswith(("joint_", "tendon_")):
        sd, slack = item.sd, SHARE * item.sd
    if not sd:
        offset = item.effect.endswith("_offset")
        sd = (OFFSET if offset else EIGHTH) * (item.high - item.low)
        slack = SHARE * sd if offset or item.effect in SIZES else 0.0
    return sd, 0.0 if item.joins else slack


def _told(item: Row, trials: Sequence[Trial]) -> np.ndarray:
    """What the channel of a row was told in all trials, or every channel."""
    names = [channel.name for channel in trials[0].commands.channels]
    part = item.fixed["part"]
    chosen = slice(None) if part == ALL else [names.index(part)]
    return np.concatenate([trial.commands.values[:, chosen] for trial in trials])


def _levels(item: Row, trials: Sequence[Trial]) -> tuple[float, ...]:
    """Sizes of a dead band between the magnitudes that were told."""
    sizes = np.unique(np.abs(_told(item, trials)).round(9))
    sizes = sizes[sizes > 0]
    if not len(sizes):
        return ()
    between = (sizes[:-1] + sizes[1:]) / 2 if len(sizes) > 1 else sizes
    found = np.minimum(np.quantile(between, TOLD), item.high)
    return tuple(np.unique(found).tolist())
