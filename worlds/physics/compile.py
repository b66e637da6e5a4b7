"""Compiled models by robot and body effects, and robots placed at their start."""

from functools import lru_cache
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from bns import models
from bns.models import mjcf
from bns.worlds.active import Placed
from bns.worlds.effects.base import ModelEdit
from bns.worlds.physics import control, servo_law
from bns.worlds.physics.rollout import STATE, Compiled, Job, Segment, run

ARENA = 2**22
"""bytes of work space of a robot; a hexapod that falls over uses 0.13 MB. MuJoCo's own
choice is 14 MB, and a diagnosis keeps hundreds of them"""

SETTLE = 0.5  # [s] at rest before a trial, so that it starts without a bounce; assumed


@lru_cache(maxsize=256)
def compiled(
    robot: str, effects: tuple[ModelEdit, ...] = (), step: float = 0.0
) -> Compiled:
    """The robot's scene with the effects written into it.

    Args:
        robot: name of the robot model.
        effects: edits, in order.
        step: physics step [s]; 0 = the model's own.
    """
    spec = _nominal(robot).copy()
    if step:
        spec.option.timestep = step
    servo_law.fit(spec, models.robot(robot))
    own = len(spec.actuators)
    for effect in effects:
        effect.edit(spec)
    if spec.memory < 0:  # not said in the model
        spec.memory = ARENA
    model = mjcf.compiled(spec, f"the model of {robot}")
    return Compiled(model, hidden=model.nu - own)


@lru_cache(maxsize=8)
def _nominal(robot: str) -> Any:
    """The robot's scene as a `mujoco.MjSpec` to be copied: its files are read once."""
    return models.spec(robot, visuals=False)


@lru_cache(maxsize=256)
def start_state(scene: Compiled, start: tuple[float, float, float]) -> np.ndarray:
    """Full physics state of the robot at rest at its start pose, time 0.

    The robot is put down in its `home` pose and left alone for `SETTLE` seconds, so
    that it stands as its body and the floor let it stand; what it drifts is undone.

    Args:
        scene: the compiled model.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
    """
    data = put_down(scene.model, start)
    steps = round(SETTLE / scene.model.opt.timestep)
    rest = np.tile(data.ctrl[: scene.model.nu - scene.hidden], (steps, 1))
    return at_rest(scene, data, start, rest)


def put_down(model: mujoco.MjModel, start: tuple[float, float, float]) -> Any:
    """`mujoco.MjData` of a robot in its `home` pose, moved to a planar pose."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    place = free_joint(model)
    data.qpos[place] = posed(data.qpos[place], start)
    return data


def at_rest(
    scene: Compiled, data: Any, start: tuple[float, float, float], rest: np.ndarray
) -> np.ndarray:
    """Full physics state, shape ``(n,)``, of a robot that was left alone.

    What it drifts is undone. Where the physics diverges it is the state given.

    Args:
        scene: the compiled model.
        data: its `mujoco.MjData` as it was put down; changed.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        rest: controls meanwhile, shape ``(S, C)``.
    """
    model = scene.model
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    kept = len(state) - scene.hidden
    motion = run(Job(state[:kept], (Segment(scene, rest),)))
    if motion.diverged < 0:
        state[:kept] = motion.states[-1]
        mujoco.mj_setState(model, data, state, STATE)
        data.time = 0.0
        data.qvel[:] = 0.0
        place = free_joint(model)
        data.qpos[place] = posed(data.qpos[place], start)
        mujoco.mj_getState(model, data, state, STATE)
    state = state[:kept]
    state.setflags(write=False)
    return state


def posed(free: np.ndarray, start: tuple[float, float, float]) -> np.ndarray:
    """A free joint's (7,) values moved to a planar pose, its height and tilt kept."""
    x, y, yaw = start
    w, i, j, k = free[3:]
    angle = yaw - np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
    turn = np.array([np.cos(angle / 2), 0, 0, np.sin(angle / 2)])
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, turn, free[3:])
    return np.array([x, y, free[2], *turned])


def free_joint(model: mujoco.MjModel) -> slice:
    """Where the base's position and orientation lie in qpos."""
    joint = int(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
    at = int(model.jnt_qposadr[joint])
    return slice(at, at + 7)


def segments(
    robot: str,
    effects: tuple[Placed[ModelEdit], ...],
    values: np.ndarray,
    dt: float,
    step: float = 0.0,
) -> tuple[Segment, ...]:
    """The trial cut where a body effect starts or stops.

    Args:
        robot: name of the robot model.
        effects: body effects with their spans.
        values: actuator controls on the physics grid, shape ``(S, nu)``.
        dt: physics step [s].
        step: the same where it is not the model's own, else 0.
    """
    total = len(values)
    if not effects:
        return (Segment(_scene(robot, (), step), values),)
    moments = [moment for item in effects for moment in (item.start, item.stop)]
    inside = {control.step_at(moment, dt) for moment in moments if np.isfinite(moment)}
    cuts = [0, *sorted(step for step in inside if 0 < step < total), total]
    return tuple(
        Segment(_scene(robot, _held(effects, begin, dt), step), values[begin:end])
        for begin, end in pairwise(cuts)
    )


def _scene(robot: str, effects: tuple[ModelEdit, ...], step: float) -> Compiled:
    """As `compiled`, called so that one model has one place in its cache."""
    if step:
        return compiled(robot, effects, step)
    return compiled(robot, effects) if effects else compiled(robot)


def _held(
    effects: tuple[Placed[ModelEdit], ...], step: int, dt: float
) -> tuple[ModelEdit, ...]:
    """The effects that hold from a physics step on."""
    return tuple(
        item.effect
        for item in effects
        if control.step_at(item.start, dt) <= step
        and not (np.isfinite(item.stop) and control.step_at(item.stop, dt) <= step)
    )
