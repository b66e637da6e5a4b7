"""Packets of Dynamixel protocol 1.0 and the AX-12A's control table.

Instruction: FF FF ID LEN INST parameters CHECK; status: FF FF ID LEN ERROR parameters
CHECK; LEN counts what follows it, CHECK is the complement of the sum from ID on
(ROBOTIS e-manual, protocol 1.0 and AX-12A).
"""

from typing import NamedTuple

BAUD = 1_000_000
BROADCAST = 0xFE
PING, READ, WRITE, SYNC_WRITE = 1, 2, 3, 0x83
MODEL = 12  # of the AX-12A
LONGEST = 143  # bytes after LEN

TORQUE, GOAL, SPEED, PRESENT = 24, 30, 32, 36
"""addresses: torque enable, goal position, moving speed, present state"""

UNITS = 195.3786  # position units per radian: 1023 over 300 deg
SPEED_UNIT = 0.111 * 2 * 3.141592653589793 / 60  # rad/s (e-manual)
ERRORS = (
    "input voltage", "angle limit", "overheating", "range", "checksum", "overload",
    "instruction",
)  # fmt: skip


class Instruction(NamedTuple):
    """What a host sends.

    Attributes:
        servo: its number, 254 = all.
        code: of the instruction.
        parameters: bytes.
    """

    servo: int
    code: int
    parameters: bytes


class State(NamedTuple):
    """What one read of eight bytes at address 36 tells.

    Attributes:
        position: [units], 0..1023.
        speed: [units], counter-clockwise positive.
        load: share of the largest torque, inferred by the servo, not measured.
        voltage: [V].
        temperature: [C].
    """

    position: int
    speed: int
    load: float
    voltage: float
    temperature: int


def checked(body: bytes) -> bytes:
    """A whole packet from what follows FF FF, its checksum added."""
    return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def status(servo: int, error: int, parameters: bytes = b"") -> bytes:
    """A status packet.

    Args:
        servo: its number.
        error: a bit for each of `ERRORS` that holds, the first lowest.
        parameters: what was read, if anything.
    """
    return checked(bytes([servo, len(parameters) + 2, error]) + parameters)


def instructions(data: bytes) -> tuple[list[Instruction], bytes]:
    """Whole instructions in a stream, and what is left of it.

    Packets with a wrong checksum or an impossible length are skipped.
    """
    found = []
    while (at := data.find(b"\xff\xff")) >= 0:
        data = data[at:]
        if len(data) < 4:
            break
        if data[2] == 0xFF or not 2 <= data[3] <= LONGEST:
            data = data[1:]
            continue
        end = 4 + data[3]
        if len(data) < end:
            break
        if ~sum(data[2 : end - 1]) & 0xFF != data[end - 1]:
            data = data[2:]
            continue
        found.append(Instruction(data[2], data[4], bytes(data[5 : end - 1])))
        data = data[end:]
    return found, data[-LONGEST - 4 :]


def state(values: list[int]) -> State | None:
    """The state in eight bytes, None where they cannot be one."""
    if len(values) != 8 or not all(0 <= v <= 255 for v in values):
        return None
    position = values[0] | values[1] << 8
    speed, load = values[2] | values[3] << 8, values[4] | values[5] << 8
    if position > 1023 or speed > 2047 or load > 2047:
        return None
    return State(
        position,
        speed if speed < 1024 else 1024 - speed,
        (load if load < 1024 else 1024 - load) / 1023,
        values[6] / 10,
        values[7],
    )


def words(error: int) -> str:
    """An error byte in words; every bit of it, not the first alone."""
    return ", ".join(name for bit, name in enumerate(ERRORS) if error >> bit & 1)
