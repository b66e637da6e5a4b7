"""Emulated robots as wholes.

Either in a process of its own, with port, physics, camera and a log; or a rehearsal in
one process and in virtual time, exact and fast (`rig`).
"""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from bns.hardware.clock import VirtualClock, urgent
from bns.hardware.dynamixel import joints, packets
from bns.hardware.emulators.camera import BodyPainter, Painter, PoseServer
from bns.hardware.emulators.device import Noise, VirtualLine
from bns.hardware.emulators.hexapod import HexapodBody, ServoBank
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.emulators.pty_host import Mishaps, PtyHost, Restarts
from bns.hardware.faults import FaultLog
from bns.hardware.khepera import protocol
from bns.hardware.khepera.driver import Khepera3
from bns.hardware.rig import SIZE, Rig
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.eyes import VirtualEyes
from bns.hardware.tracking.marker import Marker
from bns.hardware.tracking.tracker import Tracker
from bns.worlds.light.law import Lamp

SLOW = 0.005  # m/s; slower, a wheel stands


def khepera3(
    port: Path | str,
    *,
    effects: Sequence[str] = (),
    start: Sequence[float] = (0.0, 0.0, 0.0),
    version: tuple[int, int] = (2, 5),
    latency: float = 0.01,
    battery: float = 7.9,
    lost: float = 0.0,
    corrupted: float = 0.0,
    rate: float = 30.0,
    seed: int = 0,
    log: str = "",
    baud: int = protocol.BAUD,
    lights: Sequence[Lamp] = (),
    stop: Callable[[], bool] | None = None,
) -> None:
    """Emulate a Khepera III until SIGINT or SIGTERM.

    SIGUSR1 pulls the cable out and puts it in again; SIGUSR2 covers and uncovers the
    camera; for more see `bns.hardware.emulators.pty_host`.

    Args:
        port: path of the link to its port.
        effects: what is wrong with its body.
        start: where it stands [m, m, rad].
        version: of its firmware.
        latency: of the link, one way [s].
        battery: voltage [V].
        lost: probability that a byte is lost.
        corrupted: probability that a packet is corrupted.
        rate: of the camera [1/s].
        seed: of what is random.
        log: file for a line at each stop order, and whenever the set point or the
            wheels' motion changes.
        baud: rate that it talks at.
        lights: lamps on the board; none = an unlit room.
        stop: asked all the time; None = signals decide.
    """
    urgent()
    now = time.monotonic()
    body = KheperaBody(
        effects,
        start=start,
        at=now,
        lights=lights,
        rng=np.random.default_rng([seed, 2]),
    )
    device = KheperaDevice(
        body,
        version=version,
        latency=latency,
        battery=battery,
        rng=np.random.default_rng([seed, 0]),
    )
    noise = Noise(
        device, lost=lost, corrupted=corrupted, rng=np.random.default_rng([seed, 1])
    )
    host = PtyHost(noise, port, baud=baud)
    server = PoseServer(body, port, rate=rate)
    diary = _WheelsDiary(device, log)
    serve(host, server, device, diary.note, stop)


