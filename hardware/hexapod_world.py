"""The real hexapod as a world: one at a time, in real time."""

from collections.abc import Callable, Sequence

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.hardware import walked
from bns.hardware.dynamixel import home
from bns.hardware.dynamixel import rig as rigs
from bns.hardware.dynamixel.bus import Overload
from bns.hardware.dynamixel.rig import HexapodRig
from bns.hardware.dynamixel.walker import SPEED
from bns.hardware.errors import LinkError, SafetyStop, Void
from bns.hardware.limits import Limits
from bns.hardware.rig import EMULATED
from bns.hardware.world import TRIES
from bns.worlds import active, control
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.effects.base import ServoEffect
from bns.worlds.legged_goals import planned
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial

GRID = 0.02  # s; effects are computed on it


class HardwareHexapod:
    """A real PhantomX on its bus under a camera, or an emulated one.

    A command is a goal for every servo, until the robot rests, as in `HexapodWorld`; a
    trial begins with the robot walking back to the start by sight. Software damage
    changes the goals before they are sent. A trial that was disturbed is void and
    repeated; one that was ended early (at the rim, by an overload) has NaN where it
    did not come to.

    Args:
        robot: "phantomx".
        damage: software damage, of the command stage, with schedule.
        reality: the same, always on.
        sample_dt: time between two samples of a trial [s].
        start: pose at the start of each trial in the world frame [m, m, rad].
        arena: size of the board [m].
        threads: not used; the robot has its own processors.
        port: the robot's device; opened by the first trial.
        camera: number, video file, or "emulated".
        calibration: file of the camera's calibration.
        servos: the robot's file of servos.
        log: file for faults.
        on_void: called with number and reason whenever a trial is void.

    Raises:
        BnsError: an effect that cannot be applied in software, a bad setting.
    """

    name = "hardware"

    def __init__(
        self,
        robot: str = "phantomx",
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
        servos: str = "",
        log: str = "",
        on_void: Callable[[int, str], None] = lambda trial, reason: None,
    ):
        del threads
        self.model = models.robot(robot)
        if self.model.kind != "legged":
            raise BnsError(f"This world walks; {robot!r} is {self.model.kind}.")
        self.robot = robot
        self.damage = active.per_robot(damage)
        self.reality = active.as_damage(reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            _refuse(item, self.model.kind)
        self.arena = (float(arena[0]), float(arena[1]))
        self.start = checked_start(start, self.arena)
        self.sample_dt = bounded("sample_dt", sample_dt, 0.02, 60.0, "s")
        readings = (Channel(f"{c.name}_position", c.unit) for c in self.model.commands)
        self.channels = (*POSE_CHANNELS, *readings)
        self.port, self.camera, self.calibration = port, camera, calibration
        self.servos, self.log, self.on_void = servos, log, on_void
        self._rig: HexapodRig | None = None
        self.voids = 0

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on the robot, see `World.run`.

        Raises:
            BnsError: more than one list, commands that the robot cannot be told, no
                robot there.
            SafetyStop: the robot was stopped; its torque is off.
        """
        damages, seeds = shared(self.damage, seeds, len(commands))
        if not commands:
            return []
        if len(commands) > 1:
            raise BnsError(
                f"There is one robot, not {len(commands)}: give --replicates 1."
            )
        (given,) = commands
        control.check(given, self.model.channels, self.model.ranges, self.robot)
        rig = self.connected()
        stages = Stages.of(self.reality, damages[0], trial, given.duration)
        with rig.operator:
            return [self._tried(rig, given, stages, trial, seeds[0])]

    def connected(self) -> HexapodRig:
        """The rig; opens it where that has not happened yet.

        Raises:
            BnsError: something is missing. Nothing has moved.
        """
        if self._rig is None:
            if not self.port:
                raise BnsError(
                    "World 'hardware' needs a robot: give --port DEVICE, or start "
                    "one with `bns hardware emulate phantomx`."
                )
            self._rig = rigs.connect(
                self.port,
                tuple(channel.name for channel in self.model.channels),
                self.camera,
                calibration=self.calibration,
                servos=self.servos,
                limits=Limits(arena=self.arena),
                log=self.log or None,
            )
        return self._rig

    def ready(self) -> None:
        """See that a trial could begin.

        Raises:
            BnsError: it could not. Nothing has moved.
        """
        self.connected().walker.wait_for_sight()

    def close(self) -> None:
        """Torque off; give port and camera back."""
        if self._rig is not None:
            rig, self._rig = self._rig, None
            rig.close()

    def _tried(
        self, rig: HexapodRig, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        """A trial that went well; void ones are repeated."""
        faults, voids = len(rig.faults), []
        for _ in range(TRIES):
            try:
                made = self._once(rig, given, stages, trial, seed)
            except Void as void:
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

    def _once(
        self, rig: HexapodRig, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        walker = rig.walker
        goals, before = told(given, stages, seed, trial)
        try:
            volts = rigs.charged(rig.bus) if not walker.up else _lowest(rig)
            stand = home.go(walker, self.start)
            walker.go(before, 2.0)
            done = walker.perform(goals, given.durations)
            walker.rest()
        except Overload as error:  # on the way home; in a trial it ends the trial
            walker.halt()
            raise Void(error.reason) from error
        except (SafetyStop, LinkError):
            walker.halt()
            raise
        conditions = stages.conditions(trial, seed) | {
            "battery": volts,
            "start": [round(float(v), 5) for v in stand.pose],
            "speed": SPEED,
            "frames": done.frames,
            "missed": done.missed,
            "late": round(done.late, 4),
        }
        return walked.trial(
            done,
            given,
            sample_dt=self.sample_dt,
            start_yaw=self.start[2],
            robot=self.robot,
            world=self.name,
            channels=self.channels,
            conditions=conditions,
        )


def told(
    given: Commands, stages: Stages, seed: int, trial: int
) -> tuple[np.ndarray, np.ndarray]:
    """Goals as they are sent.

    Returns:
        of each command, ``(K, 18)``, and before the first one, ``(18,)`` [rad].
    """
    counts = planned(given, SPEED, GRID)
    signal = control.signal(given, counts, GRID)
    values = control.disturbed(signal, stages.control, seed, trial)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    still = Commands(given.values[:1] * 0, given.durations[:1], given.channels)
    quiet = control.signal(still, counts[:1], GRID)
    return values[first], control.disturbed(quiet, stages.control, seed, trial)[0]


def _lowest(rig: HexapodRig) -> float:
    return min(state.voltage for state in rig.bus.states.values())


def _refuse(damage: Damage, kind: str) -> None:
    active.refuse(damage, stages=("command",), kind=kind, world="hardware")
    for event in damage.events:
        if isinstance(event.effect, ServoEffect):
            raise BnsError(
                f"World 'hardware' cannot represent {event.effect.name!r} in software: "
                "take one that changes what a leg is told, such as leg_raised."
            )
