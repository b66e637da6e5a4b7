"""Made-up logs in the forms of two readers: a servo on a pendulum, and odometry.

They are to be alike from run to run, no more; the physics is coarse.
"""

import json
import math
from pathlib import Path

import numpy as np

STEP, SUBSTEPS, SAMPLES = 0.02, 20, 120  # [s], and how many
CELLS = tuple((mass, gain) for mass in (0.1, 0.15, 0.2) for gain in (200, 400))
DRIVES = ("sines", "steps")
LEVER, VOLTAGE, GRAVITY = 0.1, 5.0, 9.81  # [m], [V], [m/s2]
STALL, LOSS, FRICTION = 0.5, 0.05, 0.01  # [N m], [N m s/rad], [N m]
DUTY = 4096 / (2 * math.pi) / 128 / 885  # per rad of error at gain 1


def servo(directory: Path) -> tuple[Path, Path]:
    """Runs of a servo, unchanged and with 50 g more than is said.

    Returns:
        Directories of the changed and of the unchanged runs.
    """
    changed, unchanged = directory / "changed", directory / "unchanged"
    rng = np.random.default_rng(0)
    for mass, gain in CELLS:
        for drive in DRIVES:
            _write_run(unchanged, mass, gain, drive, rng)
    for drive in DRIVES:
        _write_run(changed, *CELLS[0], drive, rng, added=0.05)
    return changed, unchanged


def odometry(directory: Path, count: int = 600) -> Path:
    """Intervals of a robot on two wheels whose left wheel is 3 % larger."""
    rng = np.random.default_rng(0)
    radius, axle, interval = 0.0205, 0.0884, 0.8
    ways = ((1, 1), (-1, -1), (-1, 1), (1, -1))
    rows = []
    for _ in range(count):
        pair = ways[int(rng.integers(4))]
        left, right = (0.5 * way * float(rng.uniform(0.95, 1.0)) for way in pair)
        ahead_left = 1.03 * left * radius * interval
        ahead_right = right * radius * interval
        turn = (ahead_right - ahead_left) / axle
        ahead = (ahead_left + ahead_right) / 2
        moved = np.array([ahead * math.cos(turn / 2), ahead * math.sin(turn / 2), turn])
        moved += rng.normal(0, (7e-4, 5e-4, 1.7e-3))
        seen = [round(float(value), 6) for value in moved]
        speeds = {"phi_l": round(left, 6), "phi_r": round(right, 6)}
        rows.append({"T": interval, **speeds, "sm": seen})
    directory.mkdir(parents=True)
    text = "\n".join(json.dumps(row) for row in rows)
    (directory / "lstraight.tuple").write_text(text + "\n")
    return directory


def _write_run(
    directory: Path,
    mass: float,
    gain: int,
    drive: str,
    rng: np.random.Generator,
    added: float = 0.0,
) -> None:
    goals = [_goal(drive, STEP * n) for n in range(SAMPLES)]
    entries = _entries(goals, mass + added, gain, rng)
    told = {"mass": mass, "length": LEVER, "kp": gain, "vin": VOLTAGE}
    content = {**told, "motor": "xl330", "trajectory": drive, "entries": entries}
    directory.mkdir(parents=True, exist_ok=True)
    name = f"{round(1000 * mass)}_{gain}_{drive}.json"
    (directory / name).write_text(json.dumps(content))


def _goal(drive: str, time: float) -> float:
    if drive == "steps":
        return 0.6 if int(time / 0.6) % 2 else -0.4
    return 0.7 * math.sin(3.0 * time) + 0.3 * math.sin(7.0 * time)


def _entries(
    goals: list[float], mass: float, gain: int, rng: np.random.Generator
) -> list[dict[str, float]]:
    angle = speed = 0.0
    rows = []
    for number, goal in enumerate(goals):
        duty = max(-1.0, min(1.0, DUTY * gain * (goal - angle)))
        rows.append(
            {
                "timestamp": round(STEP * number, 6),
                "position": round(angle + float(rng.normal(0, 1e-3)), 6),
                "speed": round(speed, 6),
                "goal_position": round(goal, 6),
                "load": round(abs(300 * duty)),
                "input_volts": VOLTAGE,
                "temp": 30,
                "torque_enable": True,
            }
        )
        for _ in range(SUBSTEPS):
            torque = STALL * duty - LOSS * speed - FRICTION * math.tanh(speed / 0.05)
            torque -= mass * GRAVITY * LEVER * math.sin(angle)
            speed += torque / (mass * LEVER**2) * STEP / SUBSTEPS
            angle += speed * STEP / SUBSTEPS
            duty = max(-1.0, min(1.0, DUTY * gain * (goal - angle)))
    return rows
