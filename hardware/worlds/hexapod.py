"""The real hexapod as a world: one at a time, in real time."""

import contextlib
from dataclasses import KW_ONLY, dataclass

import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel import home
from bns.hardware.dynamixel import rig as rigs
from bns.hardware.dynamixel.bus import Overload
from bns.hardware.dynamixel.rig import HexapodRig
from bns.hardware.dynamixel.walker import SPEED
from bns.hardware.faults import Void
from bns.hardware.safety.limits import Limits
from bns.hardware.worlds import records
from bns.hardware.worlds.real_robot import RealRobot
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.effects.base import ServoEffect
from bns.worlds.physics import control
from bns.worlds.physics.control import planned
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial

GRID = 0.02  # s; effects are computed on it


@dataclass(eq=False)
class HardwareHexapod(RealRobot[HexapodRig]):
    """A real PhantomX on its bus under a camera, or an emulated one.

    Its trials and settings are those of `RealRobot`. A command is a goal for every
    servo, until the robot rests, as in `HexapodWorld`. Software damage is of the
    command stage: it changes the goals before they are sent. A trial that was ended
    early (at the rim, by an overload) has NaN where it did not come to. After a safety
    stop torque is off.

    Args:
        servos: the robot's file of servos.
    """

    robot: str = "phantomx"
    _: KW_ONLY
    servos: str = ""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What a trial holds: the pose, then each servo's position."""
        readings = (Channel(f"{c.name}_position", c.unit) for c in self.model.commands)
        return (*POSE_CHANNELS, *readings)

    def ready(self) -> None:
        """See that a trial could begin, see `RealRobot.ready`."""
        self.connected().walker.wait_for_sight()

    def _refuse_robot(self) -> None:
        if self.model.kind != "legged":
            raise BnsError(f"This world walks; {self.robot!r} is {self.model.kind}.")

    def _refuse_damage(self, damage: Damage) -> None:
        kind = self.model.kind
        active.refuse(damage, stages=("command",), kind=kind, world=self.name)
        for event in damage.events:
            if isinstance(event.effect, ServoEffect):
                raise BnsError(
                    f"World 'hardware' cannot represent {event.effect.name!r} in "
                    "software: take one that changes what a leg is told, such as "
                    "leg_raised."
                )

    def _connect(self) -> HexapodRig:
        return rigs.connect(
            self.port,
            tuple(channel.name for channel in self.model.channels),
            self.camera,
            calibration=self.calibration,
            servos=self.servos,
            limits=Limits(arena=(self.arena[0], self.arena[1])),
            log=self.log or None,
        )

    def _once(
        self, rig: HexapodRig, given: Commands, stages: Stages, trial: int, seed: int
    ) -> Trial:
        walker = rig.walker
        goals, before = told(given, stages, seed, trial)
        try:
            with contextlib.ExitStack() as failed:
                failed.callback(walker.halt)
                volts = rigs.charged(rig.bus) if not walker.up else _lowest(rig)
                stand = home.go(walker, self.start)
                walker.go(before, 2.0)
                done = walker.perform(goals, given.durations.tolist())
                walker.rest()
                failed.pop_all()
        except Overload as error:  # on the way home; in a trial it ends the trial
            raise Void(error.reason) from error
        conditions = stages.conditions(trial, seed) | {
            "battery": volts,
            "start": [round(float(v), 5) for v in stand.pose],
            "speed": SPEED,
            "frames": done.frames,
            "missed": done.missed,
            "late": round(done.late, 4),
        }
        return records.walked_trial(
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

    Args:
        given: K commands.
        stages: effects that act on them.
        seed: of what is random in those.
        trial: its number, counted from 0.

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
