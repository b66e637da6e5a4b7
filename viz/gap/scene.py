"""The 3D part of a diagnosis's recording: three robots side by side, paths, arrows."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.viz import geometry, rrd, style
from bns.viz.gap.figures import NOMINAL, View
from bns.viz.rrd import LIVE_TIMELINE

if TYPE_CHECKING:
    from rerun import RecordingStream


HEIGHT = 0.005  # [m] above the floor at which paths are drawn
ARROWS = 0.5  # share of the strongest residual below which there is no arrow
MOST = 24  # arrows of a trial
LOUD = 10.0  # loss at which the path is fully red; 1 = the floor
TRAIL, THIN = -1.75, -0.75  # half the width of a path, in points of the screen
GAP = 0.05  # [m] between robots side by side, beyond their own size
LANES = {"nominal": -1.0, "recorded": 0.0, "corrected": 1.0}
SEEN = 1 / 14  # of all that is shown, at which a robot is large enough to be seen
LARGEST = 4  # times its size at which a robot is drawn at most
GROUND = (235, 235, 230)
QUIET, HOT = np.array([25, 25, 25]), np.array([230, 40, 20])


def planar(seen: View) -> bool:
    """Whether the robot is one of ours that drives in the plane."""
    from bns import models

    names = [channel.name for channel in seen.trials[0].channels]
    return names[:3] == ["x", "y", "yaw"] and models.known(seen.problem.model.name)


@lru_cache(maxsize=8)
def _alone(robot: str, colour: str) -> Any:
    """The robot without its surroundings, all in one colour; "" = in its own."""
    from bns import models

    spec = models.spec(robot, scene=False)
    for geom in spec.geoms if colour else ():
        geom.material = ""
        geom.rgba = [*(value / 255 for value in style.rgb(colour)), 1.0]
    return spec.compile()


def _robots(seen: View) -> dict[str, tuple]:
    """Compiled model and colour of the name of each robot that is shown, by name."""
    robot = seen.problem.model.name
    shown = {
        "recorded": (_alone(robot, ""), "#ffffff"),
        "nominal": (_alone(robot, NOMINAL), NOMINAL),
    }
    if seen.effects:
        shown["corrected"] = (_alone(robot, style.SKY), style.SKY)
    return shown


@lru_cache(maxsize=8)
def _reach(robot: str) -> float:
    """Half the width of a robot as its model begins, all turned about [m]."""
    import mujoco

    model = _alone(robot, NOMINAL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = data.xpos[1, :2]
    away = np.linalg.norm(data.geom_xpos[:, :2] - root, axis=1)
    return float((away + model.geom_rbound).max())


class Stage:
    """Where the robots are drawn, side by side, and how large.

    Attributes:
        names: of the robots.
        low, high: lowest and highest place along x and y of one lane, ``(2,)`` [m].
        times: how many times its size a robot is drawn: it would be a dot otherwise
            where it drove far.
        longer: how many times its length an arrow is drawn.
    """

    def __init__(self, seen: View, chosen: Sequence[int]) -> None:
        """Measure what is shown.

        Args:
            seen: the recording beside its predictions.
            chosen: numbers of the trials that are shown.
        """
        self.names = list(_robots(seen))
        every = [[seen.trials[n].poses_world, seen.nominal[n]] for n in chosen]
        if seen.effects:
            every.append([seen.corrected[n] for n in chosen])
        places = np.concatenate([path[:, :2] for paths in every for path in paths])
        places = places[np.isfinite(places).all(axis=1)]
        low, high = places.min(axis=0), places.max(axis=0)
        reach = _reach(seen.problem.model.name)
        whole = max((high - low) * [len(self.names), 1])
        self.times = int(np.clip(round(SEEN * whole / (2 * reach)), 1, LARGEST))
        steps = np.concatenate([seen.gap(n)[:, :2] for n in chosen])
        most = np.nanmax(np.linalg.norm(steps, axis=1), initial=1e-9)
        self.longer = float(f"{max(SEEN * whole / most, 1.0):.0e}")
        margin = self.times * reach + GAP / 2
        self.low, self.high = low - margin, high + margin

    def lane(self, name: str) -> np.ndarray:
        """Where a robot's lane begins, beside the others, ``(3,)`` [m]."""
        return np.array([LANES[name] * (self.high - self.low)[0], 0.0, 0.0])

    @property
    def half(self) -> np.ndarray:
        """Half the width and depth of all lanes, ``(2,)`` [m]."""
        return (self.high - self.low) / 2 * [len(self.names), 1]

    @property
    def centre(self) -> np.ndarray:
        """The middle of all lanes, ``(2,)`` [m]."""
        lanes = [self.lane(name)[0] for name in self.names]
        return (self.low + self.high) / 2 + [np.mean([min(lanes), max(lanes)]), 0.0]


