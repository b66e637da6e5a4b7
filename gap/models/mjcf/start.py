"""Where a recorded trial of a user's own model begins: the state of the joints, and
what was told before."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import partial

import mujoco
import numpy as np

from bns.gap.models.mjcf import floating, prepared
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.view import View
from bns.worlds.physics.rollout import STATE as FULL
from bns.worlds.trial import Trial

STATE = "start"
"""condition of a trial that begins in motion: by joint, and way of a free body, its
position and speed (`Seen.state`); of a joint that hangs how far it is from there"""

UNSURE = "start_unsure"
"""condition of such a trial: by joint the standard deviations of these"""

NUMBERS = ("start_position", "start_speed")
"""numbers of a start that are not known, each with its joint in brackets"""

BEFORE, STEP = "told_before", "told_before_step"
"""conditions: commands before it, a row each, and the time between two [s]"""

STOOD = 0.3  # [s] over which a robot that nothing holds has left its first samples
HANGING = 5.0  # [s] after which what hangs is left where it is
RESTS = 1e-4  # [rad/s or m/s, rad or m] at most: it does
LIMP = 0.3  # of how far a joint hangs, by which it may hang elsewhere (assumed)
HELD = 1e9  # [kg m2 or kg] of inertia: does not move
CLEARLY = 0.25  # of the squared error, less of which says what held it


def free(model: mujoco.MjModel) -> frozenset[str]:
    """Names of the bodies and sites that a free joint carries."""
    free_joints = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    carried = np.isin(model.body_rootid, model.jnt_bodyid[free_joints])
    bodies = {model.body(b).name for b in np.flatnonzero(carried)}
    sites = np.flatnonzero(carried[model.site_bodyid])
    return frozenset(bodies | {model.site(s).name for s in sites})


def place(data: mujoco.MjData, trial: Trial, view: View) -> None:
    """Set the joints to where they were at the start of a trial.

    Joints whose state the trial's conditions hold get it, with their speeds; else those
    that were observed start at their first sample, at rest.

    Args:
        data: of the simulation; written to.
        trial: recorded trial.
        view: which joint each observed column is.
    """
    state = trial.conditions.get(STATE)
    if not isinstance(state, dict):
        seen = trial.observed[np.isfinite(trial.observed).all(axis=1)]
        view.place(data, seen[0])
        return
    bodies: dict[str, dict[str, Sequence[float]]] = {}
    free = {item.state: item for item in view.config.seen if item.floats}
    for name, (position, *speed) in state.items():
        if name in free:
            found = bodies.setdefault(free[name].part, {})
            found[free[name].way] = position, *speed
        elif speed:
            data.joint(name).qpos[0] = position
            data.joint(name).qvel[0] = speed[0]
    for body, found in bodies.items():
        places, speeds = ({w: x[k] for w, x in found.items()} for k in (0, 1))
        floating.place(data, data.model.body(body).id, places, speeds)


def relaxed(data: mujoco.MjData, joints: Sequence[str]) -> list[float]:
    """Where joints come to rest where all others are held, as a mast hangs on a cart
    that someone has put somewhere: at the turns of their swing.

    Args:
        data: of the simulation, its controls set; written to.
        joints: names of those that hang.
    """
    model = copy(data.model)
    numbers = [model.joint(joint).id for joint in joints]
    places, speeds = model.jnt_qposadr[numbers], model.jnt_dofadr[numbers]
    held = np.ones(model.nv, bool)
    held[speeds] = False
    model.dof_armature.reshape(model.nv, -1)[held] = HELD
    begun, act, fastest = data.qpos.copy(), data.act.copy(), 0.0
    for _ in range(round(HANGING / model.opt.timestep)):
        mujoco.mj_step(model, data)
        moving, begun[places] = data.qvel[speeds].copy(), data.qpos[places]
        data.qpos[:], data.qvel[:], data.act[:] = begun, 0.0, act
        if (speed := float(np.linalg.norm(moving))) > fastest:
            fastest, data.qvel[speeds] = speed, moving
        elif fastest < RESTS:
            break
        else:  # it passes where it would rest
            fastest = 0.0
    return [float(at) for at in begun[places]]


def _off(trial: Trial, joint: str) -> float:
    """How far a joint is from where it hangs when a trial begins, by its conditions."""
    state = trial.conditions.get(STATE)
    return float(state.get(joint, [0.0])[0]) if isinstance(state, dict) else 0.0


class Starts:
    """The states in which trials begin, and the control that holds a robot before.

    Args:
        config: the description.
        model: the nominal model; has its keyframe.
        view: where the observed channels are in a model.
    """

    def __init__(
        self,
        config: OwnConfig,
        model: mujoco.MjModel,
        view: Callable[[mujoco.MjModel], View],
    ):
        self.config, self.model, self._view = config, model, view
        self._states: dict[tuple, np.ndarray] = {}
        self._hung: dict[bytes, dict[str, tuple[float, float]]] = {}

    def rest(self, model: mujoco.MjModel) -> np.ndarray:
        """The control that holds a robot at rest, ``(nu,)``."""
        if self.config.keyframe:
            key = prepared.number(model, "key", self.config.keyframe)
            return np.array(model.key_ctrl[key])
        return np.zeros(model.nu)

    def state(self, trial: Trial, model: mujoco.MjModel) -> np.ndarray:
        """The full physics state ``(n,)`` that a trial begins in, kept: effects do not
        change it, but for those with a joint or a friction's bristles more, which begin
        at zero."""
        sizes = [mujoco.mj_stateSize(some, FULL) for some in (model, self.model)]
        model = self.model if sizes[0] == sizes[1] else model
        state = str(trial.conditions.get(STATE))
        key = (model.names, sizes[0], trial.observed[:1].tobytes(), state)
        if key not in self._states:
            self._states[key] = self.begun(trial, model)
        return self._states[key]

    def begun(self, trial: Trial, model: mujoco.MjModel) -> np.ndarray:
        """The same, ``(n,)``, worked out for a model."""
        data = prepared.posed(model, self.config.keyframe, 0.0)
        if self.config.recorded or STATE in trial.conditions:
            place(data, trial, self._view(model))
        for joint, (rest, _) in self.hung(trial).items():
            data.joint(joint).qpos[0] = rest + _off(trial, joint)
        state = np.empty(mujoco.mj_stateSize(model, FULL))
        data.time = 0.0
        mujoco.mj_getState(model, data, state, FULL)
        return state

    def stood(
        self, trial: Trial, lasting: float, told: np.ndarray | None
    ) -> np.ndarray:
        """Readings ``(C,)`` of the nominal model after it stood where a trial begins.

        Args:
            trial: recorded trial.
            lasting: how long it stood [s].
            told: commands ``(K,)``; None = the control at rest.
        """
        model, state = self.model, self.begun(trial, self.model)
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, state, FULL)
        data.ctrl[:] = self.rest(model)
        if told is not None:
            for item, value in zip(self.config.told, told, strict=True):
                data.actuator(item.actuator).ctrl[0] = value
        mujoco.mj_step(model, data, nstep=round(lasting / model.opt.timestep))
        mujoco.mj_getState(model, data, state, FULL)
        return self._view(model).read(model, state[None])[0]

    def hung(self, trial: Trial) -> dict[str, tuple[float, float]]:
        """Where joints hang that nobody observed [rad or m], as a trial begins at rest
        by the nominal model, and in the model's pose."""
        names = _hanging(self.model, self.config)
        if not names or UNSURE in trial.conditions:
            return {}
        key = trial.observed[:1].tobytes()
        if key not in self._hung:
            data = prepared.posed(self.model, self.config.keyframe, 0.0)
            pose = [float(data.joint(name).qpos[0]) for name in names]
            recorded = {k: v for k, v in trial.conditions.items() if k != STATE}
            place(data, trial.replace(conditions=recorded), self._view(self.model))
            data.ctrl[:] = self.rest(self.model)
            rest = relaxed(data, names)
            found = zip(rest, pose, strict=True)
            self._hung[key] = dict(zip(names, found, strict=True))
        return self._hung[key]


