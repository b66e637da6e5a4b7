"""How the trials of a log begin: on a stand or free, at rest in a pose or not."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from bns.gap.importers.tables import Column
from bns.gap.models.mjcf import guesses, prepared, start
from bns.gap.models.mjcf.channels import Work, compiled, tolds
from bns.gap.models.mjcf.described import AXES, TURNS
from bns.gap.models.mjcf.measured import replayed
from bns.worlds.data.units import factor

HELD = 0.5  # of the error on the ground, less of which says that a stand holds a robot

HIGH = 0.3  # [m] above where it would stand: it does not (assumed)


def hold(work: Work) -> None:
    """Whether a stand holds the robot: there is nothing to stand on, or its joints move
    much more like that than like those of a robot on the ground.

    Args:
        work: what was found; gets `held`, and the model of a robot that is.
    """
    bodies = tuple(prepared.loose(work.model))
    carried = start.free(work.model)
    if not bodies or any(
        part.name in carried
        and (part.axis in AXES or (part.axis in TURNS and _turned(work, column)))
        for column, part, _ in work.seen
    ):
        return
    held = replace(work, model=compiled(work.path, tolds(work), bodies))
    why = "the model has nothing to stand on"
    if prepared.grounded(work.model):
        why = "its joints move like that, not like those of a robot on the ground"
        longest = max(work.rows, key=len)
        rows = longest[work.times[longest] <= work.times[longest[0]] + guesses.CUT]
        errors = [_missed(each, rows, _stood(each, rows)) for each in (held, work)]
        if not errors[0] <= HELD * errors[1]:  # nor where one diverged
            return
    work.held, work.model = bodies, held.model
    work.unsure.append(
        f"held: a stand holds {' and '.join(map(repr, bodies))} off the ground, for "
        f"{why}; delete `held` if none does"
    )


def _turned(work: Work, column: Column) -> bool:
    """Whether something turned while it was recorded, which no stand lets it."""
    pieces = [column.values[rows] for rows in work.rows]
    span = max(float(np.nanmax(piece) - np.nanmin(piece)) for piece in pieces)
    return span > 2 * guesses.SIGMAS * guesses.noise(pieces)


def begin(work: Work) -> None:
    """How trials begin: at rest in a pose, or where they were; cut or not.

    Args:
        work: what was found; gets `start`.
    """
    told = np.stack([c.values for c, _, _ in work.told], axis=1)
    longest = max(work.rows, key=len)
    span = float(np.ptp(work.times[longest]))
    heads = _heads(work)
    first = {joint: float(np.median(head.at)) for joint, head in heads.items()}
    pose, settle = _rest(work, longest, heads, first)
    loose = bool(start.free(work.model))
    if span > guesses.LONG and guesses.curved(told[longest], span) and not loose:
        work.start = {"recorded": True, "cut": guesses.CUT}
        work.start |= {"keyframe": pose} if pose else {}
        work.guessed.append(
            f"start: one long recording, cut into pieces of {guesses.CUT:g} s that "
            "begin with the positions and speeds of the data"
        )
    elif pose is None and loose:
        pose = guesses.nearest(work.model, first)
        stands = _stands(work, pose)
        work.start = {"recorded": True}
        work.start |= {"keyframe": pose} if pose else {}
        work.start |= {"settle": guesses.SETTLE} if stands else {}
        how = f"settling on the floor for {guesses.SETTLE:g} s" if stands else "aloft"
        work.unsure.append(
            "start: the robot is free and trials begin in no pose of the model, so "
            f"each begins where it was recorded, {how}; give a keyframe for the rest"
        )
    elif pose is None:
        work.start = {"recorded": True}
        work.unsure.append(
            "start: trials begin in no pose of the model at rest, so each begins where "
            "its joints were recorded; give a keyframe for the rest"
        )
    else:
        work.start = {"keyframe": pose} if pose else {}
        what = f"keyframe {pose!r}" if pose else "the model's own pose"
        if any(head.varies for head in heads.values()) and (
            not (settle or loose) or _put(work, pose, settle, heads)
        ):
            work.start |= {"recorded": True}
            how = f"at rest near {what}, where its joints were recorded in each trial"
        else:
            work.start |= {"settle": settle} if settle else {}
            how = f"at rest in {what}, settling for {settle:g} s"
        work.guessed.append(f"start: {how}")


def _rest(
    work: Work,
    longest: np.ndarray,
    heads: Mapping[str, "_Head"],
    first: Mapping[str, float],
) -> tuple[str | None, float]:
    """The pose in which trials begin, as `guesses.rests` finds it, and how long the
    robot settles there [s].

    Args:
        work: what is known of the log.
        longest: rows of the longest trial.
        heads: where each joint is at the start of trials.
        first: their medians.
    """
    tolerance = {joint: head.tolerance for joint, head in heads.items()}
    pose, settle = guesses.rests(work.model, first, tolerance)
    if settle and not _settled(work, longest, pose or "", settle):
        return pose, 0.0
    varies = any(head.varies for head in heads.values())
    if pose is not None and not settle and not varies:
        beside = _beside(work.model, pose, heads)
        return pose, guesses.returning(work.model, pose, beside)
    return pose, settle


class _Head(NamedTuple):
    """Where a joint is at the start of trials.

    Attributes:
        at: in each trial, ``(n,)``.
        noise: standard deviation of its measurement.
        span: of all that it did.
    """

    at: np.ndarray
    noise: float
    span: float

    @property
    def varies(self) -> bool:
        """Whether it differs from trial to trial by more than noise."""
        return bool(np.ptp(self.at) > 2 * guesses.SIGMAS * self.noise)

    @property
    def tolerance(self) -> float:
        """By how much their median may be off a pose."""
        return max(guesses.SIGMAS * self.noise, guesses.NEAR * self.span)

    def beside(self, place: float) -> bool:
        """Whether it is not at a place, by more than the noise of all trials."""
        error = self.noise / np.sqrt(len(self.at))
        return bool(abs(self.at.mean() - place) > guesses.SIGMAS * error)


def _heads(work: Work) -> dict[str, _Head]:
    """Where each joint is at the start of trials."""
    found = {}
    for column, part, unit in work.seen:
        if part.quantity == "joint":
            pieces = [column.values[rows] * factor(unit) for rows in work.rows]
            at = np.concatenate([p[np.isfinite(p)][:1] for p in pieces])
            span = float(np.nanmax(column.values) - np.nanmin(column.values))
            found[part.name] = _Head(at, guesses.noise(pieces), span * factor(unit))
    return found


def _beside(
    model: mujoco.MjModel, pose: str, heads: Mapping[str, _Head]
) -> dict[str, float]:
    """Joints that are not where a pose has them, and where: what is to be found
    took them there."""
    data = prepared.posed(model, pose, 0.0)
    return {
        joint: float(head.at.mean())
        for joint, head in heads.items()
        if head.beside(float(data.joint(joint).qpos[0]))
    }


def _stands(work: Work, pose: str) -> bool:
    """Whether a free robot stands on something where trials begin: in a pose it settles
    on the floor, as high as it was seen if that was."""
    data = prepared.posed(work.model, pose, guesses.SETTLE)
    for column, part, unit in work.seen:
        if part.quantity == "body" and part.axis == "z":
            at = np.nanmedian([column.values[rows[:1]] for rows in work.rows])
            if abs(data.body(part.name).xpos[2] - at * factor(unit)) > HIGH:
                return False
    return bool(data.ncon)


def _stood(work: Work, rows: np.ndarray) -> mujoco.MjData:
    """The model after it has settled where its joints were seen first."""
    first = {}
    for column, part, unit in work.seen:
        seen = column.values[rows][np.isfinite(column.values[rows])]
        if part.quantity == "joint" and len(seen):
            first[part.name] = float(seen[0]) * factor(unit)
    data = prepared.posed(work.model, guesses.nearest(work.model, first), 0.0)
    for joint, at in first.items():
        data.joint(joint).qpos[0] = at
    for column, actuator, unit in work.told:
        data.actuator(actuator).ctrl[0] = column.values[rows[0]] * factor(unit)
    mujoco.mj_step(
        work.model, data, nstep=round(guesses.SETTLE / work.model.opt.timestep)
    )
    data.time = 0.0
    return data


def _settled(work: Work, rows: np.ndarray, pose: str, settle: float) -> bool:
    """Whether a trial begins as a robot does that has come to rest in a time [s], not
    as one that was let go: by which of the two predicts its first samples better."""
    rows = rows[work.times[rows] <= work.times[rows[0]] + guesses.SETTLE]
    errors = [
        _missed(work, rows, prepared.posed(work.model, pose, lasting))
        for lasting in (settle, 0.0)
    ]
    return errors[0] <= errors[1]


def _put(work: Work, pose: str, settle: float, heads: Mapping[str, "_Head"]) -> bool:
    """Whether joints begin where someone has put them, each time elsewhere, not where
    the robot came to rest: by which of the two predicts their first samples better, in
    all trials."""
    errors = np.zeros(2)
    begun = [joint for joint, head in heads.items() if len(head.at) == len(work.rows)]
    for number, rows in enumerate(work.rows):
        rows = rows[work.times[rows] <= work.times[rows[0]] + guesses.SETTLE]
        rested = prepared.posed(work.model, pose, settle)
        found = prepared.posed(work.model, pose, 0.0)
        for joint in begun:
            found.joint(joint).qpos[0] = heads[joint].at[number]
        errors += [_missed(work, rows, data, begun) for data in (rested, found)]
    return bool(errors[1] < errors[0])


def _missed(
    work: Work,
    rows: np.ndarray,
    data: mujoco.MjData,
    joints: Collection[str] | None = None,
) -> float:
    """Squared error of the model from a state on, of the columns' variances, summed:
    of all columns, or of those of some joints."""
    made = replayed(work, rows, data)
    return sum(
        float(
            np.nanmean((column.values[rows] * factor(unit) - made[part]) ** 2)
            / np.nanvar(column.values * factor(unit))
        )
        for column, part, unit in work.seen
        if part in made
        and (joints is None or (part.quantity == "joint" and part.name in joints))
    )
