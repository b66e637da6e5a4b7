"""An emulated hexapod's bus in a process of its own."""

import signal
import time
from pathlib import Path
from types import FrameType

import numpy as np

from bns.hardware.emulators.device import Noise
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.emulators.servo_bank import ServoBank


def phantomx(
    port: Path | str,
    *,
    lost: float = 0.0,
    corrupted: float = 0.0,
    seed: int = 0,
    battery: float = 11.1,
) -> None:
    """Emulate the servos of a hexapod until SIGINT or SIGTERM.

    Args:
        port: path of the link to its port.
        lost: probability that a byte is lost.
        corrupted: probability that a packet is corrupted.
        seed: of what is random.
        battery: voltage of the bus [V].
    """
    bank = ServoBank(voltage=battery, at=time.monotonic())
    noise = Noise(
        bank, lost=lost, corrupted=corrupted, rng=np.random.default_rng([seed, 1])
    )
    host = PtyHost(noise, port)
    ended: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        ended.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    try:
        host.serve(lambda: bool(ended))
    finally:
        host.unplug()
