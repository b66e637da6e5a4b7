"""What there is to see of a hexapod before it is let go, one line a servo."""

from collections.abc import Iterator

from bns.errors import BnsError
from bns.hardware.clock import RealClock
from bns.hardware.dynamixel import joints, packets
from bns.hardware.dynamixel.bus import EMPTY, Bus


def report(port: str, servos: str = "") -> Iterator[str]:
    """Look at every servo; nothing moves.

    Args:
        port: of the robot.
        servos: its file; empty = the one that comes with the driver.

    Raises:
        BnsError: the port, a servo or the battery is not as it should be.
    """
    clock = RealClock()
    bus = Bus(port, joints.read(servos or joints.FILE), clock)
    try:
        bus.identify()
        if not servos:
            yield "zeros      assumed; see `bns hardware calibrate --what servos`"
        yield f"servos     {len(bus.joints)} AX-12A at {packets.BAUD} baud"
        begin = clock.now()
        for joint in bus.joints:
            state = bus.read(joint.id)
            yield (
                f"{joint.name:<9} id {joint.id:>2}  {joint.angle(state.position):+.3f} "
                f"rad, load {state.load:+.2f}, {state.voltage:.1f} V, "
                f"{state.temperature} C"
            )
        took = clock.now() - begin
        yield f"sweep      {took * 1e3:.1f} ms for all, {len(bus.faults)} faults"
        if min(state.voltage for state in bus.states.values()) < EMPTY:
            raise BnsError(f"The bus has less than {EMPTY} V: charge the battery.")
    finally:
        bus.release()
