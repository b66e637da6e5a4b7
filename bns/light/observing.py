"""What is kept of a closed-loop trial: figures and arrays of the record.

Figures, each ``(R,)``: fitness (equation 5.2 with its sign turned: 0 is best; the
dissertation maximises), fitness_best, fitness_predicted (inside the SNNs, from the
trial's own start), reached (1 where it came to the goal radius), solved
(`LightTask.solved`), edge_turns, lamp_stops, turned (by how much the robot turned on
the whole, counter-clockwise positive [rad]), commands (cycles until the robot was
stopped), the errors of `ERRORS`, snn_loss, sensor_loss,
patterns, sensor_patterns, diversity_41, diversity_51, diversity_73.

Arrays: sent ``(R, K, 3)`` (left, right [m/s], duration [s]), poses and predicted
``(R, K + 1, 3)`` [m, m, rad], readings and readings_predicted ``(R, K + 1, 2)``
[counts].
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from bns.light.patterns import READINGS, in_body
from bns.light.scaling import DARK, Scales, counts
from bns.light.simulator import Simulator, Thetas
from bns.light.task import LightTask, lost, places
from bns.path import integrate
from bns.worlds.trial import Trial

ERRORS = ("snn_forward", "snn_left", "snn_turn", "sensor_left", "sensor_right")
"""RMS errors of the SNNs on this trial before training on it: of one cycle's motion
[m, m, rad] and of one reading [counts]"""


def measured(
    task: LightTask, tried: Sequence[Trial], best: Sequence[Trial] | None
) -> dict[str, np.ndarray]:
    """What the world said."""
    went = places(tried)
    fitness = task.cost(went, lost(tried))
    counted = {
        name: np.array([getattr(trial.outcome, name) for trial in tried], np.float64)
        for name in ("edge_turns", "lamp_stops")
    }
    sent = [
        np.column_stack([t.commands.values[:, :2], t.commands.durations]) for t in tried
    ]
    solved = [
        task.solved(path, trial.handled)
        for path, trial in zip(went, tried, strict=True)
    ]
    return {
        "sent": np.stack(sent),
        "poses": np.stack([trial.command_poses_world for trial in tried]),
        "readings": np.stack([_readings(trial) for trial in tried]),
        "fitness": fitness,
        "fitness_best": fitness
        if best is None
        else task.cost(places(best), lost(best)),
        "reached": task.reached(went).astype(np.float64),
        "solved": np.array(solved, np.float64),
        "commands": np.array([_moving(trial) for trial in tried], np.float64),
        "turned": np.array([_turned(trial) for trial in tried]),
        **counted,
    }


def _readings(trial: Trial) -> np.ndarray:
    seen = np.stack([trial.channel(name) for name in READINGS], axis=1)
    return seen[trial.boundaries]


def _turned(trial: Trial) -> float:
    """Net turn over all command ends; less than half a turn a command [rad]."""
    yaw = trial.command_poses_world[:, 2]
    yaw = np.unwrap(yaw[np.isfinite(yaw)])
    return float(yaw[-1] - yaw[0]) if len(yaw) else 0.0


def _moving(trial: Trial) -> int:
    """Cycles until a robot was stopped for good."""
    free = np.flatnonzero(~trial.handled)
    return int(free[-1]) + 1 if len(free) else 0


def foreseen(
    simulator: Simulator,
    thetas: Thetas,
    genomes: Tensor,
    task: LightTask,
    tried: Sequence[Trial],
) -> dict[str, np.ndarray]:
    """What the SNNs said of the same controllers from the same starts."""
    begin = np.stack([trial.command_poses_world[0] for trial in tried])
    begin = np.nan_to_num(begin)
    lamp = torch.from_numpy(in_body(begin, task.lamp)).to(genomes)
    layers = simulator.controllers.layers(genomes.unsqueeze(1))
    state = simulator.begin(lamp[:, 0, None, None], lamp[:, 1, None, None])
    moved, read = [], []
    for _ in range(len(tried[0].commands)):
        state, seen = simulator.step(thetas, layers, state)
        moved.append(seen.moved[..., 0, 0])
        read.append(seen.brightness[..., 0, 0])
    read.append(simulator.look(thetas, state)[..., 0, 0])
    steps = torch.stack(moved, dim=2).double().cpu()  # (R, 3, K)
    paths = [
        np.vstack([pose, np.stack(integrate(*step, tuple(pose)), axis=1)])
        for step, pose in zip(steps, begin, strict=True)
    ]
    predicted = np.stack(paths)
    bright = torch.stack(read, dim=1).double().cpu().numpy()
    return {
        "predicted": predicted,
        "readings_predicted": counts(bright),
        "fitness_predicted": task.cost(predicted[..., :2]),
    }


def errors(moved: np.ndarray, light: np.ndarray, scales: Scales) -> np.ndarray:
    """`ERRORS` from scaled misses ``(N, 3)`` and ``(N, 2)``; NaN without patterns."""
    units = (scales.moved, (DARK, DARK))
    parts = [
        np.sqrt(np.mean((miss * unit) ** 2, axis=0))
        if len(miss)
        else np.full(len(unit), np.nan)
        for miss, unit in zip((moved, light), units, strict=True)
    ]
    return np.concatenate(parts)


def diversity(genes: Tensor, runs: int) -> dict[str, np.ndarray]:
    """Thesis equations 4.1, 5.1 and 7.3 of weights, each ``(R,)``; see
    `bns.evolution.diversity` for lists of commands."""
    genomes = genes.reshape(runs, -1, genes.shape[2]).double()
    apart = genomes - genomes.mean(1, keepdim=True)
    total = apart.abs().sum((1, 2))
    measures = {
        "diversity_41": total,
        "diversity_51": apart.square().sum((1, 2)),
        "diversity_73": total.clamp(min=1e-12).log(),
    }
    return {name: value.cpu().numpy() for name, value in measures.items()}
