"""How exact the overhead tracking is, on pictures of MuJoCo's own camera."""

import numpy as np

from bench.result import Result, bench

BARS = {720: (1.0, 1.0), 1080: (0.3, 0.3)}  # mm, deg
WRONG = 0.020  # m


@bench(
    "tracking of the robot's tag on rendered 720p and 1080p frames: position error",
    bar="median <= 1 mm, 1 deg at 720p; <= 0.3 mm, 0.3 deg at 1080p; height "
    "+20 mm found",
)
def tracking(quick: bool) -> Result:
    """Poses all over the board; the camera's place comes from the floor tags.

    The figure is the median position error at 1080p.
    """
    poses = 12 if quick else 100
    details, holds = {}, True
    for size in ((1280, 720), (1920, 1080)):
        row = _measure(size, poses)
        limits = BARS[size[1]]
        good = (
            row["position median mm"] <= limits[0]
            and row["heading median deg"] <= limits[1]
            and row["missed"] == 0
            and row["right height agrees"]
            and not row["height wrong by 20 mm agrees"]
        )
        details[f"{size[1]}p"] = row
        holds = holds and good
    figure = details["1080p"]["position median mm"]
    return Result(figure=figure, unit="mm", holds=holds, n=poses, details=details)


def _measure(size: tuple[int, int], count: int) -> dict:
    from bns.hardware.emulators.studio import Studio
    from bns.hardware.tracking import calibrate
    from bns.hardware.tracking.marker import Floor
    from bns.hardware.tracking.tracker import Frame, Tracker

    rng, floor = np.random.default_rng(7), Floor()
    studio = Studio(size, rng=rng)
    empty = studio.paint((0.0, 0.0, 0.0))
    camera = calibrate.place(empty, studio.camera, floor)
    tracker = Tracker(camera, studio.marker)
    errors, pairs = [], []
    for number in range(count):
        pose = rng.uniform([-1.15, -0.65, -3.1], [1.15, 0.65, 3.1])
        frame = Frame(float(number), studio.paint(pose), number)
        sighting = tracker.see(frame)
        if sighting is None:
            continue
        error = sighting.pose - pose
        error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
        errors.append(error)
        pairs.append((frame, sighting))
    row = _figures(np.array(errors), count)
    row |= _heights(pairs, camera, studio.marker, empty, floor)
    away = camera.position - studio.camera.position
    row["camera's place off mm"] = np.round(away * 1e3, 2).tolist()
    return row


def _figures(errors: np.ndarray, count: int) -> dict:
    apart = np.hypot(errors[:, 0], errors[:, 1]) * 1e3
    turned = np.degrees(np.abs(errors[:, 2]))
    return {
        "position median mm": round(float(np.median(apart)), 4),
        "position p95 mm": round(float(np.quantile(apart, 0.95)), 4),
        "heading median deg": round(float(np.median(turned)), 4),
        "heading p95 deg": round(float(np.quantile(turned, 0.95)), 4),
        "missed": count - len(errors),
    }


def _heights(pairs, camera, marker, image, floor) -> dict:
    """The height check with the right setting, and with one 20 mm off."""
    from dataclasses import replace

    from bns.hardware.tracking import calibrate
    from bns.hardware.tracking.tracker import Tracker

    right = calibrate.height(
        [s for _, s in pairs], camera, marker, image=image, floor=floor
    )
    lower = replace(marker, height=marker.height - WRONG)
    tracker = Tracker(camera, lower)
    seen = [tracker.see(frame) for frame, _ in pairs]
    sightings = [item for item in seen if item is not None]
    wrong = calibrate.height(sightings, camera, lower, image=image, floor=floor)
    return {
        "height found mm": round(right.height * 1e3, 2),
        "height true mm": round(marker.height * 1e3, 2),
        "right height agrees": right.agrees,
        "height wrong by 20 mm agrees": wrong.agrees,
    }
