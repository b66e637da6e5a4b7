"""The 3D part of a diagnosis's recording: three robots side by side, paths, arrows."""

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.viz import geometry, rrd, scene, style
from bns.viz.blueprint import LIVE_TIMELINE
from bns.viz.gap.figures import NOMINAL
from bns.viz.gap.view import View

if TYPE_CHECKING:
    from rerun import RecordingStream


HEIGHT = 0.005  # [m] above the floor at which paths are drawn
ENLARGED = 5.0  # arrows
ARROWS = 0.5  # share of the strongest residual below which there is no arrow
LOUD = 10.0  # loss at which the path is fully red; 1 = the floor
TRAIL = 0.003  # [m] half the width of a path
GAP = 0.05  # [m] between robots side by side, beyond their own size
LANES = {"nominal": -1.0, "recorded": 0.0, "corrected": 1.0}
GREY = (90, 90, 90)
QUIET, HOT = np.array([120.0, 120.0, 120.0]), np.array([230.0, 40.0, 20.0])


def planar(seen: View) -> bool:
    """Whether the robot is one of ours that drives in the plane."""
    from bns import models

    names = [channel.name for channel in seen.trials[0].channels]
    return names[:3] == ["x", "y", "yaw"] and models.known(seen.problem.model.name)


@lru_cache(maxsize=8)
def _ghost(robot: str, colour: str) -> Any:
    """The robot alone, all in one colour."""
    from bns import models

    spec = models.spec(robot, scene=False)
    for geom in spec.geoms:
        geom.material = ""
        geom.rgba = [*(value / 255 for value in style.rgb(colour)), 1.0]
    return spec.compile()


def _robots(seen: View) -> dict[str, tuple]:
    """Compiled scene and colour of each robot that is shown, by name."""
    robot = seen.problem.model.name
    shown = {
        "recorded": (scene.compiled(robot), "#f2f2f2"),
        "nominal": (_ghost(robot, NOMINAL), NOMINAL),
    }
    if seen.effects:
        shown["corrected"] = (_ghost(robot, style.SKY), style.SKY)
    return shown


