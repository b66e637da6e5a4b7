"""An emulated robot in a process of its own: port, physics, camera, and a log."""

import json
import signal
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType

import numpy as np

from bns.hardware.emulators.camera import PoseServer
from bns.hardware.emulators.device import Noise
from bns.hardware.emulators.khepera_body import KheperaBody
from bns.hardware.emulators.khepera_device import KheperaDevice
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.khepera import protocol
from bns.hardware.priority import urgent
from bns.worlds.light.field import Lamp


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
    rate: float = 15.0,
    seed: int = 0,
    log: str = "",
    baud: int = protocol.BAUD,
    lights: Sequence[Lamp] = (),
    stop: Callable[[], bool] | None = None,
) -> None:
    """Emulate a Khepera III until SIGINT or SIGTERM.

    SIGUSR1 pulls the cable out and puts it in again; SIGUSR2 covers and uncovers the
    camera.

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
        log: file for a line whenever the set point or the wheels' motion changes.
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
    diary = _Diary(device, log)
    serve(host, server, diary.note, stop)


def serve(
    host: PtyHost,
    server: PoseServer,
    note: Callable[[float], None],
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run an emulated robot with its camera until it is told to end.

    Args:
        host: with the robot's electronics.
        server: its camera.
        note: called in every round with the time [s].
        stop: asked all the time; None = signals decide, see `khepera3`.
    """
    state = _State()
    if stop is None:
        state.listen()

    def handle(at: float) -> None:
        if state.pulled and host.plugged:
            host.unplug()
        elif not state.pulled:
            host.plug()
        server.covered = state.covered
        server.serve(at)
        note(at)

    try:
        host.serve(stop or (lambda: state.ended), handle)
    finally:
        host.unplug()
        server.close()


class _State:
    """What signals have asked for."""

    def __init__(self):
        self.ended = self.pulled = self.covered = False

    def listen(self) -> None:
        """Take the signals of this process."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self.end)
        signal.signal(signal.SIGUSR1, self.pull)
        signal.signal(signal.SIGUSR2, self.cover)

    def end(self, number: int, frame: FrameType | None) -> None:
        self.ended = True

    def pull(self, number: int, frame: FrameType | None) -> None:
        self.pulled = not self.pulled

    def cover(self, number: int, frame: FrameType | None) -> None:
        self.covered = not self.covered


class _Diary:
    """A JSON line for each new set point, and for the wheels coming to a stand."""

    def __init__(self, device: KheperaDevice, path: str):
        self.device, self.path = device, path
        self._told: tuple[int, int] | None = None
        self._stood = True

    def note(self, at: float) -> None:
        """Write what is new."""
        if not self.path:
            return
        if self.device.log and self.device.log[-1][1:] != self._told:
            when, *told = self.device.log[-1]
            self._told = (told[0], told[1])
            self._write(at=when, told=told)
        stands = max(map(abs, self.device.body.wheel_speeds())) < 0.005
        if stands != self._stood:
            self._stood = stands
            self._write(at=at, stands=stands)

    def _write(self, **entry: object) -> None:
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
