"""The body of an emulated hexapod: MuJoCo, stepped as time goes by.

Until its torque is switched on for the first time the robot rests on a stand, its legs
half-way, as a person holds it while servos are calibrated.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel import joints as tables
from bns.hardware.dynamixel import packets
from bns.hardware.dynamixel.joints import Joint
from bns.hardware.emulators.live_body import LiveBody
from bns.models import servo_numbers
from bns.models.ax12a import NO_LOAD_SPEED
from bns.worlds.effects.base import Effect
from bns.worlds.physics import legged_plan, servo_joint
from bns.worlds.physics.legged_goals import in_units
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
        self._laws = servo_joint.laws(self.model)
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
