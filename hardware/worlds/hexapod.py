"""The real hexapod as a world: one at a time, in real time.

It is taken back to where a trial starts by sight, in small tripod steps. Three legs
swing while the other three push, in any direction and with any turn, so it walks
straight to the place without turning round first.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel import rig as rigs
from bns.hardware.dynamixel.bus import Overload
from bns.hardware.dynamixel.rig import HexapodRig
from bns.hardware.dynamixel.walker import SPEED, Walker
from bns.hardware.faults import Void
from bns.hardware.safety.limits import Limits
from bns.hardware.tracking.tracker import Sighting
from bns.hardware.worlds import records
from bns.hardware.worlds.real_robot import RealRobot
from bns.models import robot
from bns.models.phantomx import kinematics
from bns.models.phantomx.gait import ONE_SET
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
                stand = home(walker, self.start)
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


CLOSE = 0.04  # m from the start that will do
TURNED = np.deg2rad(8.0)  # off the start's heading that will do
STRIDE, TURN = 0.09, np.deg2rad(18.0)  # largest way and turn of a step
LIFT = 0.04  # m of a swinging foot
REACH, HEIGHT = 0.13, 0.12  # m of the feet from the hips, of the hips above them
TIME = 90.0  # s to get there
STEP = 2.0  # s, longest time of half a step


def home(walker: Walker, target: Sequence[float]) -> Sighting:
    """Walk to a pose and stand there.

    Args:
        walker: of the robot.
        target: (x, y, yaw) in the world frame [m, m, rad].

    Raises:
        SafetyStop: it was stopped.
        BnsError: it does not get there.
    """
    walker.rise()
    begin, swing = walker.clock.now(), ONE_SET
    seen = _halfway(walker)
    while not _there(seen, target):
        if walker.clock.now() - begin > TIME:
            walker.halt()
            raise BnsError(
                "The robot does not get back to the start: see that nothing is in its "
                "way, or put it there by hand."
            )
        _put(walker, _stance())
        for _ in range(_steps(seen, target)):
            _step(walker, swing, target)
            swing = ~swing
        seen = _halfway(walker)
    return seen


def _steps(seen: Sighting, target: Sequence[float]) -> int:
    """Steps until it should be there, at most a few before the feet are put right."""
    gap, turn = _gap(seen.pose, target)
    need = max(np.hypot(*gap) / STRIDE, abs(turn) / TURN)
    return int(np.clip(np.ceil(need), 1, 8))


def _step(walker: Walker, swing: np.ndarray, target: Sequence[float]) -> None:
    """One step towards the target as it is seen now."""
    gap, turn = _gap((walker.last or walker.wait_for_sight()).pose, target)
    away = float(np.hypot(*gap))
    way = gap * min(1.0, STRIDE / max(away, 1e-9))
    turn = float(np.clip(turn, -TURN, TURN))
    feet = _stance()
    ahead, behind = _moved(feet, way / 2, turn / 2), _moved(feet, -way / 2, -turn / 2)
    placed = np.where(swing[:, None], ahead, behind)
    raised = placed + np.column_stack([np.zeros((6, 2)), LIFT * swing])
    for each in (raised, placed):
        walker.go(_inside(each), STEP, wait=False)


def _halfway(walker: Walker) -> Sighting:
    """Stand with all servos half-way; where it then is."""
    if np.abs(walker.goals).max() > 1e-6:
        _put(walker, kinematics.feet(np.zeros(18)))
    walker.go(np.zeros(18), STEP)
    return walker.wait_for_sight()


def _put(walker: Walker, feet: np.ndarray) -> None:
    """Put the feet somewhere else, one tripod after the other."""
    now = kinematics.feet(walker.goals)
    for up in (ONE_SET, ~ONE_SET):
        lifted = np.where(up[:, None], feet + np.array([0, 0, LIFT]), now)
        walker.go(_inside(lifted), STEP, wait=False)
        now = np.where(up[:, None], feet, now)
        walker.go(_inside(now), STEP, wait=False)


def _stance() -> np.ndarray:
    """Feet in mid-stride, ``(6, 3)`` [m]."""
    s = kinematics.shape()
    out = np.column_stack([np.sin(s.heading), s.side * np.cos(s.heading)])
    return np.column_stack([s.hips + REACH * out, np.full(6, -HEIGHT)])


def _inside(feet: np.ndarray) -> np.ndarray:
    """Goals for feet, kept between the end stops."""
    low, high = robot("phantomx").ranges.T
    return np.clip(kinematics.goals(feet), low, high)


def _moved(feet: np.ndarray, way: np.ndarray, turn: float) -> np.ndarray:
    """Feet after the body's frame is moved by a way and a turn, shape ``(6, 3)``."""
    cos, sin = np.cos(turn), np.sin(turn)
    flat = feet[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + way
    return np.column_stack([flat, feet[:, 2]])


def _gap(pose: np.ndarray, target: Sequence[float]) -> tuple[np.ndarray, float]:
    """Way to the target in the robot's frame [m], and the turn [rad]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    gap = np.array([[cos, sin], [-sin, cos]]) @ (np.asarray(target[:2]) - pose[:2])
    return gap, float((target[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi)


def _there(seen: Sighting, target: Sequence[float]) -> bool:
    gap, turn = _gap(seen.pose, target)
    return float(np.hypot(*gap)) <= CLOSE and abs(turn) <= TURNED