def log_static(stream: "RecordingStream", seen: View, stage: Stage) -> None:
    """Log coordinates, the ground, shapes and names.

    Args:
        stream: Rerun's recording stream.
        seen: the recording beside its predictions.
        stage: where the robots are drawn.
    """
    import rerun as rr

    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log(
        "world/ground",
        rr.Boxes3D(
            centers=[(*stage.centre, -HEIGHT)],
            half_sizes=[(*stage.half, HEIGHT)],
            colors=[GROUND],
            fill_mode=rr.components.FillMode.Solid,
        ),
        static=True,
    )
    for name, (model, colour) in _robots(seen).items():
        root = f"world/{name}"
        geometry.log_static(stream, model, root)
        stream.log(root, rr.Transform3D(scale=stage.times), static=True)
        middle = (stage.low[0] + stage.high[0]) / 2
        place = stage.lane(name) + np.array([middle, stage.low[1], 0.0])
        stream.log(
            f"world/names/{name}",
            rr.Points3D(
                [place],
                labels=[name],
                radii=THIN,
                show_labels=True,
                colors=[style.rgb(colour)],
            ),
            static=True,
        )


def send(
    stream: "RecordingStream", seen: View, stage: Stage, number: int, start: float
) -> None:
    """Log one trial: robots in motion, paths, arrows; they vanish after it.

    Args:
        stream: Rerun's recording stream.
        seen: the recording beside its predictions.
        stage: where the robots are drawn.
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
        lane = stage.lane(name)
        small = [stage.times, stage.times, 1.0]  # the root of a robot is enlarged
        qpos = geometry.planar_qpos(model, (rows[fine] + lane) / small)
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
                    strips=[_lift(real + lane)], colors=[QUIET], radii=[THIN]
                ),
            )
    _hurts(stream, seen, stage, number, start)


def _hurts(
    stream: "RecordingStream", seen: View, stage: Stage, number: int, start: float
) -> None:
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
    large = np.flatnonzero(size > ARROWS * size.max(initial=0.0))
    large = large[:: max(1, -(-len(large) // MOST))]
    stream.log(
        "world/paths/arrows",
        rr.Arrows3D(
            origins=_lift(poses[windows.last])[large] + [0, 0, 0.002],
            vectors=-stage.longer * step[large],
            colors=[style.rgb(style.PURPLE)] * len(large),
            radii=TRAIL,
        ),
    )


def _lift(poses: np.ndarray) -> np.ndarray:
    return np.column_stack([poses[:, :2], np.full(len(poses), HEIGHT)])


def view_3d(stage: Stage, background: Any) -> Any:
    """The 3D view, its camera set so that all that was driven is seen."""
    import rerun.blueprint as rrb

    half, centre = stage.half, stage.centre
    away = max(half[0], 1.15 * half[1])
    larger = f", drawn {stage.times} times their size" if stage.times > 1 else ""
    return rrb.Spatial3DView(
        origin="/world",
        name=f"Robots on the same commands{larger}",
        background=list(background),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(centre[0], centre[1] - 0.55 * away, 1.75 * away),
            look_target=(*centre, 0.0),
            eye_up=(0, 0, 1),
        ),
    )
