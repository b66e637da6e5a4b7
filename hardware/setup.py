"""Calibrating a camera with what lies on the board."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from bns.errors import BnsError
from bns.hardware import rig as rigs
from bns.hardware.clock import RealClock
from bns.hardware.tracking import calibrate
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.eyes import ThreadedEyes
from bns.hardware.tracking.marker import MARKERS, Floor
from bns.hardware.tracking.opencv import cv2
from bns.hardware.tracking.sources import DeviceCamera, Source, VideoFile
from bns.hardware.tracking.tracker import Tracker

PICTURES = 40  # in which the tag's size is measured
ASKEW = 8.0  # deg that the tag's edges have to be off the rows of the picture
TIME = 20.0  # s for them


def lens(paths: Sequence[str]) -> calibrate.Lens:
    """The lens from picture files of the board of squares.

    Raises:
        BnsError: a file is no picture, or too few show the board.
    """
    views = []
    for path in paths:
        view = cv2().imread(path, cv2().IMREAD_GRAYSCALE)
        if view is None:
            raise BnsError(f"{path} is no picture that OpenCV can read.")
        views.append(view)
    return calibrate.lens(views, calibrate.squares())


def camera(
    port: str,
    name: str,
    known: str,
    found: calibrate.Lens | None,
    out: Path,
    *,
    robot: str = "khepera3",
) -> Iterator[str]:
    """Find the camera's place, write it, and say what was found, line by line.

    Args:
        port: of the emulated robot, where the camera is emulated.
        name: number of a camera, a video file, or "emulated".
        known: file of an earlier calibration, whose lens is taken.
        found: the lens, where it was calibrated now.
        out: file to write.
        robot: whose tag is looked for.

    Raises:
        BnsError: no lens, no camera, no floor tags.
    """
    marker = MARKERS[robot]
    source, base = _source(port, name, known, found, robot)
    frame = None
    clock = RealClock()
    until = clock.now() + TIME
    while frame is None and clock.now() < until:
        frame = source.read(1.0)
    if frame is None:
        raise BnsError("The camera gives no picture: check it.")
    placed = calibrate.place(frame.image, base, Floor())
    if found is not None:
        yield f"lens    {found.error:.2f} px left over"
    x, y, z = placed.position
    yield f"place   {x:.3f}, {y:.3f}, {z:.3f} m"
    placed.write(out)
    eyes = ThreadedEyes(source, Tracker(placed, marker))
    try:
        seen: list = []
        while len(seen) < PICTURES and clock.now() < until:
            seen += eyes.poll()
            clock.sleep(0.05)
    finally:
        eyes.close()
    if len(seen) < 5:
        yield "tag     not in view: its height was not checked"
        return
    if calibrate.askew(seen[-1], placed) < ASKEW:
        yield (
            "tag     its edges lie along the picture's rows, which blurs its size: "
            "turn the robot by 20 to 70 deg to have its height checked"
        )
        return
    height = calibrate.height(seen, placed, marker, image=frame.image, floor=Floor())
    said = (
        f"{height.height * 1e3:.1f} mm high by its size, {height.said * 1e3:.1f} said"
    )
    yield f"tag     {said}" + ("" if height.agrees else ": WRONG, measure it again")


def _source(
    port: str, name: str, known: str, found: calibrate.Lens | None, robot: str
) -> tuple[Source, Camera | calibrate.Lens]:
    if name == rigs.EMULATED:
        from bns.hardware.emulators.camera import EmulatedCamera
        from bns.hardware.emulators.frames import painter

        ideal = replace(Camera.overhead(rigs.SIZE))
        return EmulatedCamera(port, painter(robot, ideal)), ideal
    base = found or (Camera.read(known) if known else None)
    if base is None:
        raise BnsError(
            "The camera's lens is not known: give --views with pictures of the ChArUco "
            "board, or an earlier --calibration."
        )
    if name.isdecimal():
        return DeviceCamera(int(name), base.size), base
    return VideoFile(name), base
