"""Serial ports of this machine, and which robot answers on one."""

from pathlib import Path

from bns.errors import BnsError
from bns.hardware.clock import RealClock
from bns.hardware.faults import FaultLog
from bns.hardware.line import SerialLine, pyserial

MISHAPS = ".mishaps"
"""what the name of the pipe beside an emulated robot's port ends with"""


def ports(place: Path | str = ".") -> dict[str, str]:
    """Ports by device, each with what is known of it.

    Args:
        place: directory in which emulated robots are looked for.

    Raises:
        MissingDependencyError: pyserial is not installed.
    """
    pyserial()
    from serial.tools import list_ports

    found = {item.device: item.description for item in sorted(list_ports.comports())}
    for pipe in sorted(Path(place).glob(f"*{MISHAPS}")):
        link = pipe.with_name(pipe.name.removesuffix(MISHAPS))
        if link.exists():
            found[str(link)] = "an emulated robot"
    return found


def answers(port: str) -> str:
    """Who answers on a port: a line. Nothing moves.

    A Khepera III is asked for its firmware, then the servos of a hexapod whether they
    are there. Another device gets those bytes as well, so ask only where none is that
    could be harmed.
    """
    said = []
    for look in (_khepera3, _phantomx):
        try:
            return look(port)
        except BnsError as error:
            said.append(str(error))
    return said[0]


def _khepera3(port: str) -> str:
    from bns.hardware.khepera import protocol
    from bns.hardware.khepera.driver import Khepera3

    clock = RealClock()
    line = SerialLine(port, protocol.BAUD)
    try:
        robot = Khepera3(line, clock, faults=FaultLog(clock))
        version = robot.identify()
    finally:
        line.close()
    return f"khepera3, firmware {version[0]}.{version[1]}"


def _phantomx(port: str) -> str:
    from bns.hardware.dynamixel import joints
    from bns.hardware.dynamixel.bus import Bus

    bus = Bus(port, joints.read(), RealClock())
    try:
        bus.identify()
    finally:
        bus.release()
    return f"phantomx, {len(bus.joints)} servos"
