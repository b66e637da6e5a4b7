"""A made-up batch of runs: it solves the simple task, is damaged, and recovers."""

import os
from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text

from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.record import RunRecord
from bns.experiment.task_settings import TaskConfig
from bns.seeding import generator
from bns.viz import page
from bns.worlds.trial import Commands, Trial

os.environ["RERUN_ANALYTICS"] = "0"

REPLICATES, TRIALS, ONSET, LONGEST = 5, 40, 20, 24
AXLE = 0.09  # m, made up
SPEED = 0.1  # m/s, made up
WEAK = 0.6  # gain of the left wheel after the damage


COLUMNS = """
    fitness fitness_best fitness_predicted reached solved diversity_41 diversity_51
    diversity_73 snn_forward snn_left snn_turn snn_loss patterns damaged commands
"""


def drive(pose, left, right, duration, steps=1):
    """Poses of a unicycle, ``(steps + 1, 3)``."""
    poses = [np.asarray(pose, dtype=float)]
    for _ in range(steps):
        x, y, yaw = poses[-1]
        dt = duration / steps
        turn = (right - left) / AXLE * dt
        ahead = (right + left) / 2 * dt * np.sinc(turn / 2 / np.pi)  # the chord
        middle = yaw + turn / 2
        poses.append(
            np.array(
                [x + ahead * np.cos(middle), y + ahead * np.sin(middle), yaw + turn]
            )
        )
    return np.stack(poses)


def plan(goals, gain, error, rng):
    """Commands that would visit `goals` if the left wheel had the gain `gain`."""
    commands, pose = [], np.zeros(3)
    for goal in goals:
        offset = np.asarray(goal) - pose[:2]
        turn = np.arctan2(offset[1], offset[0]) - pose[2]
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        for kind, amount in (("turn", turn), ("go", np.hypot(*offset) - 0.03)):
            if kind == "turn":
                duration = max(abs(amount) * AXLE / 2 / SPEED, 0.05)
                wheels = np.array([-1, 1]) * np.sign(amount) * SPEED
            else:
                duration, wheels = max(amount, 0.02) / SPEED, np.array([SPEED, SPEED])
            wheels = wheels / [gain, 1] * (1 + error * rng.normal(size=2))
            duration *= 1 + error * rng.normal() * 0.5
            command = np.array([*np.clip(wheels, -0.2, 0.2), abs(duration) + 0.02])
            commands.append(command)
            nominal = command[:2] * [gain, 1]
            pose = drive(pose, *nominal, command[2])[-1]
        pose = pose if error < 0.2 else pose + rng.normal(size=3) * error * 0.1
    return np.array(commands)


def _score(path, goals, count):
    reached, cost = 0, 0.5 * count
    for x, y, _ in path[1:]:
        if reached < len(goals):
            distance = 100 * np.hypot(x - goals[reached][0], y - goals[reached][1])
            cost += distance
            reached += distance < 9
    return cost + 10000.0 * (len(goals) - reached), reached


def _believed(trial, rate):
    """The gain the learner believes in: right at first, slowly right again."""
    if trial < ONSET:
        return 1.0
    return WEAK + (1 - WEAK) * np.exp(-(trial - ONSET) / rate)


def _error(trial, replicate):
    return 0.9 * np.exp(-trial / (2.0 + 0.5 * replicate)) + 0.01


def _one(trial, replicate, goals, rng):
    gain = WEAK if trial >= ONSET else 1.0
    believed = _believed(trial, 1.0 + 0.4 * replicate)
    sent = plan(goals, believed, _error(trial, replicate), rng)
    real, predicted = [np.zeros(3)], [np.zeros(3)]
    for left, right, duration in sent:
        real.append(drive(real[-1], left * gain, right, duration)[-1])
        wrong = 1 + _error(trial, replicate) * rng.normal(size=2) * 0.4
        foreseen = left * believed * wrong[0], right * wrong[1], duration
        predicted.append(drive(predicted[-1], *foreseen)[-1])
    return sent, np.array(real), np.array(predicted)


def make_config(**changes):
    """A configuration like the one the batch would have had."""
    values = dict(
        preset="khepera-simple",
        task=TaskConfig(name="simple"),
        world=WorldConfig(damage=(f"wheel_gain:wheel=left,factor={WEAK}@{ONSET}",)),
        trials=TRIALS,
        replicates=REPLICATES,
    )
    return RunConfig(**(values | changes))


