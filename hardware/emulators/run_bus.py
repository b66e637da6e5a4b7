"""An emulated hexapod in a process of its own: its bus, physics, camera, and a log."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from bns.hardware.dynamixel import joints, packets
from bns.hardware.emulators.camera import PoseServer
from bns.hardware.emulators.device import Noise
from bns.hardware.emulators.hexapod_body import HexapodBody
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.emulators.run import Diary, serve
from bns.hardware.emulators.servo_bank import ServoBank
from bns.hardware.safety.priority import urgent


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
        log: file for a line at each stop order, and whenever torque is switched or
            the body begins to move or comes to rest.
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
    diary = _Diary(bank, body, log)
    serve(host, PoseServer(body, port, rate=rate), bank, diary.note, stop)


class _Diary(Diary):
    """Stop orders, how many servos have torque, and when the body comes to rest."""

    def __init__(self, bank: ServoBank, body: HexapodBody, path: str) -> None:
        super().__init__(path, bank.stops)
        self.body, self._on, self._stood = body, 0, True

    def note(self, at: float, hears: float) -> None:
        """Write what is new."""
        super().note(at, hears)
        on = int(self.body.on.sum())
        if on != self._on:
            self.write(at=at, powered=on)
        self._on = on
        stands = self.body.rests()
        if stands != self._stood:
            self.write(at=at, stands=stands)
        self._stood = stands
