"""What a recording of light following shows beside the rest: lamps and readings."""

import numpy as np

from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.viz import series, style
from bns.viz.blueprint import READINGS

_BULB = 0.03
"""m; radius of a lamp as drawn"""

_POST = 0.006
"""m; radius of the post it stands on, drawn only"""


def log_lamps(stream, config: RunConfig) -> None:
    """Log the lamps, and the safety boundary around each on the floor.

    Args:
        stream: a `rerun.RecordingStream`.
        config: of a run of light following.
    """
    import rerun as rr

    from bns.light.task import lamps
    from bns.worlds.light.field import Lamp

    places = np.array([Lamp(**fields).position for fields in lamps(config.light)])
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
    ring = config.light.safety * np.column_stack([np.cos(angle), np.sin(angle)])
    rings = [
        np.column_stack([ring + place[:2], np.full(len(ring), 0.002)])
        for place in places
    ]
    stream.log(
        "world/lamps/safety_boundary",
        rr.LineStrips3D(rings, colors=[style.rgb(style.ORANGE)] * count, radii=0.003),
        static=True,
    )


def send_readings(stream, record: RunRecord, at: tuple[int, int], start: float) -> None:
    """Send what the sensors read in a trial, and what the SNNs foresaw.

    Args:
        stream: a `rerun.RecordingStream`.
        record: the batch; nothing is sent where it has no readings.
        at: replicate and trial.
        start: when the trial begins on the timeline [s].
    """
    import rerun as rr

    if "readings" not in record.extra:
        return
    ends = start + np.concatenate([[0.0], np.nancumsum(record.sent[at][:, 2])])
    for column, side in enumerate(("left", "right")):
        for kind, array, width in (
            ("real", "readings", 2.5),
            ("foreseen", "readings_predicted", 1.0),
        ):
            path = f"{READINGS}/{side}_{kind}"
            values = record.extra[array][at][:, column]
            series.send(stream, path, ends, values)
            stream.log(
                path,
                rr.SeriesLines(
                    names=f"{side}, {kind}",
                    colors=style.rgb((style.SKY, style.ORANGE)[column]),
                    widths=width,
                ),
                static=True,
            )
