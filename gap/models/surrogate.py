"""A wheeled robot's planar dynamics, learnt from its own simulation.

A full simulation of each candidate at each magnitude is dear. Forward and turning
speed of a robot with speed-controlled wheels obey, from one step to the next, a map
that is almost linear in the wheels' lag behind what they are told; a weak motor clips
that lag, a sloping floor adds its pull. The few coefficients follow from some seconds
of simulated random driving by least squares. The map is then applied to thousands of
command lists at once (`gap/models/planar_rollout.py`). It is checked on further driving
that it has not seen and used only where its error there is far below what a tracker
can see; other models are simulated in full.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import mujoco
import numpy as np

from bns import models
from bns.gap.models import planar_rollout
from bns.gap.models.planar_rollout import EVERY, Map
from bns.worlds.effects import registry
from bns.worlds.effects.base import BodyEffect
from bns.worlds.physics import compile, observe
from bns.worlds.physics.rollout import Job, Segment, run
from bns.worlds.trial import body_displacements

DRIVES, CHECKS = 2, 1  # simulated drives that are fitted, that are checked
DRIVE = 4.0  # [s] each
SPEED = 0.16  # [m/s] largest speed in them, or the robot's own where it is slower
TILT, STEEPEST = 0.08, 0.12  # [rad] slope of the floor in drives, if it may slope
# Shares of the way from the nominal value to a bound at which maps are learnt.
LATTICE = np.array(
    [
        0,
        5e-4,
        2e-3,
        7e-3,
        0.02,
        0.05,
        0.09,
        0.14,
        0.2,
        0.27,
        0.35,
        0.44,
        0.54,
        0.65,
        0.77,
        0.9,
        1.0,
    ]
)
TIGHT = 0.1  # [m/s] lag; a motor that gives less than its torque there is rough
WEAKER = ("torque_limit",)  # effects that change the motors' largest torque alone
STEP = 0.1  # [s] over which the error is taken
GOOD = np.array([1e-4, 1e-4, 1e-3])  # [m, m, rad] error over STEP that passes
ROUGH = 8.0  # times as much passes where only a start is looked for


@dataclass(frozen=True, eq=False)
class Reduced:
    """The map of a robot with body effects.

    Attributes:
        map: see `travel.Map`.
        error: of the motion over `STEP`, as a multiple of `GOOD`; infinite = it
            does not apply.
    """

    map: Map
    error: float

    @property
    def good(self) -> bool:
        """Whether it may stand in for the simulation."""
        return self.error < 1

    @property
    def rough(self) -> bool:
        """Whether it shows what a simulation would do, to see where to start."""
        return self.error < ROUGH


@dataclass(frozen=True, eq=False)
class Drive:
    """A simulated drive, every `EVERY` steps.

    Attributes:
        speed: forward, left [m/s] and turning [rad/s], ``(S + 1, 3)``.
        wheels: speeds of the wheels as commands, ``(S + 1, 2)`` [m/s].
        told: speeds told, as `travel.halved` gives them, ``(S, 4)`` [m/s].
        pull: gravity along forward and left in each interval, ``(S, 2)`` [m/s^2].
        pose: ``(S + 1, 3)``.
    """

    speed: np.ndarray
    wheels: np.ndarray
    told: np.ndarray
    pull: np.ndarray
    pose: np.ndarray


@lru_cache(maxsize=4096)
def reduced(
    robot: str,
    effects: tuple[BodyEffect, ...],
    per_command: float,
    *,
    slopes: bool = False,
) -> Reduced:
    """The map of a robot with body effects; made once per process.

    Args:
        robot: name of the robot model.
        effects: body effects, none of them a slope of the floor.
        per_command: actuator control per m/s.
        slopes: whether the floor may slope.
    """
    dt = compile.compiled(robot).model.opt.timestep
    if abs(dt * EVERY - planar_rollout.INTERVAL) > 1e-9:
        return Reduced(Map.empty(), np.inf)
    rng = np.random.default_rng(0)
    tilts = (0.0, TILT, TILT, STEEPEST) if slopes else (0.0,) * (DRIVES + CHECKS)
    drives = [_drive(robot, effects, rng, per_command, tilt) for tilt in tilts]
    limit = _limits(compile.compiled(robot, effects).model, per_command)
    if not all(np.isfinite(drive.speed).all() for drive in drives):
        return Reduced(Map.empty(), np.inf)
    made = _fitted(drives[:-CHECKS], limit)
    return Reduced(made, max(_error(made, drive) for drive in drives[-CHECKS:]))


@lru_cache(maxsize=4096)
def between(
    robot: str, effect: BodyEffect, per_command: float, *, slopes: bool = False
) -> Reduced:
    """The map of a robot with one body effect, between maps on a lattice.

    A lattice of magnitudes is learnt once per process; between its levels the
    coefficients are cubic in the magnitude.

    Args:
        robot: name of the robot model.
        effect: with one parameter off its nominal value.
        per_command: actuator control per m/s.
        slopes: whether the floor may slope.
    """
    off = [p for p in effect.parameters if p.scales and effect[p.name] != p.nominal]
    if len(off) != 1:
        return reduced(robot, (effect,), per_command, slopes=slopes)
    (one,) = off
    if effect.name in WEAKER:
        base = reduced(robot, (), per_command, slopes=slopes)
        limit = _limits(compile.compiled(robot, (effect,)).model, per_command)
        strong = limit.min() > TIGHT
        return Reduced(
            replace(base.map, limit=limit), base.error * (1 if strong else 9)
        )
    end = one.high if effect[one.name] > one.nominal else one.low
    share = (effect[one.name] - one.nominal) / (end - one.nominal)
    first = int(np.clip(np.searchsorted(LATTICE, share) - 2, 0, len(LATTICE) - 4))
    marks = LATTICE[first : first + 4]
    on = np.abs(LATTICE - share) < 1e-9
    if on.any():
        return reduced(robot, (effect,), per_command, slopes=slopes)
    nodes = []
    for mark in marks:
        value = one.nominal + mark * (end - one.nominal)
        node = registry.make(effect.name, **{**effect.values, one.name: value})
        edits = () if node.is_nominal else (node,)
        nodes.append(reduced(robot, edits, per_command, slopes=slopes))
    others = marks[:, None] - marks[None, :] + np.eye(4)
    parts = (share - marks)[None, :] + np.eye(4) * (1 - (share - marks))
    weights = parts.prod(axis=1) / others.prod(axis=1)
    maps = [node.map for node in nodes]
    error = sum(abs(w) * n.error for w, n in zip(weights, nodes, strict=True) if w)
    return Reduced(planar_rollout.mixed(maps, weights), error)


def on_lattice(effect: str, parameter: str, values: Sequence[float]) -> tuple:
    """The levels of the lattice next to some magnitudes, which are learnt as they are.

    Args:
        effect: a body effect.
        parameter: its parameter.
        values: magnitudes, none of them nominal.
    """
    one = next(p for p in registry.get(effect).parameters if p.name == parameter)
    made = []
    for value in values:
        end = one.high if value > one.nominal else one.low
        share = (value - one.nominal) / (end - one.nominal)
        mark = LATTICE[1:][np.abs(LATTICE[1:] - share).argmin()]
        made.append(one.nominal + mark * (end - one.nominal))
    return tuple(sorted({float(value) for value in made}))


def _limits(model: mujoco.MjModel, per_command: float) -> np.ndarray:
    """Lag beyond which each wheel's motor gives its largest torque [m/s], ``(2,)``."""
    gain, largest = model.actuator_gainprm[:2, 0], model.actuator_forcerange[:2, 1]
    limited = model.actuator_forcelimited[:2].astype(bool) & (gain > 0)
    torque = np.where(limited, largest, np.inf)
    return torque / np.where(gain > 0, gain, 1.0) / per_command


