"""The chosen trials of a recording, laid one after another in time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.experiment.record import RunRecord
from bns.tasks import registry as tasks
from bns.viz import geometry, rrd, style
from bns.viz.choices import Choice
from bns.viz.paths import arcs, dashes, listed
from bns.viz.rrd import READINGS, TRIAL_TIMELINE
from bns.worlds.trial import Trial

if TYPE_CHECKING:
    from rerun import RecordingStream


GAP = 1.0
"""s of pause between two trials"""

RATE = 30.0
"""poses per second kept"""

_ARC_SAMPLES = 12
_TRAIL = 0.005
"""m; half the width of a trail"""
_HEIGHT = 0.004
"""m above the floor at which trails are drawn"""


def send(
    stream: "RecordingStream",
    record: RunRecord,
    replicate: int,
    chosen: Sequence[Choice],
    trials: Mapping[int, Trial],
    model: Any,
) -> None:
    """Log robot, trails, wheel speeds and moments of the chosen trials.

    Args:
        stream: a `rerun.RecordingStream`.
        record: the batch.
        replicate: which of its runs.
        chosen: the trials to show, in this order.
        trials: densely sampled trials by number, where there are any.
        model: compiled scene.
    """
    start, states, colours = 0.0, [], []
    task = tasks.of(record.config)
    for choice in chosen:
        at = (replicate, choice.trial)
        times, poses, qpos = samples(record, at, trials.get(choice.trial), model)
        if not len(times):
            continue  # nothing was seen of it
        index = rrd.times(start + times)
        geometry.send_poses(stream, model, index, qpos)
        done = _finish(record, at, times)
        foreseen = listed(record.predicted[at])
        foreseen = foreseen[: task.finish(foreseen) + 1]
        _trails(stream, choice, poses, done, foreseen)
        if task.picture.wheels:
            _wheels(stream, record.sent[at], start)
        _readings(stream, record, at, start)
        states.append((start, f"trial {choice.trial}: {choice.label}"))
        colours.append(choice.colour)
        start += float(times[-1]) + GAP
    _states(stream, states, colours, start)


def duration(record: RunRecord, replicate: int, chosen: Sequence[Choice]) -> float:
    """How long the chosen trials take one after another, pauses included [s].

    Args:
        record: of the run.
        replicate: which of its runs.
        chosen: the trials.
    """
    numbers = [choice.trial for choice in chosen]
    told = tasks.of(record.config).durations(record, (replicate, numbers))
    return float(np.nansum(told)) + GAP * len(chosen)


def _durations(record: RunRecord, at: tuple[int, int], count: int) -> np.ndarray:
    """How long each of the first `count` commands took [s]."""
    return tasks.of(record.config).durations(record, at)[:count]


def samples(
    record: RunRecord, at: tuple[int, int], trial: Trial | None, model: Any
) -> Any:
    """Times, planar poses and qpos of one trial.

    Args:
        record: of the run.
        at: replicate and trial, an index of its arrays.
        trial: with all its samples; None = poses after commands, joined by arcs.
        model: MuJoCo's, of the robot.

    Returns:
        times from the trial's start ``(n,)`` [s], poses ``(n, 3)`` [m, m, rad], qpos
        ``(n, nq)``.
    """
    if trial is None:
        return _sparse(record, at, model)
    step = np.diff(trial.times, prepend=-np.inf)
    keep = np.flatnonzero(np.isfinite(trial.poses_world).all(axis=1) & (step > 0))
    keep = keep[_thin(trial.times[keep])]
    times, poses = trial.times[keep] - trial.times[:1], trial.poses_world[keep]
    if "qpos" in trial.truth:
        qpos = np.asarray(trial.truth["qpos"])[keep]
        if qpos.shape[1] == model.nq:
            return times, poses, qpos
    if reports_servos(trial):
        return times, poses, walking_qpos(model, poses, trial, keep)
    return times, poses, geometry.planar_qpos(model, poses)


def _sparse(record: RunRecord, at: tuple[int, int], model: Any) -> Any:
    poses = listed(record.poses[at])
    if not len(poses):
        return np.empty(0), poses, np.empty((0, model.nq))
    durations = _durations(record, at, len(poses) - 1)
    ends = np.concatenate([[0.0], np.cumsum(durations)])
    times = np.interp(
        np.arange((len(poses) - 1) * _ARC_SAMPLES + 1) / _ARC_SAMPLES,
        np.arange(len(poses)),
        ends,
    )
    poses = arcs(poses, _ARC_SAMPLES)
    return times, poses, geometry.planar_qpos(model, poses)


def _thin(times: np.ndarray) -> np.ndarray:
    """Indices of samples at most `RATE` a second, the last one included."""
    if not len(times):
        return np.empty(0, dtype=int)
    slot = np.floor((times - times[0]) * RATE + 1e-9)
    keep = np.diff(slot, prepend=-1.0) > 0
    keep[-1] = True
    return np.flatnonzero(keep)


def _lift(poses: np.ndarray) -> np.ndarray:
    return np.column_stack([poses[:, :2], np.full(len(poses), _HEIGHT)])


def _finish(record: RunRecord, at: tuple[int, int], times: np.ndarray) -> int:
    """Sample at which the task was done; the last one if it was not."""
    poses = listed(record.poses[at])
    done = tasks.of(record.config).finish(poses)
    ends = np.cumsum(_durations(record, at, len(poses) - 1))
    if not 0 < done < len(poses) - 1:
        return len(times) - 1
    return min(int(np.searchsorted(times, ends[done - 1])), len(times) - 1)


def _trails(
    stream: "RecordingStream",
    choice: Choice,
    poses: np.ndarray,
    done: int,
    predicted: np.ndarray,
) -> None:
    """Real and foreseen trail; the real one is thin after the last objective."""
    import rerun as rr

    colour = style.rgb(choice.colour)
    root = f"world/trails/trial_{choice.trial:03d}"
    strips = [_lift(poses[: done + 1]), _lift(poses[done:])]
    radii = [_TRAIL, _TRAIL / 4]
    stream.log(
        f"{root}/real",
        rr.LineStrips3D(strips, colors=[colour] * 2, radii=radii),
        static=True,
    )
    if len(predicted) < 2:
        return
    pieces = dashes(_lift(arcs(predicted, _ARC_SAMPLES)))
    stream.log(
        f"{root}/predicted",
        rr.LineStrips3D(pieces, colors=[colour], radii=_TRAIL / 2),
        static=True,
    )


def _wheels(stream: "RecordingStream", sent: np.ndarray, start: float) -> None:
    """Wheel speeds as sent, a step for each command and zero in the pause."""
    import rerun as rr

    sent = sent[np.isfinite(sent).all(axis=1)]
    begin = start + np.concatenate([[0.0], np.cumsum(sent[:, 2])])
    for column, wheel in enumerate(("left", "right")):
        values = np.append(sent[:, column], 0.0)
        stream.send_columns(
            f"wheels/{wheel}", rrd.times(begin), rr.Scalars.columns(scalars=values)
        )
        stream.log(
            f"wheels/{wheel}",
            rr.SeriesLines(
                names=wheel,
                colors=style.rgb((style.SKY, style.ORANGE)[column]),
                widths=(4.0, 1.5)[column],
                interpolation_mode=rr.components.InterpolationMode.StepAfter,
            ),
            static=True,
        )


def _readings(
    stream: "RecordingStream", record: RunRecord, at: tuple[int, int], start: float
) -> None:
    """Send what the sensors read in a trial, and what the SNNs foresaw."""
    import rerun as rr

    if "readings" not in record.extra:
        return
    ends = start + np.concatenate([[0.0], np.nancumsum(record.sent[at][:, 2])])
    for column, side in enumerate(("left", "right")):
        for kind, array, width in (
            ("real", "readings", 2.5),
            ("foreseen", "readings_predicted", 1.0),
        ):
            if array not in record.extra:
                continue
            path = f"{READINGS}/{side}_{kind}"
            values = record.extra[array][at][:, column]
            rrd.send(stream, path, ends, values)
            stream.log(
                path,
                rr.SeriesLines(
                    names=f"{side}, {kind}",
                    colors=style.rgb((style.SKY, style.ORANGE)[column]),
                    widths=width,
                ),
                static=True,
            )


def _states(stream: "RecordingStream", states: Any, colours: Any, end: float) -> None:
    """The lane that says which trial is on."""
    import rerun as rr

    names = [name for _, name in states]
    stream.log(
        "moment",
        rr.StateConfiguration(values=names, colors=[style.rgb(c) for c in colours]),
        static=True,
    )
    stream.send_columns(
        "moment",
        rrd.times(np.array([*(time for time, _ in states), end])),
        rr.StateChange.columns(state=[*names, ""]),
    )


def send_paths(
    stream: "RecordingStream",
    numbers: np.ndarray,
    real: np.ndarray,
    predicted: np.ndarray,
) -> None:
    """Send real and foreseen path of each of N trials, on the timeline `trial`.

    Args:
        stream: a `rerun.RecordingStream`.
        numbers: numbers of the trials.
        real: ``(N, K + 1, 3)`` poses, NaN beyond a list's end.
        predicted: the same as the SNN foresaw it.
    """
    import rerun as rr

    for name, poses, colour in (
        ("real", real, style.BLACK),
        ("predicted", predicted, style.PURPLE),
    ):
        paths = [(n, listed(rows)) for n, rows in zip(numbers, poses, strict=True)]
        paths = [(n, _lift(arcs(rows))) for n, rows in paths if len(rows) > 1]
        if not paths:
            continue
        stream.send_columns(
            f"world/each_trial/{name}",
            [rr.TimeColumn(TRIAL_TIMELINE, sequence=[n for n, _ in paths])],
            rr.LineStrips3D.columns(
                strips=[rows for _, rows in paths],
                colors=[style.rgb(colour)] * len(paths),
                radii=[_TRAIL * 0.6] * len(paths),
            ),
        )


def send_ends(
    stream: "RecordingStream", numbers: np.ndarray, poses: np.ndarray, model: Any
) -> None:
    """Send the robot where each trial left it, on the timeline `trial`.

    Args:
        stream: a `rerun.RecordingStream`.
        numbers: numbers of the trials.
        poses: ``(N, K + 1, 3)``, NaN beyond a list's end.
        model: compiled scene.
    """
    import rerun as rr

    ends = [(n, listed(rows)) for n, rows in zip(numbers, poses, strict=True)]
    ends = [(n, rows[-1]) for n, rows in ends if len(rows)]
    if ends:
        qpos = geometry.planar_qpos(model, np.stack([pose for _, pose in ends]))
        index = [rr.TimeColumn(TRIAL_TIMELINE, sequence=[n for n, _ in ends])]
        geometry.send_poses(stream, model, index, qpos)


SUFFIX = "_position"
"""of the channels that servos report"""


def reports_servos(trial: Trial) -> bool:
    """Whether the trial holds positions of servos."""
    return any(channel.name.endswith(SUFFIX) for channel in trial.channels)


def walking_qpos(
    model: Any, poses_world: np.ndarray, trial: Trial, rows: np.ndarray
) -> np.ndarray:
    """Configurations from tracked poses and servo positions.

    An overhead tracker sees neither height nor tilt: the body is drawn level, with its
    lowest foot on the floor.

    Args:
        model: a compiled `mujoco.MjModel`; its joints have the channels' names.
        poses_world: ``(T, 3)`` [m, m, rad].
        trial: with channels of servo positions.
        rows: samples of the trial that the poses are of, ``(T,)``.

    Returns:
        ``(T, nq)``.
    """
    made = geometry.planar_qpos(model, poses_world)
    for channel in trial.channels:
        if channel.name.endswith(SUFFIX):
            joint = model.joint(channel.name.removesuffix(SUFFIX))
            made[:, joint.qposadr[0]] = trial.channel(channel.name)[rows]
    made[:, geometry.free_joint(model) + 2] -= _lowest_foot(model, made)
    return made


def _lowest_foot(model: Any, qpos: np.ndarray) -> np.ndarray:
    """Height of the lowest foot site in each configuration, ``(T,)`` [m]."""
    import mujoco

    data = mujoco.MjData(model)
    feet = [i for i in range(model.nsite) if model.site(i).name.endswith("_foot")]
    lowest = np.zeros(len(qpos))
    for at, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        lowest[at] = data.site_xpos[feet, 2].min() if feet else 0.0
    return lowest
