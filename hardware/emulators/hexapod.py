"""An emulated hexapod: its body in MuJoCo, stepped as time goes by, and 18 AX-12A.

Until its torque is switched on for the first time the robot rests on a stand, its legs
half-way, as a person holds it while servos are calibrated.

Servos have packets and tables; without a body each moves to its goal by itself, at most
at its speed, with a lag. What bites between packets and table follows the e-manual.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel import joints as tables
from bns.hardware.dynamixel import packets
from bns.hardware.dynamixel.joints import Joint
from bns.hardware.emulators.device import LiveBody, Reply
from bns.models import servo_numbers
from bns.models.ax12a import NO_LOAD_SPEED
from bns.worlds.effects.base import Effect
from bns.worlds.physics import legged_plan, servo_law
from bns.worlds.physics.control import in_units
from bns.worlds.physics.rollout import Compiled

LIFTED = 0.01  # m; how far the stand lifts it off the board


class Reading(NamedTuple):
    """What a servo knows of itself.

    Attributes:
        units: position [units].
        speed: [rad/s], counter-clockwise positive.
        load: share of the largest torque, counter-clockwise positive.
    """

    units: int
    speed: float
    load: float


class HexapodBody(LiveBody):
    """A PhantomX in MuJoCo that lives with the clock.

    Args:
        effects: what is wrong with it, as text or objects; hold from the start.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        at: time of the start [s].
        joints: how its horns sit; None = as in the file that comes with the driver.

    Raises:
        BnsError: an effect that a live robot cannot have.
    """

    def __init__(
        self,
        effects: Sequence[str | Effect] = (),
        *,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        at: float = 0.0,
        joints: Sequence[Joint] | None = None,
    ):
        super().__init__("phantomx", effects, start=start, at=at)
        names = [channel.name for channel in self.robot.channels]
        given = tables.read() if joints is None else joints
        self.joints = {joint.id: joint for joint in given}
        self._column = {joint.id: names.index(joint.name) for joint in given}
        self._laws = servo_law.laws(self.model)
        if self._laws["delay"].any() or self._laws["lag"].any():
            raise BnsError(
                "An emulated hexapod cannot have late or lagging servos: take another "
                "effect, or the world 'hexapod'."
            )
        hinges = self.model.actuator_trnid[:, 0]
        self._places = self.model.jnt_qposadr[hinges]
        self._rates = self.model.jnt_dofadr[hinges]
        self._whole = self.model.actuator_gainprm[:, 0].copy()
        self._damping = self.model.dof_damping[self._rates].copy()
        free = self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
        first = int(self.model.jnt_dofadr[free][0])
        self._moves = slice(first, first + 3)
        self.told = np.zeros(len(names))
        self.force = np.zeros(len(names))
        self.pace = np.full(len(names), NO_LOAD_SPEED)
        self.on = np.zeros(len(names), bool)
        self.stand = True
        self.data.qpos[self._places] = -self._laws["offset"]  # a jig, no weight on it
        self.data.qpos[self._free][2] += LIFTED

    def _begin(self, scene: Compiled, start: tuple[float, float, float]) -> np.ndarray:
        return legged_plan.stand(scene, start, np.zeros(scene.model.nu).tobytes())

    @property
    def moving(self) -> bool:
        """Whether a servo is on its way; torque alone is rest."""
        return bool((np.abs(self.told - self.force) > 1e-3)[self.on].any())

    def advance(self, now: float) -> None:
        """Step until `now` [s]; on the stand time passes and nothing moves."""
        if self.stand:
            self._from = now - self._steps * self.dt
            return
        super().advance(now)

    def tell(self, servo: int, units: int) -> None:
        """The goal of a servo [units]."""
        self.told[self._column[servo]] = self.joints[servo].angle(units)

    def speed(self, servo: int, speed: float) -> None:
        """The moving speed of a servo [rad/s], 0 = as fast as it can."""
        capped = min(speed, NO_LOAD_SPEED) if speed else NO_LOAD_SPEED
        self.pace[self._column[servo]] = capped

    def power(self, servo: int, on: bool) -> None:
        """Switch the torque of a servo; off, nothing holds it or brakes it."""
        column = self._column[servo]
        if on == self.on[column]:
            return
        self.on[column] = on
        whole = self._whole[column] * on
        self.model.actuator_gainprm[column, 0] = whole
        self.model.actuator_biasprm[column, 1] = -whole
        values = {name: law[column] for name, law in self._laws.items()}
        bare = servo_numbers.joint_numbers(values, 0.0).damping
        self.model.dof_damping[self._rates[column]] = (
            self._damping[column] if on else bare
        )
        if on:  # it starts from where it is
            self.stand = False
            self.force[column] = self._angles()[column]

    def reading(self, servo: int) -> Reading:
        """What a servo reads."""
        column, joint = self._column[servo], self.joints[servo]
        angle = self._angles()[column]
        units = round(joint.zero + joint.sign * angle * packets.UNITS)
        push = self.data.actuator_force[column]
        most = max(self.model.actuator_forcerange[column, 1], 1e-9)
        speed = float(self.data.qvel[self._rates[column]]) * joint.sign
        load = float(np.clip(push / most, -1, 1)) * joint.sign * self.on[column]
        return Reading(int(np.clip(units, 0, 1023)), speed, load)

    def rests(self, slow: float = 0.01) -> bool:
        """Whether the trunk is slower than `slow` [m/s], in any direction."""
        speed = self.data.qvel[self._moves]
        return bool(self.stand or np.linalg.norm(speed) < slow)

    def _angles(self) -> np.ndarray:
        return self.data.qpos[self._places] + self._laws["offset"]

    def _drive(self) -> None:
        told = self.told
        if self.signal:
            told = self._disturbed(np.array([self.now]), told[None].copy())
        self.force += np.clip(
            told - self.force, -self.pace * self.dt, self.pace * self.dt
        )
        units = in_units(self.force.copy(), self._laws["quantisation"])
        self.data.ctrl[:] = units - self._laws["offset"]


TOP = 6.18 * packets.UNITS  # units/s: 59 rpm without load (e-manual)
TORQUE_OFF = bytes((packets.TORQUE, 0))
LAG = 0.05  # s (assumed)
BYTE = 10 / packets.BAUD  # s


class ServoBank:
    """Servos on an emulated bus.

    Args:
        numbers: of the servos; one given twice answers twice.
        delay: return delay [s] (250 x 2 us from the factory).
        voltage: of the bus [V].
        upset: probability that a status carries a random error bit.
        rng: for that.
        at: time of the start [s].
        body: what they move; None = each its own horn.

    Attributes:
        goals: times of every sync write, newest last.
        stops: when torque was switched off by broadcast [s], the newest last.
    """

    def __init__(
        self,
        numbers: Sequence[int] = range(1, 19),
        *,
        delay: float = 0.0005,
        voltage: float = 11.1,
        upset: float = 0.0,
        rng: np.random.Generator | None = None,
        at: float = 0.0,
        body: HexapodBody | None = None,
    ):
        self.body = body
        self.numbers, self.delay, self.upset = list(numbers), delay, upset
        self.rng = rng or np.random.default_rng(0)
        self.tables = {number: _table(number, voltage) for number in set(numbers)}
        self.place = dict.fromkeys(self.tables, 512.0)
        self.goals: list[float] = []
        self.stops: deque[float] = deque(maxlen=10_000)
        self._voltage = voltage
        self._now, self._buffer = at, b""

    def advance(self, now: float) -> None:
        """Let all servos move until `now` [s]."""
        dt = max(now - self._now, 0.0)
        self._now = now
        if self.body is not None:
            self.body.advance(now)
            return
        for number, table in self.tables.items():
            if not table[packets.TORQUE]:
                continue
            goal = table[packets.GOAL] | table[packets.GOAL + 1] << 8
            asked = table[packets.SPEED] | table[packets.SPEED + 1] << 8
            top = (
                TOP
                if asked == 0
                else min(asked * packets.SPEED_UNIT * packets.UNITS, TOP)
            )
            gap = (goal - self.place[number]) * (1 - np.exp(-dt / LAG))
            self.place[number] += float(np.clip(gap, -top * dt, top * dt))

    def restart(self, now: float, *, power: bool) -> None:
        """All tables as after switching on: no torque, as fast as they can."""
        del power
        self.advance(now)
        self._buffer = b""
        for number in self.tables:
            self.tables[number] = _table(number, self._voltage)
            if self.body is not None:
                self.body.power(number, False)
                self.body.speed(number, 0.0)

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """Take bytes; gives the status packets."""
        self.advance(now)
        found, self._buffer = packets.instructions(self._buffer + data)
        at = now + len(data) * BYTE
        return [reply for item in found for reply in self._obey(item, at)]

    def _obey(self, item: packets.Instruction, at: float) -> list[Reply]:
        if item.code == packets.SYNC_WRITE:
            self._sync(item.parameters, at)
            return []
        off = item.code == packets.WRITE and item.parameters[:2] == TORQUE_OFF
        if off and item.servo == packets.BROADCAST:
            self.stops.append(at)
        replies = []
        for number in self.numbers:
            if item.servo not in (number, packets.BROADCAST):
                continue
            error, values = self._one(number, item)
            if item.servo == packets.BROADCAST:
                continue
            if self.rng.random() < self.upset:
                error |= 1 << int(self.rng.integers(7))
            answer = packets.status(number, error, values)
            replies.append(Reply(at + self.delay + len(answer) * BYTE, answer))
        if len(replies) > 1:  # two servos of one number talk at once
            mixed = bytes(
                a & b ^ 0x15
                for a, b in zip(replies[0].data[2:], replies[1].data[2:], strict=True)
            )
            return [Reply(replies[0].at, b"\xff\xff" + mixed)]
        return replies

    def _one(self, number: int, item: packets.Instruction) -> tuple[int, bytes]:
        table, given = self.tables[number], item.parameters
        if item.code == packets.PING:
            return 0, b""
        if item.code == packets.READ and len(given) == 2:
            self._refresh(number)
            return 0, bytes(table[given[0] : given[0] + given[1]])
        if item.code == packets.WRITE and given:
            return self._write(number, given[0], given[1:]), b""
        return 1 << 6, b""

    def _write(self, number: int, at: int, data: bytes) -> int:
        table = self.tables[number]
        if at + len(data) > len(table):
            return 1 << 3
        if at == packets.GOAL and len(data) >= 2 and data[0] | data[1] << 8 > 1023:
            return 1 << 1
        table[at : at + len(data)] = data
        self._tell(number, table)
        return 0

    def _tell(self, number: int, table: bytearray) -> None:
        """Let the body's servo know its registers, where there is a body."""
        if self.body is None:
            return
        speed = table[packets.SPEED] | table[packets.SPEED + 1] << 8
        self.body.speed(number, speed * packets.SPEED_UNIT)
        self.body.tell(number, table[packets.GOAL] | table[packets.GOAL + 1] << 8)
        self.body.power(number, bool(table[packets.TORQUE]))

    def _sync(self, given: bytes, at: float) -> None:
        if len(given) < 2 or given[1] == 0:
            return
        start, size = given[0], given[1] + 1
        for place in range(2, len(given) - size + 1, size):
            number = given[place]
            if number in self.tables:
                self._write(number, start, given[place + 1 : place + size])
        self.goals.append(at)

    def _refresh(self, number: int) -> None:
        table = self.tables[number]
        position, speed, load = round(self.place[number]), 0.0, 0.0
        if self.body is not None:
            position, speed, load = self.body.reading(number)
        pace = _signed(speed / packets.SPEED_UNIT)
        for place, value in enumerate((position, pace, _signed(load * 1023))):
            table[36 + 2 * place : 38 + 2 * place] = value.to_bytes(2, "little")


def _signed(value: float) -> int:
    """A register whose bit 10 is the direction, set clockwise."""
    return min(round(abs(value)), 1023) | (1024 if value < 0 else 0)


def _table(number: int, voltage: float) -> bytearray:
    table = bytearray(50)
    table[0], table[2], table[3], table[4], table[5] = packets.MODEL, 24, number, 1, 250
    table[8:10], table[14:16], table[34:36] = b"\xff\x03", b"\xff\x03", b"\xff\x03"
    table[26] = table[27] = 1
    table[28] = table[29] = 32
    table[30:32] = table[36:38] = b"\x00\x02"
    table[42], table[43], table[48] = round(voltage * 10), 35, 32
    return table
