"""A walking robot's trial before it is run: models, start, goals in force."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.models import RobotModel, legs
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.effects.base import ControlSignal
from bns.worlds.effects.leg_sets import joints_named, named
from bns.worlds.physics import compile, control, observe, servo_law
from bns.worlds.physics.rollout import (
    Compiled,
    Piece,
    Segment,
    WalkJob,
)
from bns.worlds.trial import Commands

STAND = 1.0  # [s] at rest before a trial, so that it starts without a bounce; assumed


class Servos:
    """Where a compiled model has its servos, and their laws.

    Args:
        model: compiled.

    Attributes:
        laws: numbers of the servo law, each of shape ``(C,)``.
        angles, speeds: columns of full physics states, shape ``(C,)``.
        carried: points of the base that legs carry, see `observe.lies`.
    """

    def __init__(self, model: mujoco.MjModel):
        joints = model.actuator_trnid[:, 0]
        self.laws = servo_law.laws(model)
        self.angles = 1 + model.jnt_qposadr[joints]
        self.speeds = 1 + model.nq + model.jnt_dofadr[joints]
        self.carried = _carried(model)
        self._nq, self._nv = model.nq, model.nv

    def hidden(self, states: np.ndarray) -> dict[str, np.ndarray]:
        """Quantities by name from full physics states (time, qpos, qvel, ...)."""
        end = 1 + self._nq
        return {"qpos": states[:, 1:end], "qvel": states[:, end : end + self._nv]}


@lru_cache(maxsize=256)
def servos(scene: Compiled) -> Servos:
    """The servos of a compiled model."""
    return Servos(scene.model)


def _carried(model: mujoco.MjModel) -> np.ndarray:
    """The corners of the box `belly` and the femurs' hips, with a thigh's radius."""
    belly = model.geom("belly")
    signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    corners = np.column_stack([belly.pos + signs * belly.size, np.zeros(len(signs))])
    data = mujoco.MjData(model)
    data.qpos[compile.free_joint(model)] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_kinematics(model, data)
    hips = [
        [*data.body(f"{leg}_femur").xpos, model.geom(f"{leg}_femur").size[0]]
        for leg in legs.names(model.joint(at).name for at in model.actuator_trnid[:, 0])
    ]
    return np.vstack([corners, hips])


def timestep(robot: str) -> float:
    """Physics step of a robot [s]."""
    return float(compile.compiled(robot).model.opt.timestep)


def refuse_legless(damage: Damage, robot: RobotModel) -> None:
    """Stop if at some time no leg is left.

    Raises:
        BnsError: all legs are raised, limp or missing together, or a leg or joint is
            named that the robot does not have.
    """
    joints = [command.name for command in robot.commands]
    own = frozenset(legs.present(joints))
    for effect in (event.effect for event in damage.events):
        absent = named(effect) - own
        if absent:
            raise BnsError(
                f"{effect}: {robot.name!r} has no leg {min(absent)}; it has "
                f"{', '.join(legs.names(joints))}."
            )
        lacking = joints_named(effect) - {*joints, *legs.parts(joints)}
        if lacking:
            raise BnsError(
                f"{effect}: nothing of {robot.name!r} is called {min(lacking)!r}; its "
                f"legs move by {' and '.join(legs.parts(joints))}."
            )
    for onset in {event.onset_trial for event in damage.events}:
        held = [item.effect for item in damage.at(onset)]
        lost = frozenset().union(*(effect.lost() for effect in held))
        if lost == own:
            raise BnsError(
                f"{' and '.join(map(str, held))} take all {len(own)} legs away in "
                f"trial {onset}: leave the robot one at least."
            )


def refuse_fallen(
    robot: str, reality: Damage, start: tuple[float, float, float], channels: Sequence
) -> None:
    """Stop if the robot does not stand at the start of trial 0.

    Args:
        robot: by name.
        reality: effects of the real robot; without any nothing is checked.
        start: pose [m, m, rad].
        channels: the robot's commands.

    Raises:
        BnsError: it is tilted too far or lies on its belly, or the physics diverges.
    """
    if not reality.events:
        return
    stages = Stages.of(reality, Damage.none(), 0, 1.0)
    still = Commands(np.zeros((1, len(channels))), [1.0], tuple(channels))
    made, parts = job(robot, still, stages, start=start, speed=1.0, seed=0, trial=0)
    free = made.start[None, 1:8]
    upright = 1 - 2 * (free[0, 4] ** 2 + free[0, 5] ** 2)
    if not upright >= np.cos(observe.FALLEN) or observe.lies(free, parts.carried):
        raise BnsError(
            f"With {', '.join(stages.texts['reality'])} the robot starts fallen; leave "
            "it legs to stand on, or take a gentler effect."
        )


def job(
    robot: str,
    commands: Commands,
    stages: Stages,
    *,
    start: tuple[float, float, float],
    speed: float,
    seed: int,
    trial: int,
    counts: np.ndarray | None = None,
    step: float = 0.0,
) -> tuple[WalkJob, Servos]:
    """What the physics gets for one robot's trial.

    Args:
        robot: name of the model.
        commands: goals [rad], with the limits of their durations.
        stages: effects that hold in this trial.
        start: pose in the world frame [m, m, rad].
        speed: moving speed of the servos [rad/s].
        seed, trial: identity of what is random.
        counts: physics steps of each command, which then does not wait for the robot
            to rest; None = as planned.
        step: physics step [s]; 0 = the model's own.

    Raises:
        BnsError: an effect that changes the joints sets in within the trial.
    """
    dt = step or timestep(robot)
    limits = control.limits(commands, dt) if counts is None else counts
    counts = control.planned(commands, speed, dt) if counts is None else counts
    values, home = np.repeat(commands.values, counts, axis=0), commands.values[0] * 0
    if stages.control:
        told = control.signal(commands, counts, dt)
        values = control.disturbed(told, stages.control, seed, trial)
        home = _home(told, stages, seed, trial)
    segments = compile.segments(robot, stages.body, values, dt, step)
    first = segments[0].compiled
    _refuse_other_sizes(segments)
    laws, before, goals = servos(first).laws, home, []
    home = control.shaped(home[None], laws, home, dt)[0]
    for compiled, stretch in segments:
        laws = servos(compiled).laws
        goals.append(control.shaped(stretch, laws, before, dt))
        before = stretch[-1]
    ramps = control.ramps(np.concatenate(goals), home, speed * dt)
    cuts = np.cumsum([len(stretch) for _, stretch in segments])
    pieces = _pieces(segments, cuts, ramps, counts, limits)
    begin = stand(first, start, (home + 0.0).tobytes())  # -0 stands as 0 does
    return WalkJob(begin, pieces), servos(segments[-1].compiled)


def _home(told: ControlSignal, stages: Stages, seed: int, trial: int) -> np.ndarray:
    """Goals before the first command, after the effects, shape ``(C,)``."""
    still = ControlSignal(
        told.times[:1],
        np.zeros_like(told.values[:1]),
        told.command[:1],
        told.channels,
        told.dt,
    )
    return control.disturbed(still, stages.control, seed, trial)[0]


def _refuse_other_sizes(segments: Sequence[Segment]) -> None:
    if len({segment.compiled.model.nq for segment in segments}) > 1:
        raise BnsError(
            "An effect that adds joints (loose_horn) cannot set in or end within a "
            "trial; give its onset as a trial alone."
        )


def _pieces(
    segments: Sequence[Segment],
    cuts: np.ndarray,
    ramps: np.ndarray,
    counts: np.ndarray,
    limits: np.ndarray,
) -> tuple[Piece, ...]:
    """The trial cut where commands end and where the model changes."""
    ends = np.cumsum(counts)
    pieces, begun = [], 0
    for begin, end in pairwise(np.union1d([0], np.union1d(ends, cuts))):
        model = segments[int(np.searchsorted(cuts, begin, side="right"))].compiled
        command = int(np.searchsorted(ends, begin, side="right"))
        last = end == ends[command]
        limit = int(limits[command] - (begin - begun)) if last else 0
        pieces.append(Piece(model, ramps[begin:end], limit))
        begun = end if last else begun
    return tuple(pieces)


@lru_cache(maxsize=1024)
def stand(
    scene: Compiled, start: tuple[float, float, float], goals: bytes
) -> np.ndarray:
    """Full physics state of the robot at rest at its start pose, time 0.

    The robot is put down in its `home` pose and left alone for `STAND` seconds; what it
    drifts is undone.

    Args:
        scene: the compiled model.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        goals: of the servos [rad], the bytes of an array of shape ``(C,)``.
    """
    model = scene.model
    data = compile.put_down(model, start)
    hinges = np.flatnonzero(model.jnt_limited)
    at = model.jnt_qposadr[hinges]
    data.qpos[at] = np.clip(data.qpos[at], *model.jnt_range[hinges].T)
    rest = np.tile(np.frombuffer(goals), (round(STAND / model.opt.timestep), 1))
    return compile.at_rest(scene, data, start, rest)
