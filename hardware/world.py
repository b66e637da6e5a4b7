"""The real robot as a world: one at a time, in real time."""

from collections.abc import Callable, Sequence

from bns import models
from bns.errors import BnsError
from bns.hardware import homing, records, schedule
from bns.hardware.errors import LinkError, Void
from bns.hardware.limits import Limits
from bns.hardware.rig import EMULATED, Rig, battery, connect
from bns.worlds import active, control
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.trial import Commands, Trial

STAGES = ("command", "actuator")
TRIES = 20  # of a trial that is void
INSIDE = 0.15  # m from the edge at which a trial may start, at least


class HardwareWorld:
    """A real Khepera III on a serial port under a camera, or an emulated one.

    A trial begins with the robot driving back to the start by sight. Software damage
    changes the set points before they are sent. A trial that was disturbed (bytes lost,
    a command late, the robot not seen) is void and repeated.

    Args:
        robot: "khepera3".
        damage: software damage, of the command and actuator stages, with schedule.
        reality: the same, always on.
        sample_dt: time between two samples of a trial [s].
        start: pose at the start of each trial in the world frame [m, m, rad].
        arena: size of the board [m].
        threads: not used; the robot has its own processor.
        port: the robot's device; opened by the first trial.
        camera: number, video file, or "emulated".
        calibration: file of the camera's calibration.
        wheels: file of the wheels' sizes; empty = nominal.
        log: file for faults.
        on_void: called with number and reason whenever a trial is void.
        recording: trials have the durations that were told, see `records.trial`.
        rig: an open one instead of port and camera (rehearsals in virtual time).

    Raises:
        BnsError: an effect that cannot be applied in software, a bad setting.
    """

    name = "hardware"

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        damage: Damage | Sequence = (),
        reality: Damage | Sequence = (),
        sample_dt: float = 0.1,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        arena: Sequence[float] = (2.7, 1.8),
        threads: int = 1,
        port: str = "",
        camera: str = EMULATED,
        calibration: str = "",
        wheels: str = "",
        log: str = "",
        on_void: Callable[[int, str], None] = lambda trial, reason: None,
        recording: bool = False,
        rig: Rig | None = None,
    ):
        del threads
        self.model = models.robot(robot)
        if robot != "khepera3":
            raise BnsError(
                f"This world drives khepera3, not {robot!r}: for a hexapod take "
                "`bns run hexapod-walk --world hardware`, or HardwareHexapod."
            )
        self.robot = robot
        self.damage = active.per_robot(damage)
        self.reality = active.as_damage(reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            active.refuse(item, stages=STAGES, kind=self.model.kind, world=self.name)
        self.arena = (float(arena[0]), float(arena[1]))
        self.start = checked_start(start, self.arena)
        self.sample_dt = bounded("sample_dt", sample_dt, 0.02, 60.0, "s")
        self.port, self.camera, self.calibration = port, camera, calibration
        self.wheels = wheels
        self.log, self._rig, self.voids, self.on_void = log, rig, 0, on_void
        self.recording = recording

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on the robot, see `World.run`.

        Raises:
            BnsError: more than one list, commands that the robot cannot be told, no
                robot there.
            SafetyStop: the robot was stopped; it stands.
        """
        damages, seeds = shared(self.damage, seeds, len(commands))
        if not commands:
            return []
        if len(commands) > 1:
            raise BnsError(
                f"There is one robot, not {len(commands)}: give --replicates 1."
            )
        (given,) = commands
        limits = self.model.limits
        control.check(given, self.model.channels, limits, self.robot)
        rig = self.connected()
        stages = Stages.of(self.reality, damages[0], trial, given.duration)
        with rig.operator:
            return [self._tried(rig, given, stages, trial, seeds[0])]

    def connected(self) -> Rig:
        """The rig; opens it where that has not happened yet.

        Raises:
            BnsError: something is missing. Nothing has moved.
        """
        if self._rig is None:
            if not self.port:
                raise BnsError(
                    "World 'hardware' needs a robot: give --port DEVICE, or start "
                    "one with `bns hardware emulate khepera3`."
                )
            self._rig = connect(
                self.port,
                self.camera,
                calibration=self.calibration,
                wheels=self.wheels,
                limits=Limits(arena=self.arena),
                log=self.log or None,
            )
        return self._rig

    def ready(self) -> None:
        """See that a trial could begin.

        Raises:
            BnsError: it could not. Nothing has moved.
        """
        self.connected().mover().wait_for_sight()

    def close(self) -> None:
        """Give port and camera back."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None

    def _tried(
        self, rig: Rig, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        """A trial that went well; void ones are repeated."""
        faults, voids = len(rig.faults), []
        for _ in range(TRIES):
            try:
                return self._once(rig, given, stages, trial, seed, faults, voids)
            except Void as void:
                self.voids += 1
                voids.append(void.reason)
                rig.faults.note("void trial", str(trial), void.reason)
                self.on_void(trial, void.reason)
        raise BnsError(
            f"Trial {trial} was void {TRIES} times ({voids[-1]}): check the link and "
            "the light, then go on with --resume."
        )

    def _once(
        self,
        rig: Rig,
        given: Commands,
        stages: Stages,
        trial: int,
        seed: int,
        faults: int,
        voids: list[str],
    ) -> Trial:
        mover = rig.mover()
        volts = battery(rig.robot, rig.limits)
        stand = homing.go(mover, self.start)
        points = schedule.points(given, stages, seed, trial)
        begin = rig.clock.now()
        try:
            done = mover.perform(points, given.duration)
        except LinkError:
            self._rig = None if rig.leash is not None else rig
            raise
        conditions = stages.conditions(trial, seed) | {
            "battery": volts,
            "began": round(float(begin), 3),
            "first": round(float(done.switched[0]), 4),
            "start": [round(float(v), 5) for v in stand.pose],
            "late": round(float(done.late), 4),
            "faults": len(rig.faults) - faults,
            "voids": list(voids),
            "notes": done.notes,
            "firmware": list(rig.robot.version),
        }
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