def serve(
    host: PtyHost,
    server: PoseServer,
    robot: Restarts,
    note: Callable[[float, float], None],
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run an emulated robot with its camera until it is told to end.

    Args:
        host: with the robot's electronics.
        server: its camera.
        robot: its electronics.
        note: called in every round with the time, and the time from which on the robot
            hears [s].
        stop: asked all the time; None = signals decide, see `khepera3`.
    """
    mishaps = Mishaps(host, server, robot)
    if stop is None:
        mishaps.listen()

    def handle(at: float) -> None:
        mishaps.apply(at)
        server.serve(at)
        note(at, mishaps.hears)

    try:
        host.serve(stop or (lambda: mishaps.ended), handle)
    finally:
        host.unplug()
        server.close()
        mishaps.close()


class Diary:
    """A JSON line for each thing that is worth one.

    Args:
        path: file; empty = none is kept.
        stops: when the robot was told to stop [s].
    """

    def __init__(self, path: str, stops: Sequence[float]) -> None:
        self.path, self._stops, self._newest = path, stops, -1.0
        self._hears = 0.0

    def note(self, at: float, hears: float) -> None:
        """Write what is new."""
        if self._stops and self._stops[-1] != self._newest:
            self._newest = self._stops[-1]
            self.write(at=self._newest, stop=True)
        if hears != self._hears and hears < float("inf"):
            self.write(at=at, hears=hears)
        self._hears = hears

    def write(self, **entry: object) -> None:
        """Add a line."""
        if self.path:
            with open(self.path, "a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")


class _WheelsDiary(Diary):
    """Stop orders, each new set point, and the wheels coming to a stand."""

    def __init__(self, device: KheperaDevice, path: str) -> None:
        super().__init__(path, device.stops)
        self.device = device
        self._told: tuple[int, int] | None = None
        self._stood = True

    def note(self, at: float, hears: float) -> None:
        """Write what is new."""
        super().note(at, hears)
        if self.device.log and self.device.log[-1][1:] != self._told:
            when, *told = self.device.log[-1]
            self._told = (told[0], told[1])
            self.write(at=when, told=told)
        stands = max(map(abs, self.device.body.wheel_speeds())) < SLOW
        if stands != self._stood:
            self._stood = stands
            self.write(at=at, stands=stands)


def phantomx(
    port: Path | str,
    *,
    effects: Sequence[str] = (),
    start: Sequence[float] = (0.0, 0.0, 0.0),
    servos: Path | str = joints.FILE,
    absent: Sequence[int] = (),
    doubled: Sequence[int] = (),
    lost: float = 0.0,
    corrupted: float = 0.0,
    upset: float = 0.0,
    seed: int = 0,
    battery: float = 11.1,
    rate: float = 30.0,
    log: str = "",
    baud: int = packets.BAUD,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Emulate a hexapod until SIGINT or SIGTERM; SIGUSR1 and 2 as for `khepera3`.

    Args:
        port: path of the link to its port.
        effects: what is wrong with its body.
        start: where it stands [m, m, rad].
        servos: file that says how its horns really sit.
        absent: servos that are not there.
        doubled: numbers that two servos have.
        lost: probability that a byte is lost.
        corrupted: probability that a packet is corrupted.
        upset: probability that a status carries a random error bit.
        seed: of what is random.
        battery: voltage of the bus [V].
        rate: of the camera [1/s].
        log: file for a line at each stop order, whenever torque is switched (with
            the state of the physics, where it is off), and whenever the body begins to
            move or comes to rest.
        baud: rate that it talks at.
        stop: asked all the time; None = signals decide.
    """
    urgent()
    now = time.monotonic()
    body = HexapodBody(effects, start=start, at=now, joints=joints.read(servos))
    numbers = [n for n in body.joints if n not in absent]
    bank = ServoBank(
        [*numbers, *doubled],
        voltage=battery,
        upset=upset,
        at=now,
        body=body,
        rng=np.random.default_rng([seed, 0]),
    )
    noise = Noise(
        bank, lost=lost, corrupted=corrupted, rng=np.random.default_rng([seed, 1])
    )
    host = PtyHost(noise, port, baud=baud)
    diary = _LegsDiary(bank, body, log)
    serve(host, PoseServer(body, port, rate=rate), bank, diary.note, stop)


class _LegsDiary(Diary):
    """Stop orders, how many servos have torque, and when the body comes to rest."""

    def __init__(self, bank: ServoBank, body: HexapodBody, path: str) -> None:
        super().__init__(path, bank.stops)
        self.body, self._on, self._stood = body, 0, True

    def note(self, at: float, hears: float) -> None:
        """Write what is new."""
        super().note(at, hears)
        on = int(self.body.on.sum())
        if on != self._on:
            falls = {} if on else {"state": self.body.state.tolist()}
            self.write(at=at, powered=on, **falls)
        self._on = on
        stands = self.body.rests()
        if stands != self._stood:
            self.write(at=at, stands=stands)
        self._stood = stands


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
