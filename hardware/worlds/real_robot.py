"""What every real robot does as a world: one at a time, void trials repeated."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, InitVar, dataclass, field
from typing import ClassVar, Generic, Protocol, TypeVar

from bns import models
from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.faults import FaultLog, SafetyStop, Void
from bns.hardware.rig import EMULATED
from bns.hardware.safety.limits import Operator
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.physics import control
from bns.worlds.trial import Commands, Trial

TRIES = 20  # of a trial that is void
ALONE = 10.0  # s for another program to close the port, before the session ends


class Connected(Protocol):
    """What a session with a robot has, whatever robot it is."""

    clock: Clock
    faults: FaultLog
    operator: Operator

    def others(self) -> list[str]:
        """Programs that have the port open as well, as "name (number)"."""
        ...

    def close(self) -> None:
        """Give port and camera back."""
        ...


RigT = TypeVar("RigT", bound=Connected)


@dataclass(eq=False)
class RealRobot(ABC, Generic[RigT]):
    """A robot on a port under a camera, real or emulated.

    A trial begins with the robot going back to the start by sight. Software damage
    changes what it is told. A trial that was disturbed is void and repeated.

    Args:
        robot: name of the robot's model.
        damage: software damage, with schedule.
        reality: the same, always on.
        sample_dt: time between two samples of a trial [s].
        start: pose at the start of each trial in the world frame [m, m, rad].
        arena: size of the board [m].
        threads: not used; the robot has its own processor.
        port: the robot's device; opened by the first trial.
        camera: number, video file, or "emulated".
        calibration: file of the camera's calibration.
        log: file for faults.
        on_void: called with number and reason whenever a trial is void.
        rig: an open one instead of port and camera (rehearsals in virtual time).

    Attributes:
        voids: trials that were void so far.

    Raises:
        BnsError: an effect that cannot be applied in software, a bad setting.
    """

    robot: str
    _: KW_ONLY
    damage: Damage | tuple = ()
    reality: Damage | Sequence = ()
    sample_dt: float = 0.1
    start: Sequence[float] = (0.0, 0.0, 0.0)
    arena: tuple[float, float] = (2.7, 1.8)
    threads: InitVar[int] = 1
    port: str = ""
    camera: str = EMULATED
    calibration: str = ""
    log: str = ""
    on_void: Callable[[int, str], None] = lambda trial, reason: None
    rig: InitVar[RigT | None] = None
    voids: int = field(default=0, init=False)

    name: ClassVar[str] = "hardware"

    def __post_init__(self, threads: int, rig: RigT | None) -> None:
        """Check the settings."""
        del threads
        self.model = models.robot(self.robot)
        self._refuse_robot()
        self.damage = active.per_robot(self.damage)
        self.reality = active.as_damage(self.reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            self._refuse_damage(item)
        self.arena = (float(self.arena[0]), float(self.arena[1]))
        self.start = checked_start(self.start, self.arena)
        self.sample_dt = bounded("sample_dt", self.sample_dt, 0.02, 60.0, "s")
        self._rig = rig

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on the robot, see `World.run`.

        Args:
            commands: one list.
            trial: its number, counted from 0; effects have their onset on it.
            seeds: of what is random, one or none.

        Returns:
            the trial; none for no list.

        Raises:
            BnsError: more than one list, commands that the robot cannot be told, no
                robot there.
            SafetyStop: the robot was stopped.
        """
        if not self._one(len(commands)):
            return []
        (given,) = commands
        control.check(given, self.model.channels, self.model.ranges, self.robot)
        stages, seed = self._stages(given.duration, trial, seeds)

        def once(rig: RigT) -> Trial:
            """The trial, on a connected rig."""
            return self._once(rig, given, stages, trial, seed)

        return [self._tried(once, trial)]

    def _one(self, robots: int) -> bool:
        """Whether there is anything to do, for one robot.

        Raises:
            BnsError: for more than one.
        """
        if robots > 1:
            raise BnsError(f"There is one robot, not {robots}: give --replicates 1.")
        return robots == 1

    def _stages(
        self, duration: float, trial: int, seeds: Sequence[int]
    ) -> tuple[Stages, int]:
        """What holds in a trial, and its seed."""
        damages, (seed,) = shared(self.damage, seeds, 1)
        return Stages.of(
            active.as_damage(self.reality), damages[0], trial, duration
        ), seed

    def connected(self) -> RigT:
        """The rig; opens it where that has not happened yet.

        Raises:
            BnsError: something is missing. Nothing has moved.
        """
        if self._rig is None:
            if not self.port:
                raise BnsError(
                    "World 'hardware' needs a robot: give --port DEVICE, or start "
                    f"one with `bns hardware emulate {self.robot}`."
                )
            self._rig = self._connect()
        return self._rig

    def close(self) -> None:
        """Give port and camera back; nothing moves on."""
        if self._rig is not None:
            rig, self._rig = self._rig, None
            rig.close()

    def _tried(self, once: Callable[[RigT], Trial], trial: int) -> Trial:
        """A trial that went well; void ones are repeated.

        Args:
            once: carries it out, once.
            trial: its number.

        Raises:
            BnsError: it was void too often.
            SafetyStop: void twice running by what a person has to mend.
        """
        rig, voids = self.connected(), list[str]()
        faults = len(rig.faults)
        with rig.operator:
            for _ in range(TRIES):
                _alone(rig)
                try:
                    made = once(rig)
                except Void as void:
                    if void.advice and voids[-1:] == [void.reason]:
                        raise SafetyStop(void.reason, void.advice) from void
                    self.voids += 1
                    voids.append(void.reason)
                    rig.faults.note("void trial", str(trial), void.reason)
                    self.on_void(trial, void.reason)
                    continue
                more = {"faults": len(rig.faults) - faults, "voids": voids}
                return made.replace(conditions={**made.conditions, **more})
        raise BnsError(
            f"Trial {trial} was void {TRIES} times ({voids[-1]}): check the link and "
            "the light, then go on with --resume."
        )

    @abstractmethod
    def ready(self) -> None:
        """See that a trial could begin.

        Raises:
            BnsError: it could not. Nothing has moved.
        """

    @abstractmethod
    def _refuse_robot(self) -> None:
        """Raise `BnsError` where this world cannot move such a robot."""

    @abstractmethod
    def _refuse_damage(self, damage: Damage) -> None:
        """Raise `BnsError` where damage cannot be applied in software."""

    @abstractmethod
    def _connect(self) -> RigT:
        """Open port and camera."""

    @abstractmethod
    def _once(
        self, rig: RigT, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        """Go to the start and carry out commands.

        Raises:
            Void: the trial was disturbed.
        """


def _alone(rig: Connected) -> None:
    """Wait until nobody else has the port open, who would take the robot's answers.

    Raises:
        BnsError: somebody keeps it open.
        SafetyStop: the operator says so.
    """
    begin = rig.clock.now()
    while others := rig.others():
        rig.operator.check()
        if rig.clock.now() - begin > ALONE:
            raise BnsError(
                f"Another program has the robot's port open, {', '.join(others)}: end "
                "it, then go on with --resume."
            )
        rig.clock.sleep(0.1)
