"""An emulated hexapod in a process of its own: its bus, physics, camera, and a log."""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from bns.hardware.dynamixel import joints, packets
from bns.hardware.emulators.camera import PoseServer
from bns.hardware.emulators.device import Noise
from bns.hardware.emulators.hexapod_body import HexapodBody
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.emulators.run import serve
from bns.hardware.emulators.servo_bank import ServoBank
from bns.hardware.priority import urgent


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
        log: file for a line whenever torque is switched.
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
    serve(host, PoseServer(body, port, rate=rate), _Diary(body, log).note, stop)


class _Diary:
    """A JSON line whenever the number of servos with torque changes."""

    def __init__(self, body: HexapodBody, path: str):
        self.body, self.path, self._on = body, path, 0

    def note(self, at: float) -> None:
        """Write what is new."""
        on = int(self.body.on.sum())
        if self.path and on != self._on:
            with open(self.path, "a", encoding="utf-8") as file:
                file.write(json.dumps({"at": at, "powered": on}) + "\n")
        self._on = on
