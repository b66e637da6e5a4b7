"""A whole rehearsal in one process and in virtual time: exact and fast."""

from collections.abc import Sequence

import numpy as np

from bns.hardware.clock import VirtualClock
from bns.hardware.emulators.camera import BodyPainter, Painter
from bns.hardware.emulators.device import Noise, VirtualLine
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.faults import FaultLog
from bns.hardware.khepera.driver import Khepera3
from bns.hardware.rig import SIZE, Rig
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.eyes import VirtualEyes
from bns.hardware.tracking.marker import Marker
from bns.hardware.tracking.tracker import Tracker
from bns.worlds.light.field import Lamp


class NoDog:
    """Stands where the watchdog does: in virtual time no process can die."""

    def feed(self, *, moving: bool) -> None:
        """Take the food."""


class VirtualRig(Rig):
    """A rig whose robot, line and camera are emulated in virtual time.

    Attributes:
        device: the robot's electronics.
        body: the robot in MuJoCo.
    """

    device: KheperaDevice
    body: KheperaBody


def rig(
    effects: Sequence[str] = (),
    *,
    start: Sequence[float] = (0.0, 0.0, 0.0),
    version: tuple[int, int] = (2, 5),
    lost: float = 0.0,
    corrupted: float = 0.0,
    mute: float = 0.0,
    rate: float = 10.0,
    size: tuple[int, int] = SIZE,
    noise: float = 2.0,
    shake: float = 0.0,
    seed: int = 0,
    log: str | None = None,
    lights: Sequence[Lamp] = (),
) -> VirtualRig:
    """A rehearsal.

    Args:
        effects: what is wrong with the robot's body.
        start: where it stands [m, m, rad].
        version: of its firmware.
        lost: probability that a byte is lost.
        corrupted: probability that a packet is corrupted.
        mute: probability that a command is not answered.
        rate: pictures a second.
        size: of a picture [px].
        noise, shake: of the camera, see `Painter`.
        seed: of all that is random.
        log: file for faults.
        lights: lamps on the board; none = an unlit room.
    """
    clock = VirtualClock()
    rngs = [np.random.default_rng([seed, index]) for index in range(4)]
    body = KheperaBody(effects, start=start, lights=lights, rng=rngs[3])
    device = KheperaDevice(body, version=version, mute=mute, rng=rngs[0])
    line = VirtualLine(
        Noise(device, lost=lost, corrupted=corrupted, rng=rngs[1]), clock
    )
    faults, limits, marker = FaultLog(clock, log), Limits(), Marker()
    robot = Khepera3(line, clock, faults=faults, guard=NoDog(), limit=limits.speed)
    robot.identify()
    camera = Camera.overhead(size)
    painter = BodyPainter(
        body, Painter(camera, marker, noise=noise, shake=shake, rng=rngs[2])
    )
    eyes = VirtualEyes(painter, Tracker(camera, marker), clock, rate=rate)
    made = VirtualRig(robot, eyes, clock, limits, Operator(), faults, line)
    made.device, made.body = device, body
    return made
