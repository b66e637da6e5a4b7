"""The real Khepera III as a world; with a lamp it steers by what its sensors read."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from typing import ClassVar

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.hardware.driving import homing, steering
from bns.hardware.driving.motion import Mover, Performed
from bns.hardware.driving.steering import GRID, Rules, Steered, Steering
from bns.hardware.rig import Rig, battery, connect
from bns.hardware.safety.limits import Limits
from bns.hardware.tracking.tracker import Sighting
from bns.hardware.worlds import records
from bns.hardware.worlds.real_robot import RealRobot
from bns.worlds import active, checks
from bns.worlds.active import Stages
from bns.worlds.checks import bounded
from bns.worlds.damage import Damage
from bns.worlds.effects.base import OpticsEffect
from bns.worlds.light import sensors
from bns.worlds.light import world as light_starts
from bns.worlds.light.closed_loop import Changes, Supervisor
from bns.worlds.light.law import Lamp, LightField
from bns.worlds.physics.session import LoopSignal
from bns.worlds.trial import POSE_CHANNELS, Commands, Trial
from bns.worlds.world import CYCLE, CYCLES, Policy


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


KEEP = 0.10  # m beyond the safety boundary, kept on the way to a start; assumed


@dataclass(eq=False)
class HardwareLight(HardwareWorld):
    """A real Khepera III that steers itself to a lamp, or an emulated one.

    What `HardwareWorld` is, and `drive`, as in `LightWorld`: the robot drives by sight
    to a random start, round the lamp, and then the controller has it. At the edge it is
    turned on the spot towards the centre, at the lamp's safety boundary it is stopped;
    the trial's clock stands still meanwhile. Software damage of the sensor stage
    changes the readings before the controller gets them.

    Args:
        lights: lamps as they stand on the board, as `Lamp` or as tables.
        ambient: irradiance that is everywhere [W/m2]; for the record only.
        supervisor: what happens at the lamp and at the edge, as `Supervisor` or as a
            table with its fields.
    """

    _: KW_ONLY
    lights: Sequence[Lamp | Mapping] = (Lamp(),)
    ambient: float = 0.02
    supervisor: Supervisor | Mapping | None = None

    stages: ClassVar[tuple[str, ...]] = (*HardwareWorld.stages, "sensor")

    def __post_init__(self, threads: int, rig: Rig | None) -> None:
        """Check the settings."""
        super().__post_init__(threads, rig)
        told = {} if self.supervisor is None else self.supervisor
        self._rules = self.supervisor = checks.one(Supervisor, "supervisor", told)
        self.field = LightField(checks.several(Lamp, "lamp", self.lights), self.ambient)
        self._places = self.field.positions[:, :2]
        if rig is not None:
            rig.limits = self._limits()

    def drive(
        self,
        policy: Policy,
        *,
        cycles: int = CYCLES,
        cycle: float = CYCLE,
        trial: int = 0,
        seeds: Sequence[int] = (),
        starts: np.ndarray | None = None,
    ) -> list[Trial]:
        """Let a controller drive the robot, see `LightWorld.drive`.

        Args:
            policy: the controller.
            cycles: commands of the trial, 1 to a million.
            cycle: duration of each, 0.2 to 60 [s].
            trial: its number, counted from 0.
            seeds: of what is random, one; without it and `starts` nothing is done.
            starts: pose in the world frame, ``(1, 3)`` [m, m, rad]; None = a random
                one.

        Raises:
            BnsError: more than one robot, a command that can not be, no robot there.
            SafetyStop: the robot was stopped.
        """
        many = len(seeds) if starts is None else len(starts)
        if not self._one(many):
            return []
        cycles = int(bounded("cycles", cycles, 1, 1e6, "1"))
        cycle = bounded("cycle", cycle, 0.2, 60.0, "s")
        stages, seed = self._stages(cycles * cycle, trial, seeds)
        rng = seeding.generator(seed, "world", trial, "start")
        edge = max(self._rules.edge, Limits.rim)
        start = (
            light_starts.anywhere(rng, self.arena, self._places, edge=edge)
            if starts is None
            else tuple(np.asarray(starts[0], float))
        )

        def once(rig: Rig) -> Trial:
            """The trial, on a connected rig."""
            volts = battery(rig.robot, rig.limits)
            mover, keep = rig.mover(), self._rules.safety + KEEP
            stand = homing.go(mover, start, lamps=self._places, keep=keep)
            steering = self._steering(mover, stages, seed, trial, cycles, cycle)
            begin = rig.clock.now()
            done = steering.perform(policy)
            about = self._about(rig, volts, float(begin), stand, done)
            conditions = stages.conditions(trial, seed) | about | self._light()
            return self._made(done, cycle, float(start[2]), conditions)

        return [self._tried(once, trial)]

    def _steering(
        self,
        mover: Mover,
        stages: Stages,
        seed: int,
        trial: int,
        cycles: int,
        cycle: float,
    ) -> Steering:
        channels = self.model.channels
        return Steering(
            mover,
            Rules(
                self._rules,
                self._places,
                self.arena,
                channels,
                self.model.limits,
                sensors.of("khepera3"),
            ),
            cycles=cycles,
            cycle=cycle,
            signal=LoopSignal(
                stages.control,
                steps=max(round(cycle / GRID), 1),
                cycles=cycles,
                dt=GRID,
                channels=tuple(channel.name for channel in channels),
                seed=seed,
                trial=trial,
            ),
            changes=Changes(stages.sensor, seed, trial),
            rng=seeding.generator(seed, "world", trial, "turns"),
        )

    def _made(
        self, done: Steered, cycle: float, yaw: float, conditions: dict[str, object]
    ) -> Trial:
        """The trial of what was carried out, with what was read after each cycle."""
        told = np.array(done.told)
        trial = records.trial(
            done,
            Commands(told, np.full(len(told), cycle), self.model.channels),
            sample_dt=self.sample_dt,
            start_yaw=yaw,
            robot=self.robot,
            world=self.name,
            conditions=conditions,
        )
        read = sensors.of("khepera3").virtual(np.array(done.readings))
        held = np.searchsorted(trial.boundaries, np.arange(len(trial.times)), "right")
        return trial.replace(
            observed=np.hstack([trial.observed, read[held - 1]]),
            channels=POSE_CHANNELS + sensors.VIRTUAL,
            handled=np.array(done.handled),
            outcome=trial.outcome._replace(
                stopped=done.stopped, edge_turns=done.turns, lamp_stops=done.stops
            ),
        )

    def _light(self) -> dict[str, object]:
        lamps = [asdict(lamp) for lamp in self.field.lamps]
        return {"lights": lamps, "ambient": self.field.ambient}

    def _limits(self) -> Limits:
        """Bounds of the session, the lamps among them."""
        lamps = tuple((float(x), float(y)) for x, y in self._places)
        return Limits(arena=self.arena, lamps=lamps)

    def _refuse_damage(self, damage: Damage) -> None:
        super()._refuse_damage(damage)
        for event in damage.events:
            if isinstance(event.effect, OpticsEffect):
                raise BnsError(
                    f"World {self.name!r} cannot represent {event.effect.name!r} in "
                    "software: take one that changes readings, such as sensor_gain."
                )
