"""What stands still in a recording: the floor, the robot's shapes, the objectives."""

import numpy as np

from bns.config import RunConfig
from bns.viz import geometry, style
from bns.viz.paths import reached

MARGIN = 0.25
"""m of board shown around the outermost objectives"""

_DISC = 0.001
"""m; height of an objective's disc"""


def compiled(robot: str):
    """The compiled scene of a robot: floor, light, robot; no objectives."""
    from bns import models

    return models.scene_spec(robot).compile()


def objectives(config: RunConfig) -> dict[str, tuple[float, float]]:
    """Positions of the objectives that the run's task uses [m]."""
    from bns.tasks import objectives as places

    used = order(config)
    return {name: at for name, at in places(config.task).items() if name in used}


def order(config: RunConfig) -> str:
    """Names of the objectives in the order in which they are to be reached."""
    from bns import tasks

    return tasks.order(config.task.name)


def finish(config: RunConfig, poses_world: np.ndarray) -> int:
    """Row of `poses_world` at which the task was done; the last one if it was not."""
    places = objectives(config)
    goals = np.array([places[name] for name in order(config)])
    rows = reached(poses_world, goals, config.task.radius)
    return rows[-1] if len(rows) == len(goals) else len(poses_world) - 1


def extent(config: RunConfig) -> tuple[float, float]:
    """Half width and half depth of what matters [m]."""
    places = np.abs(list(objectives(config).values()))
    return tuple(float(edge) for edge in places.max(axis=0) + MARGIN)


def log_static(stream, config: RunConfig, model) -> None:
    """Log coordinates, shapes and objectives.

    Args:
        stream: a `rerun.RecordingStream`.
        config: whose task's objectives are shown.
        model: a compiled `mujoco.MjModel`.
    """
    import rerun as rr

    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    geometry.log_static(stream, model)
    places, radius = objectives(config), config.task.radius
    names = list(places)
    centres = np.array([(*places[name], _DISC / 2) for name in names])
    count = len(names)
    stream.log(
        "world/objectives",
        rr.Cylinders3D(
            centers=centres,
            radii=[radius] * count,
            lengths=[_DISC] * count,
            colors=[(*style.rgb(style.YELLOW), 255)] * count,
            fill_mode=rr.components.FillMode.Solid,
        ),
        static=True,
    )
    stream.log(
        "world/objectives/names",
        rr.Points3D(
            centres + np.array([0, 0, 0.01]),
            labels=names,
            radii=0.006,
            colors=[style.rgb(style.BLACK)] * count,
            show_labels=True,
        ),
        static=True,
    )
