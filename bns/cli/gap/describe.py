"""`bns gap describe`: a robot of one's own described, from its MJCF and a log."""

import math
from dataclasses import dataclass

from bns.cli.fields import Positional
from bns.cli.parse import parse


@dataclass(frozen=True, kw_only=True)
class Describe:
    """Write the description of a robot of your own (docs/gap_your_robot.md) from its
    MJCF and a log: which column is which actuator and joint, units, noise, start.
    Prints what was guessed and what had better be looked at. Then:
    bns gap diagnose LOG --model OUT
    """

    model: Positional[str]
    """MJCF or URDF file of the robot; a URDF has no motors: give --kp and --kd"""
    log: Positional[str]
    """CSV, PACE (.pt) or MCAP file, or directory of a rosbag2, SAGE motion or
    LeRobotDataset"""
    out: str = ""
    """file for the description; default: MODEL.toml in the working directory"""
    kp: tuple[float, ...] = ()
    """gain of the position loop that the robot has and its MJCF has not [N m/rad]: one
    for all commands, or one for each in the order of the log"""
    kd: tuple[float, ...] = ()
    """its damping [N m s/rad], the same"""
    torque: tuple[float, ...] = ()
    """its largest torque [N m], the same; default: that of the MJCF's motors"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    from bns.gap.describe import describe, place

    given = parse(Describe, argv, prog=f"bns gap {verb}")
    found = describe(
        given.model,
        given.log,
        out=given.out,
        kp=given.kp or 0.0,
        kd=given.kd or 0.0,
        torque=given.torque or math.inf,
    )
    for title, lines in (("guessed", found.guessed), ("unsure", found.unsure)):
        for line in lines:
            print(f"{title}:  {line}")
    path = found.write(place(given.model, given.out))
    print(f"{path}: {'look at what is unsure, then' if found.unsure else 'next:'}")
    print(f"  bns gap diagnose {given.log} --model {path}")
    return 0