def _fitted(drives: list[Drive], limit: np.ndarray) -> Map:
    wheel = np.linalg.lstsq(
        np.concatenate([d.speed[:, [0, 2]] for d in drives]),
        np.concatenate([d.wheels for d in drives]),
        rcond=None,
    )[0]
    terms = [
        planar_rollout.terms(d.speed[:-1, [0, 2]], wheel, d.told, d.pull, limit)
        for d in drives
    ]
    change = [np.diff(d.speed[:, [0, 2]], axis=0) for d in drives]
    side = np.linalg.lstsq(
        np.concatenate([planar_rollout.side_terms(d.speed[:, [0, 2]]) for d in drives]),
        np.concatenate([d.speed[:, 1] for d in drives]),
        rcond=None,
    )[0]
    step = _solve(np.concatenate(terms), np.concatenate(change))
    return Map(step, wheel, side, limit)


def _solve(terms: np.ndarray, change: np.ndarray) -> np.ndarray:
    scale = np.abs(terms).max(axis=0) + 1e-12
    ridge = 1e-6 * np.eye(terms.shape[1])
    left = np.vstack([terms / scale, ridge])
    right = np.vstack([change, np.zeros((len(ridge), change.shape[1]))])
    return np.linalg.lstsq(left, right, rcond=None)[0] / scale[:, None]


def _drive(
    robot: str,
    effects: tuple[BodyEffect, ...],
    rng: np.random.Generator,
    per_command: float,
    tilt: float,
) -> Drive:
    more = registry.make("floor_slope", angle=tilt, direction=0.0)
    scene = compile.compiled(robot, (*effects, more) if tilt else effects)
    model, dt = scene.model, scene.model.opt.timestep
    steps = round(DRIVE / dt / EVERY) * EVERY
    lengths = rng.integers(round(0.2 / dt), round(0.8 / dt), 60)
    index = np.repeat(np.arange(60), lengths)[:steps]
    most = min(SPEED, float(models.robot(robot).limits.min()))
    told = rng.uniform(-most, most, (60, 2))[index]
    begin = compile.start_state(scene, (0.0, 0.0, 0.0))
    states = run(Job(begin, (Segment(scene, told * per_command),))).states[::EVERY]
    place = compile.free_joint(model)
    at = 1 + model.nq
    pose = observe.planar(states[:, 1 + place.start : 1 + place.stop], 0.0)
    vx, vy, turn = states[:, at], states[:, at + 1], states[:, at + 5]
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    speed = np.column_stack([cos * vx + sin * vy, cos * vy - sin * vx, turn])
    joints = model.jnt_dofadr[model.actuator_trnid[:2, 0]]
    wheels = states[:, at + joints] / per_command
    pull = planar_rollout.pull(pose[:-1, 2], model.opt.gravity)
    return Drive(speed, wheels, planar_rollout.halved(told), pull, pose)


def _error(made: Map, drive: Drive) -> float:
    (pose,) = planar_rollout.poses([made], [drive.told], [drive.pull])
    every = round(STEP / planar_rollout.INTERVAL)
    found = body_displacements(pose[::every])
    error = found - body_displacements(drive.pose[::every])
    return float((np.sqrt((error**2).mean(axis=0)) / GOOD).max())
