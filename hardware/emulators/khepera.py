"""An emulated Khepera III: its body in MuJoCo, stepped as time goes by, and a server.

What is copied is the behaviour read in K-Team's server for the KoreBot: it blanks the
first character of wide arguments, keeps stale ones where some are missing, answers
unknown letters with `$`, and throws away what arrives before it has answered.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np

from bns.hardware.emulators.device import LiveBody, Reply
from bns.hardware.khepera import protocol
from bns.models.arena import SIZE
from bns.models.khepera3 import firmware
from bns.worlds.effects.base import Effect
from bns.worlds.light import sensors
from bns.worlds.light.law import Lamp, LightField

HISTORY = 3.0  # s of set points that effects see again; longer memories fade out

# m -> value, a white wall before the two front sensors of a real robot
# (khepera3toolbox, infrared_proximity_sensor_response, black floor)
PROXIMITY = (
    (0, 0.0045, 0.009, 0.0135, 0.018, 0.0225, 0.027, 0.0315, 0.036, 0.0405, 0.045,
     0.0495, 0.0585, 0.0675, 0.0765, 0.0855, 0.0945, 0.1035, 0.153, 0.252, 0.4455),
    (3983, 3968, 3947, 3562, 2645, 1946, 1426, 1094, 841, 653, 532, 420, 285, 193,
     138, 101, 78, 60, 24, 11, 7),
)  # fmt: skip
DARK = 3800  # ambient value of an unlit room (assumed; smaller = more light)


class KheperaBody(LiveBody):
    """A Khepera III in MuJoCo that lives with the clock.

    Args:
        effects: what is wrong with it, as text or objects; hold from the start.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        at: time of the start [s].
        lights: lamps on the board; none = an unlit room.
        rng: of the sensors' noise.

    Raises:
        BnsError: an effect that a live robot cannot have.
    """

    def __init__(
        self,
        effects: Sequence[str | Effect] = (),
        *,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        at: float = 0.0,
        lights: Sequence[Lamp] = (),
        rng: np.random.Generator | None = None,
    ):
        super().__init__("khepera3", effects, start=start, at=at)
        self._light = LightField(tuple(lights)) if lights else None
        self._rng = rng or np.random.default_rng(0)
        self._told: list[tuple[float, float, float]] = []  # not in force yet
        self._point = (0.0, 0.0)
        self.history: deque[tuple[float, float, float]] = deque(
            maxlen=max(round(HISTORY / self.dt), 1)
        )

    def tell(self, at: float, left: float, right: float) -> None:
        """A set point [m/s], in force from the time `at` on [s]."""
        self._told.append((at, left, right))

    @property
    def moving(self) -> bool:
        """Whether it is told to move, or still does."""
        return bool(
            any(self._point) or self._told or np.abs(self.wheel_speeds()).max() > 1e-3
        )

    def _drive(self) -> None:
        mean = self._mean_point()
        self.history.append((self.now, float(mean[0]), float(mean[1])))
        if self.signal:
            rows = np.array(self.history)
            mean = self._disturbed(rows[:, 0], rows[:, 1:])
        self.data.ctrl[:] = mean * self.robot.ctrl_per_command

    def _mean_point(self) -> np.ndarray:
        """Mean set point of the coming step [m/s]: they change within steps, too."""
        at, end = self.now, self.now + self.dt
        total = np.zeros(2)
        while self._told and self._told[0][0] < end:
            moment, *point = self._told.pop(0)
            moment = max(moment, at)
            total += (moment - at) * np.array(self._point)
            at, self._point = moment, (point[0], point[1])
        return (total + (end - at) * np.array(self._point)) / self.dt

    def wheel_angles(self) -> tuple[float, float]:
        """Left and right [rad]."""
        return self._joint("qpos", "jnt_qposadr")

    def wheel_speeds(self) -> tuple[float, float]:
        """Left and right, over the floor with the nominal wheel [m/s]."""
        left, right = self._joint("qvel", "jnt_dofadr")
        per = self.robot.ctrl_per_command
        return left / per, right / per

    def _joint(self, field: str, address: str) -> tuple[float, float]:
        at = [
            int(getattr(self.model, address)[self.model.joint(wheel.joint).id])
            for wheel in (self.robot.wheels["left"], self.robot.wheels["right"])
        ]
        values = getattr(self.data, field)
        return float(values[at[0]]), float(values[at[1]])

    def proximity(self) -> tuple[int, ...]:
        """11 infrared values: rays against the board's rim, which has no height here,
        and the floor below; an empty board gives the noise floor and the ground.
        """
        far = round(PROXIMITY[1][-1])
        ground = round(float(np.interp(0.0117, *PROXIMITY)))  # m above the floor
        return (*[far] * 9, ground, ground)

    def ambient(self) -> tuple[int, ...]:
        """11 ambient values: the nine around it by the lamps, the two below dark."""
        if self._light is None:
            return (DARK,) * 11
        pose = np.array([self.pose()])
        seen = sensors.of("khepera3").counts(self._light, pose, self.now, rng=self._rng)
        return (*map(int, seen[0]), DARK, DARK)

    def outside(self) -> bool:
        """Whether it has left the board."""
        x, y, _ = self.pose()
        return bool(abs(x) > SIZE[0] / 2 or abs(y) > SIZE[1] / 2)


BYTE = 10 / protocol.BAUD  # s on the wire: start bit, 8 bits, stop bit
LONGEST = 82  # characters of a line
KNOWN = "ABCDEFGHIJKLMNOPQRVXZ"


class KheperaDevice:
    """A Khepera III's firmware on a body.

    Args:
        body: what moves.
        version: version and revision that `B` answers; units follow from it.
        latency: of the link, one way [s] (Bluetooth; not measured, assumed).
        ending: of its lines: CR LF as K-Team's server, or LF.
        battery: voltage [V].
        mute: probability that a command gets no answer (an I2C failure).
        rng: for what is random.

    Attributes:
        log: accepted set points: (time, left, right) in speed units.
        stops: when it was told to stand [s], the newest last.
    """

    def __init__(
        self,
        body: KheperaBody,
        *,
        version: tuple[int, int] = (2, 5),
        latency: float = 0.01,
        ending: bytes = b"\r\n",
        battery: float = 7.9,
        mute: float = 0.0,
        rng: np.random.Generator | None = None,
    ):
        self.body, self.version, self.latency = body, version, latency
        self.ending, self.battery, self.mute = ending, battery, mute
        self.units = firmware(version[0])
        self.rng = rng or np.random.default_rng(0)
        self.log: deque[tuple[float, int, int]] = deque(maxlen=200_000)
        self.stops: deque[float] = deque(maxlen=10_000)
        self._buffer = b""
        self._stale = ["0"] * 6
        self._deaf_until = -1.0
        self._zero = (0.0, 0.0)
        self._stamp_from = 0.0

    def advance(self, now: float) -> None:
        """Let the physics go on until `now` [s]."""
        self.body.advance(now)

    def restart(self, now: float, *, power: bool) -> None:
        """Forget everything but the wheels' set point, which motor chips keep.

        Args:
            now: time [s].
            power: without it the wheels stop as well.
        """
        self._buffer, self._stale, self._stamp_from = b"", ["0"] * 6, now
        self._zero = (0.0, 0.0)
        if not power:
            self.body.tell(now, 0.0, 0.0)

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """Take bytes; what comes while an answer is being made is lost."""
        if now < self._deaf_until:
            return []
        self._buffer += data
        ends = [at for at in map(self._buffer.find, (b"\n", b"\r")) if at >= 0]
        while ends:
            cut = min(ends)
            line, self._buffer = self._buffer[:cut], self._buffer[cut + 1 :]
            if line.strip():
                self._buffer = b""  # it drops unread input before each answer
                return self._obey(line[:LONGEST].decode("latin-1"), len(data), now)
            ends = [at for at in map(self._buffer.find, (b"\n", b"\r")) if at >= 0]
        self._buffer = self._buffer[-LONGEST:]
        return []

    def _obey(self, line: str, sent: int, now: float) -> list[Reply]:
        heard = now + self.latency + sent * BYTE
        self.body.advance(now)
        answer = self._answer(line, heard)
        if answer is None or self.rng.random() < self.mute:
            return []
        at = heard + self.latency + len(answer) * BYTE
        self._deaf_until = heard + 1e-4
        return [Reply(at, answer)]

    def _answer(self, line: str, at: float) -> bytes | None:
        letter, *given = line.split(",")
        if letter == "X":
            return self._frame(at)
        made = getattr(self, f"_do_{letter.lower()}", None) if letter in KNOWN else None
        if letter not in KNOWN:
            return b"$" + self.ending
        if letter in ("A", "V") and len(given) != 1:
            return b"$" + self.ending
        text = made(given, at) if made else letter.lower()
        return text.encode() + self.ending

    def _wide(self, given: list[str], count: int) -> list[int]:
        """Arguments as the robot reads them: first character gone, stale if missing."""
        for place, item in enumerate(given[:count]):
            self._stale[place] = item[1:10]
        return [_whole(item) for item in self._stale[:count]]

    def _do_b(self, given: list[str], at: float) -> str:
        return f"b,{self.version[0]},{self.version[1]}"

    def _do_d(self, given: list[str], at: float) -> str:
        left, right = self._wide(given, 2)
        self.log.append((at, left, right))
        if not (left or right):
            self.stops.append(at)
        limit = 48_000  # speed units; TBX clamps there
        speeds = [
            self.units.speed(float(np.clip(u, -limit, limit))) for u in (left, right)
        ]
        self.body.tell(at, speeds[0], speeds[1])
        return "d"

    def _do_e(self, given: list[str], at: float) -> str:
        left, right = (self.units.units(v) for v in self.body.wheel_speeds())
        return f"e,{round(left)},{round(right)}"

    def _do_r(self, given: list[str], at: float) -> str:
        left, right = self._counts()
        return f"r,{left},{right}"

    def _do_i(self, given: list[str], at: float) -> str:
        left, right = self._wide(given, 2)
        angles = self.body.wheel_angles()
        per = self.units.counts / (2 * np.pi)
        self._zero = (angles[0] * per - left, angles[1] * per - right)
        return "i"

    def _counts(self) -> tuple[int, int]:
        per = self.units.counts / (2 * np.pi)
        left, right = self.body.wheel_angles()
        return round(left * per - self._zero[0]), round(right * per - self._zero[1])

    def _do_n(self, given: list[str], at: float) -> str:
        return f"n,{_list(self.body.proximity())},{self._stamp(at)}"

    def _do_o(self, given: list[str], at: float) -> str:
        return f"o,{_list(self.body.ambient())},{self._stamp(at)}"

    def _do_v(self, given: list[str], at: float) -> str:
        what = _whole(given[0])
        whole, part = divmod(round(self.battery * 10), 10)
        answers = {0: f"v,{whole},{part}", 3: "v,1100", 4: "v,25,0", 5: "v,80"}
        return answers.get(what, "v,0,3")

    def _do_z(self, given: list[str], at: float) -> str:
        self._stamp_from = at
        return "z"

    def _do_q(self, given: list[str], at: float) -> str:
        return "$"

    def _stamp(self, at: float) -> int:
        return int((at - self._stamp_from) * 1000) % 2**31  # the unit is assumed: ms

    def _frame(self, at: float) -> bytes:
        speeds = [round(self.units.units(v)) for v in self.body.wheel_speeds()]
        values = [*self.body.proximity(), *self.body.ambient(), *speeds]
        return protocol.FRAME.pack(
            b"x", *values, *self._counts(), self._stamp(at), b"\n\r"
        )


def _whole(text: str) -> int:
    """A number as C's atoi reads it."""
    digits, sign = "", 1
    for index, letter in enumerate(text.strip()):
        if index == 0 and letter in "+-":
            sign = -1 if letter == "-" else 1
        elif letter in "0123456789":
            digits += letter
        else:
            break
    return max(min(sign * int(digits or 0), 2**31 - 1), -(2**31))


def _list(values: tuple[int, ...]) -> str:
    return ",".join(map(str, values))