@lru_cache(maxsize=8)
def _reach(robot: str) -> float:
    """Half the width of a robot as its model begins, all turned about [m]."""
    import mujoco

    model = _ghost(robot, NOMINAL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = data.xpos[1, :2]
    away = np.linalg.norm(data.geom_xpos[:, :2] - root, axis=1)
    return float((away + model.geom_rbound).max())


def _driven(seen: View) -> np.ndarray:
    """Lowest and highest place along x and y that robots touched, ``(2, 2)`` [m]."""
    margin = _reach(seen.problem.model.name) + GAP / 2
    paths = [*(trial.poses_world for trial in seen.trials), *seen.nominal]
    places = np.concatenate([path[:, :2] for path in paths])
    places = places[np.isfinite(places).all(axis=1)]
    return np.array([places.min(axis=0) - margin, places.max(axis=0) + margin])


def _lane(seen: View, name: str) -> np.ndarray:
    """Where a robot's lane begins, beside the others, ``(3,)`` [m]."""
    low, high = _driven(seen)
    return np.array([LANES[name] * (high - low)[0], 0.0, 0.0])


def log_static(stream: "RecordingStream", seen: View) -> None:
    """Log coordinates, shapes and names."""
    import rerun as rr

    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    low, high = _driven(seen)
    for name, (model, _) in _robots(seen).items():
        geometry.log_static(stream, model, f"world/{name}")
        beside = np.array([(low[0] + high[0]) / 2, low[1] + GAP, HEIGHT])
        place = _lane(seen, name) + beside
        stream.log(
            f"world/names/{name}",
            rr.Points3D(
                [place], labels=[name], radii=0.002, show_labels=True, colors=[GREY]
            ),
            static=True,
        )


def send(stream: "RecordingStream", seen: View, number: int, start: float) -> None:
    """Log one trial: robots in motion, paths, arrows; they vanish after it.

    Args:
        stream: Rerun's recording stream.
        seen: the recording beside its predictions.
        number: of the trial, counted from 0.
        start: of the trial on the time line [s].
    """
    import rerun as rr

    trial = seen.trials[number]
    at = start + trial.times - trial.times[0]
    poses = {"recorded": trial.poses_world, "nominal": seen.nominal[number]}
    if seen.effects:
        poses["corrected"] = seen.corrected[number]
    for name, (model, colour) in _robots(seen).items():
        rows = poses[name][:, :3]
        fine = np.isfinite(rows).all(axis=1)
        lane = _lane(seen, name)
        qpos = geometry.planar_qpos(model, rows[fine] + lane)
        geometry.send_poses(
            stream, model, rrd.times(at[fine]), qpos, root=f"world/{name}"
        )
        if name != "recorded":
            stream.send_columns(
                f"world/paths/{name}",
                rrd.times(at[:1]),
                rr.LineStrips3D.columns(
                    strips=[_lift(rows[fine] + lane)],
                    colors=[style.rgb(colour)],
                    radii=[TRAIL],
                ),
            )
            real = trial.poses_world
            real = real[np.isfinite(real).all(axis=1)]
            stream.send_columns(
                f"world/paths/recorded_beside_{name}",
                rrd.times(at[:1]),
                rr.LineStrips3D.columns(
                    strips=[_lift(real + lane)], colors=[GREY], radii=[TRAIL / 2]
                ),
            )
    _hurts(stream, seen, number, start)


def _hurts(stream: "RecordingStream", seen: View, number: int, start: float) -> None:
    """The recorded path, red where the nominal model fails, with arrows."""
    import rerun as rr

    trial, windows = seen.trials[number], seen.problem.windows[number]
    poses = trial.poses_world
    energy = seen.energy(number)
    share = np.clip(np.log(np.maximum(energy, 1.0)) / np.log(LOUD), 0, 1)[:, None]
    colours = (QUIET + share * (HOT - QUIET)).astype(int)
    stream.set_time(LIVE_TIMELINE, duration=start)
    strips = [
        _lift(poses[[a, b]]) for a, b in zip(windows.first, windows.last, strict=True)
    ]
    stream.log(
        "world/paths/recorded", rr.LineStrips3D(strips, colors=colours, radii=TRAIL)
    )
    yaw = poses[windows.first, 2]
    gap = seen.gap(number)
    step = np.column_stack(
        [
            np.cos(yaw) * gap[:, 0] - np.sin(yaw) * gap[:, 1],
            np.sin(yaw) * gap[:, 0] + np.cos(yaw) * gap[:, 1],
            np.zeros(len(gap)),
        ]
    )
    size = np.linalg.norm(step, axis=1)
    large = size > ARROWS * size.max(initial=0.0)
    stream.log(
        "world/paths/arrows",
        rr.Arrows3D(
            origins=_lift(poses[windows.last])[large] + [0, 0, 0.002],
            vectors=-ENLARGED * step[large],
            colors=[style.rgb(style.BLACK)] * int(large.sum()),
            radii=TRAIL / 3,
        ),
    )


def _lift(poses: np.ndarray) -> np.ndarray:
    return np.column_stack([poses[:, :2], np.full(len(poses), HEIGHT)])


def view_3d(seen: View, background: Any) -> Any:
    """The 3D view, its camera set so that all that was driven is seen."""
    import rerun.blueprint as rrb

    low, high = _driven(seen)
    lanes = 3 if seen.effects else 2
    half = (high - low) / 2 * [lanes, 1]
    centre = (low + high) / 2
    if lanes == 2:
        centre = centre - [half[0] / 2, 0.0]
    away = max(half[0], 1.4 * half[1])
    return rrb.Spatial3DView(
        origin="/world",
        name="Nominal, recorded and corrected robot on the same commands",
        background=list(background),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(centre[0], centre[1] - 0.9 * away, 1.4 * away),
            look_target=(centre[0], centre[1] - 0.05, 0.0),
            eye_up=(0, 0, 1),
        ),
    )