def _hanging(model: mujoco.MjModel, config: OwnConfig) -> list[str]:
    """Names of the hinges and slides that nobody observed, of a robot whose others
    begin where they were recorded: they hang there.

    Args:
        model: of the robot.
        config: the description.
    """
    return [] if not config.recorded or config.settle else unseen(model, config)


def unseen(model: mujoco.MjModel, config: OwnConfig) -> list[str]:
    """Names of the hinges and slides that nobody observed, of those that have one.

    Args:
        model: of the robot.
        config: the description.
    """
    seen = {item.part for item in config.seen if item.quantity in ("joint", "speed")}
    joints = filter(partial(prepared.hinged, model), range(model.njnt))
    names = (model.joint(joint).name for joint in joints)
    return [name for name in names if name and name not in seen]


def unsure(
    trial: Trial, config: OwnConfig, hung: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Standard deviations of the numbers of a trial's start that come from data, by
    name: "start_speed[elbow]".

    Args:
        trial: recorded trial.
        config: of the robot; its joints begin where they were seen if it says so.
        hung: where joints hang, and where they are in the model's pose.
    """
    found = trial.conditions.get(UNSURE)
    if isinstance(found, dict):
        return {
            f"{number}[{joint}]": float(sd)
            for joint, sds in found.items()
            for number, sd in zip(NUMBERS, sds, strict=True)
            if sd > 0
        }
    if not config.recorded:
        return {}
    sds = {item.state: item.noise for item in config.seen if item.state}
    far = {joint: abs(rest - pose) for joint, (rest, pose) in hung.items()}
    sds |= {joint: LIMP * away for joint, away in far.items() if away > RESTS}
    return {f"{NUMBERS[0]}[{joint}]": sd for joint, sd in sds.items()}


def moved(trial: Trial, off: Mapping[str, float], config: OwnConfig) -> Trial:
    """A trial that begins in another state.

    Args:
        trial: recorded trial.
        off: departures of numbers of its start, by name as in `unsure`.
        config: of the robot.
    """
    state = trial.conditions.get(STATE)
    if not isinstance(state, dict):
        seen = trial.observed[np.isfinite(trial.observed).all(axis=1)][0]
        told = [(item.state, at) for item, at in zip(config.seen, seen, strict=True)]
        state = {name: [float(at), 0.0] for name, at in told if name}
    hangs = {inside(name): [0.0] for name in off}
    state = {**hangs, **state}
    state = {
        joint: [
            value + off.get(f"{number}[{joint}]", 0.0)
            for number, value in zip(NUMBERS, values, strict=False)
        ]
        for joint, values in state.items()
    }
    return trial.replace(conditions={**trial.conditions, STATE: state})


def inside(name: str) -> str:
    """The joint, or way of a free body, of a number of a start."""
    return name.partition("[")[2].removesuffix("]")


def before(
    trial: Trial, rest: np.ndarray, count: int, config: OwnConfig, dt: float
) -> np.ndarray:
    """Commands at the physics steps before a trial, ``(count, C)``.

    Those that were recorded, and before them the first of these; at rest if none were.
    A trial that starts where it was recorded was told its first command before.

    Args:
        trial: recorded trial.
        rest: commands that hold the robot at rest, ``(C,)``.
        count: number of steps.
        config: of the robot.
        dt: physics step [s].
    """
    rows = trial.conditions.get(BEFORE)
    if not isinstance(rows, list) or not rows:
        first = trial.commands.values[0] if config.recorded else rest
        return np.tile(first, (count, 1))
    step = float(str(trial.conditions[STEP]))
    past = (np.arange(count, 0, -1)) * dt  # [s] before the start
    at = len(rows) - np.ceil(past / step - 1e-9).astype(int)
    return np.array(rows, dtype=float)[np.clip(at, 0, None)]


def held(
    trials: Sequence[Trial], config: OwnConfig, stood: Callable[..., np.ndarray]
) -> list[Trial]:
    """Trials with their first command told before them, too, if it held the robot where
    it was: the control at rest would have taken it from its first samples. A drone
    hovers, and muscles pull, when a log begins.

    Args:
        trials: recorded trials; what is known to have gone before some stays.
        config: of the robot.
        stood: readings ``(C,)`` after a robot stood where a trial begins for some
            seconds, under a control at rest or commands ``(K,)``.
    """
    unknown = [trial for trial in trials if not _known_before(trial)]
    if config.recorded or not unknown:
        return list(trials)
    lasting = max(config.settle, STOOD)
    noise = np.array([item.noise for item in config.seen])
    errors = np.zeros(2)
    for trial in unknown:
        seen = np.array([_first(column) for column in trial.observed.T])
        for number, told in enumerate((None, trial.commands.values[0])):
            away = (stood(trial, lasting, told) - seen) / noise
            errors[number] += np.sum(away**2, where=np.isfinite(seen))
    if not errors[1] < CLEARLY * errors[0]:
        return list(trials)
    return [trial if _known_before(trial) else _told_before(trial) for trial in trials]


def _known_before(trial: Trial) -> bool:
    return STATE in trial.conditions or BEFORE in trial.conditions


def _told_before(trial: Trial) -> Trial:
    first = trial.commands.values[:1].tolist()
    return trial.replace(conditions={**trial.conditions, BEFORE: first, STEP: STOOD})


def _first(column: np.ndarray) -> float:
    """The first of samples ``(T,)`` that was seen; NaN = none was."""
    seen = column[np.isfinite(column)]
    return float(seen[0]) if len(seen) else np.nan
