"""The body of an emulated Khepera III: MuJoCo, stepped as time goes by."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from bns.hardware.emulators.live_body import LiveBody
from bns.models.arena import SIZE
from bns.worlds.effects.base import Effect
from bns.worlds.light import sensors
from bns.worlds.light.field import Lamp, LightField

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
