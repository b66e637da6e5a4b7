"""`bns models`: a robot model begun, checked, on the screen or in a picture."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from bns.cli.fields import Flat, Positional
from bns.cli.parse import Verbs, dispatch
from bns.errors import BnsError
from bns.models import legged_files
from bns.models.new import Wheeled, write
from bns.models.new_legged import Legged

MANUAL = """usage: bns models view ROBOT [--png FILE]
       bns models check ROBOT
       bns models new DIRECTORY --wheel-radius M --axle-length M --mass KG ...
       bns models new-legged DIRECTORY --legs 4 --mass KG --body-length M ...

  view        open a robot model in MuJoCo's viewer, or draw it to a file
  check       see whether a robot's directory is what worlds and learner need
  new         make the directory of a robot with two wheels from its numbers
  new-legged  make the directory of a robot that walks on four or six legs

ROBOT is a name that `bns robots` lists, or a directory of your own that holds a
robot.toml (docs/your_robot.md). `bns models VERB --help` is the manual of each."""


@dataclass(frozen=True, kw_only=True)
class View:
    """Open a robot model in MuJoCo's viewer, or draw it to a file."""

    robot: Positional[str]
    """name of the robot, see `bns robots`, or its directory"""
    png: str = ""
    """write a picture to this file instead; needs no display"""
    width: int = 960
    """of the picture [px]"""
    height: int = 640
    """of the picture [px]"""


@dataclass(frozen=True, kw_only=True)
class Check:
    """See whether a robot's directory is what worlds and learner need."""

    robot: Positional[str]
    """name of the robot, see `bns robots`, or its directory"""


@dataclass(frozen=True, kw_only=True)
class New:
    """Make the directory of a robot with two driven wheels from a handful of its
    numbers: a box on two wheels and a ball, that drives, can be damaged, learns and is
    diagnosed at once. numbers.toml lists what was assumed.
    """

    directory: Positional[str]
    """to be made; its name is the robot's"""
    robot: Flat[Wheeled]


@dataclass(frozen=True, kw_only=True)
class NewLegged:
    """Make the directory of a robot that walks from a handful of its numbers: a box on
    four or six legs of two or three servos each, that learns to walk, can be damaged
    and is diagnosed at once. numbers.toml lists what was assumed.
    """

    directory: Positional[str]
    """to be made; its name is the robot's"""
    robot: Flat[Legged]


def main(verb: str, argv: list[str]) -> int:
    """Run a verb on robot models; gives the exit code.

    Raises:
        BnsError: what the user gave cannot be used.
    """
    does: Verbs = {
        "view": (View, view),
        "check": (Check, check),
        "new": (New, new),
        "new-legged": (NewLegged, new_legged),
    }
    return dispatch(verb, argv, does, MANUAL)


def view(given: View) -> int:
    """Draw the robot, or show it.

    Raises:
        UnknownNameError: no such robot.
        BnsError: the file or its size cannot be; there is no display.
    """
    return draw(given) if given.png else show(given.robot)


def check(given: Check) -> int:
    """Print each point with what is wrong; 2 if anything is.

    Raises:
        UnknownNameError: no such robot.
        FormatError: its `robot.toml` or `law.toml` cannot be read.
        BnsError: servos that the world cannot have.
    """
    from bns import models
    from bns.models import check as points
    from bns.worlds.physics import servo_law

    robot = models.robot(given.robot)
    servo_law.law_of(robot)
    done = points.check(robot)
    for point in done:
        print(f"  {'fault' if point.faults else 'ok   '}  {point.says}")
        for fault in point.faults:
            print(f"           {fault}")
    wrong = sum(bool(point.faults) for point in done)
    left = 2 + len(points.points_of(robot)) - len(done)
    rest = f", {left} not looked at because of that" if left else ""
    print(f"{len(done) - wrong} of {len(done)} points hold{rest}.")
    return 2 if wrong else 0


def new(given: New) -> int:
    """Write the directory, then check it; 2 if it is not what is needed.

    Raises:
        BnsError: numbers or a name that no robot can have; a directory that is there.
    """
    place = given.directory
    write(Path(place), given.robot)
    preset = "khepera-light" if given.robot.light_sensors else "khepera-simple"
    return _told(place, f"{preset} --world.robot {place}", "a Khepera III")


def new_legged(given: NewLegged) -> int:
    """Write the directory, then check it; 2 if it is not what is needed.

    Raises:
        BnsError: numbers or a name that no robot can have; a directory that is there; a
            robot that does not stand; servos that the world cannot have.
        FormatError: a file of servos that is not as it should be.
    """
    from bns.worlds.physics import servo_law

    place = given.directory
    servo_law.own(legged_files.law(given.robot))
    legged_files.write(Path(place), given.robot)
    run = f"hexapod-walk --world.robot {place} --damage leg_raised:legs=2@100"
    return _told(place, run, "a PhantomX")


def _told(place: str, run: str, usual: str) -> int:
    """Check a robot that was made, and say what to do with it; 2 if it has faults."""
    code = check(Check(robot=place))
    print(f"{place} is made. What is assumed stands in {Path(place) / 'numbers.toml'}.")
    name = Path(place).name
    print(f"  bns models view {place} --png {name}.png")
    print(f"  bns run {run} --out runs/{name}")
    print(f"Presets are made for {usual}: docs/your_robot.md says what to look at.")
    return code


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
    render.picture(models.spec(given.robot), file, camera=robot.picture, size=size)
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
