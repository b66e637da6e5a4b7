"""What is on the port, where it is no Khepera III."""

from bns.errors import BnsError
from bns.hardware.khepera import protocol


def port_error(heard: bytes) -> BnsError:
    """What it means that `B` got no answer."""
    if b"\xff\xff" in heard:
        return BnsError(
            "What answers on this port speaks the Dynamixel protocol: a hexapod, no "
            "Khepera III. Give --robot phantomx or another --port."
        )
    text = heard.strip()
    if text and all(32 <= c < 127 or c in b"\r\n" for c in text):
        return BnsError(
            f"What answers on this port ({text[:40].decode()!r}) is no Khepera III: "
            "give another --port."
        )
    if text:
        return BnsError(
            "What comes from this port cannot be read: the baud rate is wrong; the "
            f"Khepera III talks at {protocol.BAUD}."
        )
    return BnsError(
        "Nothing answers on this port: switch the Khepera III on, check cable or "
        f"Bluetooth, that it talks at {protocol.BAUD} baud, and that it is no hexapod "
        "(--robot phantomx)."
    )
