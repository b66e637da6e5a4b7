"""`bns models view`: a robot model on the screen or in a picture."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from bns.cli.parse import parse
from bns.errors import BnsError, UnknownNameError

VERBS = ("view",)
MANUAL = """usage: bns models view ROBOT [--png FILE]

  view  open a robot model in MuJoCo's viewer, or draw it to a file

`bns robots` lists the robots; `bns models view --help` is the manual."""


@dataclass(frozen=True, kw_only=True)
class View:
    """Open a robot model in MuJoCo's viewer, or draw it to a file."""

    robot: tyro.conf.Positional[str]
    """name of the robot, see `bns robots`"""
    png: str = ""
    """write a picture to this file instead; needs no display"""
    width: int = 960
    """of the picture [px]"""
    height: int = 640
    """of the picture [px]"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb on robot models; gives the exit code.

    Raises:
        BnsError: what the user gave cannot be used.
    """
    del verb
    if not argv or argv[0] in ("-h", "--help"):
        print(MANUAL)
        raise SystemExit(0)
    if argv[0] not in VERBS:
        raise UnknownNameError("verb of `bns models`", argv[0], VERBS)
    given = parse(View, argv[1:], prog="bns models view")
    return draw(given) if given.png else show(given.robot)


def draw(given: View) -> int:
    """Write the picture.

    Raises:
        UnknownNameError: no such robot.
        BnsError: the file or its size cannot be.
    """
    from bns import models
    from bns.models import render

    robot, file = models.robot(given.robot), Path(given.png)
    if file.suffix.lower() != ".png":
        raise BnsError(f"--png {given.png} is no PNG: give a name that ends in .png.")
    if not file.parent.is_dir():
        raise BnsError(f"There is no directory {file.parent} for {file.name}: make it.")
    if not (16 <= given.width <= 8192 and 16 <= given.height <= 8192):
        raise BnsError(
            f"A picture of {given.width} x {given.height} px is not possible: give 16 "
            "to 8192 each."
        )
    size = (given.width, given.height)
    render.picture(models.spec(robot.name), file, camera=robot.picture, size=size)
    print(given.png)
    return 0


def show(name: str) -> int:
    """Open MuJoCo's viewer and wait until it is closed.

    Raises:
        UnknownNameError: no such robot.
        BnsError: there is no display.
    """
    from bns import models

    spec = models.spec(name)
    if sys.platform == "linux" and not any(
        os.environ.get(item) for item in ("DISPLAY", "WAYLAND_DISPLAY")
    ):
        raise BnsError(f"No display to open {name} on: make a picture with --png FILE.")
    import mujoco
    from mujoco import viewer

    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    viewer.launch(model, data)
    return 0
