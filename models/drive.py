"""A robot driven alone on its own floor, to see that its model does what it should."""

from typing import Any

import numpy as np

from bns.models.robot_model import RobotModel

SHARE = 0.4
"""of the largest command at which speed and spin are looked at; assumed"""
RAMP, STEADY = 2.0, 1.0
"""s; until the motion is taken as steady, and how long it is looked at; assumed"""


def smooth(model: Any, seconds: float, seed: int) -> np.ndarray:
    """Random controls over the whole range without jumps, shape ``(S, nu)``.

    Args:
        model: a `mujoco.MjModel`; its control ranges and time step count.
        seconds: duration.
        seed: of rates and phases.
    """
    rng = np.random.default_rng(seed)
    steps = round(seconds / model.opt.timestep)
    times = np.arange(steps) * model.opt.timestep
    rates, phases = rng.uniform(0.2, 2.0, model.nu), rng.uniform(0, 2, model.nu)
    low, high = model.actuator_ctrlrange.T
    wave = np.sin(2 * np.pi * (np.outer(times, rates) + phases))
    return (low + high) / 2 + wave * (high - low) / 2


def controlled(model: Any, controls: np.ndarray) -> tuple[np.ndarray, Any]:
    """Drive a compiled model from its `home`.

    Args:
        model: a `mujoco.MjModel`.
        controls: one row a physics step, shape ``(S, nu)``.

    Returns:
        Configurations after each step, shape ``(S, nq)``, and the `mujoco.MjData`.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    seen = np.empty((len(controls), model.nq))
    for step, control in enumerate(controls):
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        seen[step] = data.qpos
    return seen, data


def straight(robot: RobotModel, model: Any) -> tuple[float, float]:
    """Speed forwards that a wheeled robot is told, and the one it keeps [m/s]."""
    told = SHARE * float(robot.limits.min())
    places, yaws, seconds = _steady(robot, model, left=told, right=told)
    ahead = (places[-1] - places[0]) @ (np.cos(yaws[0]), np.sin(yaws[0]))
    return told, float(ahead) / seconds


def spin(robot: RobotModel, model: Any) -> tuple[float, float]:
    """Rate at which it is told to spin, left positive, and the one it keeps [rad/s]."""
    speed = SHARE * float(robot.limits.min())
    _, yaws, seconds = _steady(robot, model, left=-speed, right=speed)
    left, right = (_place(model, robot.wheels[side].body) for side in ("left", "right"))
    axle = float(np.linalg.norm(left - right))
    return 2 * speed / axle, float(yaws[-1] - yaws[0]) / seconds


def _steady(
    robot: RobotModel, model: Any, **told: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Places [m] and yaws [rad] over the steady part, and how long that lasts [s]."""
    ramp, steady = (round(time / model.opt.timestep) for time in (RAMP, STEADY))
    controls = np.zeros((ramp + steady, model.nu))
    for side, speed in told.items():
        at = model.actuator(robot.wheels[side].actuator).id
        controls[:, at] = speed * robot.ctrl_per_command
    seen, _ = controlled(model, controls)
    at = int(model.joint(robot.base_joint).qposadr[0])
    w, i, j, k = seen[ramp - 1 :, at + 3 : at + 7].T
    yaws = np.unwrap(np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)))
    return seen[ramp - 1 :, at : at + 2], yaws, steady * model.opt.timestep


def _place(model: Any, body: str) -> np.ndarray:
    """Where a body is at `home` [m]."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_kinematics(model, data)
    return data.body(body).xpos.copy()
