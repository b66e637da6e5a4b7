"""What stands still in a recording: the floor, the robot's shapes, the objectives."""

from typing import TYPE_CHECKING, Any

import numpy as np

from bns.experiment.config import RunConfig
from bns.tasks import Picture
from bns.tasks import registry as tasks
from bns.viz import geometry, style

if TYPE_CHECKING:
    from rerun import RecordingStream


_DISC = 0.001
"""m; height of an objective's disc"""

_BULB = 0.03
"""m; radius of a lamp as drawn"""

_POST = 0.006
"""m; radius of the post it stands on, drawn only"""


def compiled(robot: str) -> Any:
    """The compiled scene of a robot: floor, light, robot; no objectives."""
    from bns import models

    return models.scene_spec(robot).compile()


def picture(config: RunConfig) -> Picture:
    """What is shown of a configuration's task."""
    return tasks.of(config).picture


def log_static(stream: "RecordingStream", config: RunConfig, model: Any) -> None:
    """Log coordinates, shapes and objectives.

    Args:
        stream: a `rerun.RecordingStream`.
        config: whose task's objectives are shown.
        model: a compiled `mujoco.MjModel`.
    """
    import rerun as rr

    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    geometry.log_static(stream, model)
    shown = picture(config)
    if shown.lamps:
        _log_lamps(stream, shown)
    places, names = shown.objectives, list(shown.objectives)
    centres = np.array([(*places[name], _DISC / 2) for name in names])
    count = len(names)
    stream.log(
        "world/objectives",
        rr.Cylinders3D(
            centers=centres,
            radii=[shown.radius] * count,
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


def _log_lamps(stream: "RecordingStream", shown: Picture) -> None:
    """Log the lamps, and the safety boundary around each on the floor."""
    import rerun as rr

    from bns.worlds.light.law import Lamp

    places = np.array([Lamp(**fields).position for fields in shown.lamps])
    count, colour = len(places), (*style.rgb(style.YELLOW), 255)
    stream.log(
        "world/lamps",
        rr.Ellipsoids3D(
            centers=places,
            radii=[_BULB] * count,
            colors=[colour] * count,
            fill_mode=rr.components.FillMode.Solid,
        ),
        static=True,
    )
    posts = [[(x, y, 0.0), (x, y, z)] for x, y, z in places]
    stream.log(
        "world/lamps/posts",
        rr.LineStrips3D(posts, colors=[style.rgb(style.GREY)] * count, radii=_POST),
        static=True,
    )
    angle = np.linspace(0.0, 2 * np.pi, 73)
    ring = shown.ring * np.column_stack([np.cos(angle), np.sin(angle)])
    rings = [
        np.column_stack([ring + place[:2], np.full(len(ring), 0.002)])
        for place in places
    ]
    stream.log(
        "world/lamps/safety_boundary",
        rr.LineStrips3D(rings, colors=[style.rgb(style.ORANGE)] * count, radii=0.003),
        static=True,
    )