def make_record(seed=0, slow=1.0, **changes):
    """R replicates of T trials with every column of a record."""
    rng = generator(seed, "viz-fixture")
    config = make_config(**changes)
    x, y = config.task.corner_x, config.task.corner_y
    corners = {"A": (x, -y), "B": (-x, -y), "C": (-x, y), "D": (x, y)}
    goals = [corners[letter] for letter in "ABCDA"]
    shape = (REPLICATES, TRIALS)
    sent = np.full((*shape, LONGEST, 3), np.nan)
    poses, predicted = (np.full((*shape, LONGEST + 1, 3), np.nan) for _ in range(2))
    columns = {name: np.zeros(shape) for name in COLUMNS.split()}
    for replicate, trial in np.ndindex(shape):
        commands, real, foreseen = _one(trial, replicate * slow, goals, rng)
        count = len(commands)
        at = (replicate, trial)
        sent[at][:count], poses[at][: count + 1] = commands, real
        predicted[at][: count + 1] = foreseen
        values = _figures(real, foreseen, goals, count, rng)
        values["damaged"] = float(trial >= ONSET)
        values["patterns"] = count * (trial + 1)
        values["diversity_41"] = 4e4 * np.exp(-trial / 15) + 4e3 * rng.random()
        values["diversity_51"] = values["diversity_41"] ** 2 / 1e4
        values["diversity_73"] = 0.9 * np.exp(-trial / 20) + 0.02 * rng.random()
        for name, value in values.items():
            columns[name][at] = value
    return RunRecord(
        config=config,
        versions={"bns": "0.1.0", "mujoco": "3.17.0", "python": "3.11"},
        columns=columns,
        sent=sent,
        poses=poses,
        predicted=predicted,
        damage_onset=np.full(REPLICATES, ONSET),
    )


def _figures(real, foreseen, goals, count, rng):
    fitness, reached = _score(real, goals, count)
    step = np.diff(real, axis=0) - np.diff(foreseen, axis=0)
    rms = np.sqrt((step**2).mean(axis=0))
    return {
        "fitness": fitness,
        "fitness_best": fitness * (0.9 + 0.1 * rng.random()),
        "fitness_predicted": _score(foreseen, goals, count)[0],
        "reached": reached,
        "solved": float(reached == len(goals)),
        "snn_forward": rms[0],
        "snn_left": rms[1],
        "snn_turn": rms[2],
        "snn_loss": float((rms**2).sum()),
        "commands": count,
    }


def make_trial(record, replicate, trial, steps=12):
    """The dense trial that belongs to one entry of a record."""
    sent = record.sent[replicate, trial]
    sent = sent[np.isfinite(sent[:, 0])]
    onset = record.damage_onset[replicate]
    gain = WEAK if 0 <= onset <= trial else 1.0
    poses, times = [np.zeros((1, 3))], [np.zeros(1)]
    for left, right, duration in sent:
        poses.append(drive(poses[-1][-1], left * gain, right, duration, steps)[1:])
        times.append(times[-1][-1] + duration * np.arange(1, steps + 1) / steps)
    return Trial(
        commands=Commands(sent[:, :2], sent[:, 2]),
        times=np.concatenate(times),
        observed=np.concatenate(poses),
        boundaries=np.arange(len(sent) + 1) * steps,
        robot="khepera3",
        world="mujoco",
    )


@pytest.fixture(scope="session")
def record():
    """Five replicates of forty trials, damaged from trial 20 on."""
    return make_record()


@pytest.fixture(scope="session")
def trials(record):
    """The dense trials of replicate 0."""
    return [make_trial(record, 0, trial) for trial in range(record.trials)]


@pytest.fixture
def illegible(monkeypatch):
    """What cannot be read of figures that went into pages since, wide and narrow."""
    found, drawn = [], page._address

    def looked_at(figure):
        found.extend(_flaws(figure))
        return drawn(figure)

    monkeypatch.setattr(page, "_address", looked_at)
    return found


SLACK = 1.5  # [px] that boxes may touch: they are larger than the letters


def _flaws(figure):
    """A line for each text beyond the edge, and each two texts that overlap."""
    drawn = _texts(figure)
    width, height = figure.canvas.get_width_height()
    beyond = [
        f"beyond the edge: {said!r}"
        for said, box in drawn
        if min(box.x0, box.y0, width - box.x1, height - box.y1) < -SLACK
    ]
    crossed = [
        f"on one another: {one!r} and {other!r}"
        for (one, first), (other, second) in combinations(drawn, 2)
        if _overlap(first, second)
    ]
    return beyond + crossed


def _texts(figure):
    """What is written, and the box around it, of each text that is drawn."""
    found = []
    draw = Text.draw

    def noted(text, renderer, *args, **kwargs):
        draw(text, renderer, *args, **kwargs)
        if text.get_visible() and text.get_text().strip():
            found.append((text.get_text(), text.get_window_extent(renderer)))

    figure.draw_without_rendering()  # the layout, once
    Text.draw = noted
    try:
        figure.draw_without_rendering()
    finally:
        Text.draw = draw
    return found


def _overlap(one, other):
    """Whether two boxes lie on one another."""
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return min(wide, high) > SLACK


@pytest.fixture
def flaws():
    """Says what of a figure cannot be read: texts beyond its edge, on one another."""
    return _flaws
