"""The real Khepera III as a world: one at a time, in real time."""

from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

from bns.errors import BnsError
from bns.hardware.driving import homing, steering
from bns.hardware.driving.motion import Performed
from bns.hardware.rig import Rig, battery, connect
from bns.hardware.safety.limits import Limits
from bns.hardware.tracking.tracker import Sighting
from bns.hardware.worlds import records
from bns.hardware.worlds.real_robot import RealRobot
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.trial import Commands, Trial


@dataclass(eq=False)
class HardwareWorld(RealRobot[Rig]):
    """A real Khepera III on a serial port under a camera, or an emulated one.

    Its trials and settings are those of `RealRobot`. Software damage is of the command
    and actuator stages: it changes the set points before they are sent. Void are trials
    with bytes lost, a command late, the robot not seen.

    Args:
        wheels: file of the wheels' sizes; empty = nominal.
        recording: trials have the durations that were told, see `records.trial`.
    """

    robot: str = "khepera3"
    _: KW_ONLY
    wheels: str = ""
    recording: bool = False

    stages: ClassVar[tuple[str, ...]] = ("command", "actuator")

    def ready(self) -> None:
        """See that a trial could begin, see `RealRobot.ready`."""
        self.connected().mover().wait_for_sight()

    def _refuse_robot(self) -> None:
        if self.robot != "khepera3":
            raise BnsError(
                f"This world drives khepera3, not {self.robot!r}: for a hexapod take "
                "`bns run hexapod-walk --world hardware`, or HardwareHexapod."
            )

    def _refuse_damage(self, damage: Damage) -> None:
        active.refuse(damage, stages=self.stages, kind=self.model.kind, world=self.name)

    def _limits(self) -> Limits:
        """Bounds of the session."""
        return Limits(arena=self.arena)

    def _connect(self) -> Rig:
        return connect(
            self.port,
            self.camera,
            calibration=self.calibration,
            wheels=self.wheels,
            limits=self._limits(),
            log=self.log or None,
        )

    def _once(
        self, rig: Rig, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        mover = rig.mover()
        volts = battery(rig.robot, rig.limits)
        stand = homing.go(mover, self.start)
        points = steering.points(given, stages, seed, trial)
        begin = rig.clock.now()
        done = mover.perform(points, given.duration)
        conditions = stages.conditions(trial, seed) | self._about(
            rig, volts, float(begin), stand, done
        )
        return records.trial(
            done,
            given,
            sample_dt=self.sample_dt,
            start_yaw=self.start[2],
            robot=self.robot,
            world=self.name,
            conditions=conditions,
            recording=rig.eyes.tracker.camera if self.recording else None,
        )

    def _about(
        self, rig: Rig, volts: float, begin: float, stand: Sighting, done: Performed
    ) -> dict[str, object]:
        """What a trial's record says of the session."""
        return {
            "battery": volts,
            "began": round(begin, 3),
            "first": round(float(done.switched[0]), 4),
            "start": [round(float(v), 5) for v in stand.pose],
            "late": round(float(done.late), 4),
            "notes": done.notes,
            "firmware": list(rig.robot.version),
        }
