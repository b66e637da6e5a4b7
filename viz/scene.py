"""What stands still in a recording: the floor, the robot's shapes, the objectives."""

import numpy as np

from bns.experiment.config import RunConfig
from bns.viz import geometry, light_view, style
from bns.viz.paths import reached

MARGIN = 0.25
"""m of board shown around the outermost objectives"""

BOARD = (1.35, 0.9)
"""m; half the arena's board (thesis 4.2.1)"""

LIGHT = "light following"
WALK = "walking"
ADEQUATE = ""

_DISC = 0.001
"""m; height of an objective's disc"""


def compiled(robot: str):
    """The compiled scene of a robot: floor, light, robot; no objectives."""
    from bns import models

    return models.scene_spec(robot).compile()


def task(config: RunConfig) -> str:
    """What the robot has to do, in a word or two."""
    if walks(config):
        return WALK
    return LIGHT if follows_light(config) else config.task.name


def meaning(config: RunConfig) -> str:
    """What it means to have solved it."""
    if walks(config):
        return f"{config.walk.adequate:g} m walked"
    return "the lamp circled" if follows_light(config) else "all objectives reached"


def follows_light(config: RunConfig) -> bool:
    """Whether the run is one of closed-loop light following."""
    return config.learner == "light"


def walks(config: RunConfig) -> bool:
    """Whether the run is one of a walking robot."""
    return config.learner == "walk"


def radius(config: RunConfig) -> float:
    """Radius of an objective's disc, at which to circle the lamp, or to leave [m]."""
    if walks(config):
        return config.walk.adequate
    return config.light.goal if follows_light(config) else config.task.radius


def objectives(config: RunConfig) -> dict[str, tuple[float, float]]:
    """Positions of the objectives that the run's task uses [m]."""
    from bns.tasks import objectives as places

    if walks(config):
        return {ADEQUATE: (0.0, 0.0)}
    if follows_light(config):
        from bns.light.task import LightTask

        return {"lamp": LightTask.of(config.light).lamp}

    used = order(config)
    return {name: at for name, at in places(config.task).items() if name in used}


def order(config: RunConfig) -> tuple[str, ...]:
    """Names of the objectives in the order in which they are to be reached."""
    from bns import tasks

    if walks(config):
        return (ADEQUATE,)
    return ("lamp",) if follows_light(config) else tuple(tasks.order(config.task.name))


def finish(config: RunConfig, poses_world: np.ndarray) -> int:
    """Row of `poses_world` at which the task was done; the last one if it was not.

    A robot that has found the lamp stays there, and one that walks goes as far as it
    can, so their tasks end with the trial.
    """
    if follows_light(config) or walks(config):
        return len(poses_world) - 1
    places = objectives(config)
    goals = np.array([places[name] for name in order(config)])
    rows = reached(poses_world, goals, config.task.radius)
    return rows[-1] if len(rows) == len(goals) else len(poses_world) - 1


def extent(config: RunConfig) -> tuple[float, float]:
    """Half width and half depth of what matters [m]."""
    if follows_light(config) or walks(config):
        return BOARD
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
    if follows_light(config):
        light_view.log_lamps(stream, config)
    places = objectives(config)
    names = list(places)
    centres = np.array([(*places[name], _DISC / 2) for name in names])
    count = len(names)
    stream.log(
        "world/objectives",
        rr.Cylinders3D(
            centers=centres,
            radii=[radius(config)] * count,
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
