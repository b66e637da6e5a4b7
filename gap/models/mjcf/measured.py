"""Which part of a model a column of a log is seen of: by name, then by its motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column
from bns.gap.models.mjcf import inertial, matching, prepared, rehearsal, ties, view
from bns.gap.models.mjcf.channels import Work, joint_of, joints
from bns.gap.models.mjcf.described import AXES, PLACES, TURNS
from bns.gap.models.mjcf.rehearsal import Fit, Part
from bns.worlds.data.units import factor

REHEARSED = 5.0  # [s] of a trial that the nominal model moves along
AGREES = 0.5  # score from which on a column moves as the model says
SHARES = 60.0  # of 100, that joints of a dataset in shares of their range come to
SAME = "whose position that place is"
ALIKE = 0.1  # two parts whose scores are nearer cannot be told apart


def observed(work: Work, seen: list[Column]) -> None:
    """Which part each measurement is of: by name, then by how the model moves."""
    effort = [c for c in seen if matching.quantity(c) == tables.EFFORT]
    seen = [c for c in seen if c not in effort]
    if effort:
        work.guessed.append(
            f"left out, for no torque is compared: {', '.join(c.name for c in effort)}"
        )
    turned = matching.oriented(seen)
    seen = [c for c in seen if c not in turned]
    if turned:
        listed = ", ".join(c.name for c in turned)
        work.guessed.append(f"left out, for angles are compared: {listed}")
    model = work.model
    seen, spun = _inertial(work, seen)
    driven = [joint_of(model, model.actuator(a).id) for _, a, _ in work.told]
    driven = [joint for joint in joints(model) if joint in driven]
    found: dict[str, Part] = {}
    why: dict[str, str] = {}
    counts = {"site": model.nsite, "body": model.nbody, "tendon": model.ntendon}
    places = {
        kind: [getattr(model, kind)(n).name for n in range(count)]
        for kind, count in counts.items()
    }
    rest = [c for c in seen if c.name not in spun]
    speeds = [c for c in rest if matching.quantity(c) == tables.SPEED]
    others = [c for c in rest if c not in speeds]
    _, hits = matching.match(others, joints(model))
    jointed = {name for name, how in hits.items() if how not in matching.UNSURE}
    placed = [c for c in others if c.name not in jointed]
    named = matching.by_place(placed, places, _free(model))
    slides: dict[tuple[Part, ...], tuple[Part, ...]] = {
        (Part(rehearsal.BODY, *place),): (Part(rehearsal.JOINT, joint),)
        for place, joint in ties.slides(model).items()
    }
    named = {column: slides.get(parts, parts) for column, parts in named.items()} | spun
    for kind, group in (("speed", speeds), ("joint", others)):
        rest = [c for c in group if c.name not in named or c.name in joints(model)]
        # a flywheel is seen by its speed alone: what turns otherwise is another joint
        fast = [p.name for p in found.values() if p.quantity == "speed"]
        still = [joint for joint in joints(model) if joint not in fast]
        for parts in (joints(model), *([still] if fast else []), driven):
            left = [c for c in rest if c.name not in found]
            free = [p for p in parts if Part(kind, p) not in found.values()]
            hits, reasons = matching.match(left, free)
            found |= {name: Part(kind, part) for name, part in hits.items()}
            why |= reasons
    _rehearsed(work, seen, found, why, named)


def _inertial(
    work: Work, seen: list[Column]
) -> tuple[list[Column], dict[str, tuple[Part, ...]]]:
    """Columns without those of an inertial unit that nothing is compared with, and
    which gyro of the model some of them are of."""
    every = inertial.rates(seen, view.gyros(work.model))
    left = inertial.accelerations(seen)
    if left:
        listed = ", ".join(left)
        work.guessed.append(f"left out, for no acceleration is compared: {listed}")
    spun = {name: parts for name, parts in every.items() if parts}
    lost = [name for name in every if name not in spun]
    if lost:
        work.unsure.append(
            f"left out: {', '.join(lost)}, of a gyro that the model does not have: "
            "give it one (<gyro site=...>, with a name)"
        )
    return [column for column in seen if column.name not in (*left, *lost)], spun


def _rehearsed(
    work: Work,
    seen: Sequence[Column],
    found: dict[str, Part],
    why: Mapping[str, str],
    named: Mapping[str, tuple[Part, ...]],
) -> None:
    """Fill in what names do not tell by the nominal motion, units too."""
    drives = Drives(work, found)
    fitted = {
        column.name: drives.fits(
            column,
            [found[column.name]] if column.name in found else named[column.name],
        )
        for column in seen
        if column.name in found or column.name in named
    }
    for column in seen:
        if column.name not in fitted and matching.quantity(column) != tables.SPEED:
            fitted[column.name] = drives.fits(column, drives.free())
        _chosen(work, column, fitted, found, why, named.get(column.name, ()))
    work.unsure.extend(_shares(work))
    if not work.seen:
        raise BnsError(
            f"No column of {work.log} is a joint, site or body of {work.path}; call "
            f"them as its joints ({', '.join(joints(work.model))})."
        )


def _free(model: mujoco.MjModel) -> str:
    """The one body on a free joint, of several the one that is driven; "" = none is."""
    every = [
        model.body(number).name
        for number in range(model.nbody)
        if prepared.free_joint(model, number) >= 0
    ]
    for names in (every, prepared.loose(model)):
        if len(names) == 1:
            return str(names[0])
    return ""


def _units(model: mujoco.MjModel, part: Part, column: Column) -> dict[str, float]:
    known = dict(rehearsal.factors(model, part))
    said = matching.unit(column.name)
    if part.quantity == rehearsal.SPEED and said not in known:
        said = next(iter(known))  # of SI, unless it is said
    return {said: known[said]} if said in known else known


def _chosen(
    work: Work,
    column: Column,
    fitted: Mapping[str, Mapping[Part, Fit]],
    found: dict[str, Part],
    why: Mapping[str, str],
    named: tuple[Part, ...],
) -> None:
    fits = fitted.get(column.name, {})
    if not fits:
        work.unsure.append(f"{column.name}: of no part of the model, left out")
        return
    best = max(fits, key=lambda part: fits[part].score)
    fit = fits[best]
    called = column.name in found or len(named) == 1
    if not called and fit.score < AGREES:
        work.unsure.append(f"{column.name}: moves as no part of the model, left out")
        return
    unit = fit.unit
    if fit.score < AGREES:
        unit = _usual(best, _units(work.model, best, column), fitted)
    reason = why.get(column.name, "for it moves so")
    if named and column.name not in why:
        alike = matching.core(best.name) in matching.core(column.name)
        reason = "by its name" if alike else matching.ONLY
        reason = SAME if best.quantity == rehearsal.JOINT else reason
    found[column.name] = best
    line = f"{column.name}: {_said(best)} in {unit}, {reason}"
    work.seen.append((column, best, unit))
    near = [
        part
        for part, other in fits.items()
        if part != best and other.score > fit.score - ALIKE
    ]
    if near and best.quantity != "joint":
        line += "; moves alike: " + ", ".join(
            f"{p.quantity} {p.name}" for p in near[:2]
        )
    sure = fit.score > AGREES and reason not in (*matching.UNSURE, "for it moves so")
    placed = best.quantity in PLACES and best.axis in ("x", "y")
    headed = placed and bool(_free(work.model))  # it heads elsewhere than it began
    if fit.correlation < -AGREES and not headed:
        line += (
            "; it moves against the model: if its sign is another, give its line in "
            "[log] scale = -1"
        )
        sure = False
    elif fit.score <= AGREES:
        line += "; it hardly moves as the model does"
    (work.guessed if sure else work.unsure).append(line)


def _said(part: Part) -> str:
    """A part in words: "site 'toe' along z", "body 'base' yaw"."""
    axes = ["about" if part.quantity == rehearsal.GYRO else "along"]
    how = (axes if part.axis in AXES else []) + [part.axis]
    return " ".join([part.quantity, repr(part.name), *filter(None, how)])


def _shares(work: Work) -> list[str]:
    """A doubt about a LeRobot dataset in degrees that come near 100, not beyond: they
    may be shares of each joint's range."""
    read = [column.values for column, _, unit in work.seen if unit == "deg"]
    most = max((float(np.nanmax(np.abs(values))) for values in read), default=0.0)
    if "LeRobot" not in work.table.kind or not SHARES < most <= 100.0:
        return []
    return [
        "degrees: a LeRobot dataset may hold shares of each joint's range instead, "
        "from -100 to 100; then add to each line of [log] the scale, the degrees of "
        "half the range, over 100"
    ]


def _usual(
    part: Part,
    units: Mapping[str, float],
    fitted: Mapping[str, Mapping[Part, Fit]],
) -> str:
    """The unit of a part that hardly moves: that of other columns that move as the
    model does, of the same part if there are such; else that of SI.

    Args:
        part: of the model.
        units: that it may be in, SI first.
        fitted: fits of all columns.
    """
    others = [
        (other[:2] == part[:2], fit.score, fit.unit)
        for fits in fitted.values()
        for other, fit in fits.items()
        if fit.score >= AGREES and fit.unit in units
    ]
    return max(others)[2] if others else next(iter(units))


@dataclass(frozen=True, eq=False)
class Drives:
    """The nominal motion in some trials, to tell columns by it.

    Attributes:
        work: what is known of the log.
        found: which part each column is of, as far as that is known.
        moved: of each part, by first row of the trial.
    """

    work: Work
    found: dict[str, Part]
    moved: dict[int, dict[Part, np.ndarray]] = field(default_factory=dict)

    def free(self) -> list[Part]:
        """Joints and places that no column is of yet."""
        taken = set(self.found.values())
        every = self._moved(self._trial([c.values for c, _, _ in self.work.told]))
        placed = [p for p in every if p.quantity in ("joint", *PLACES)]
        return [p for p in placed if p.axis not in TURNS and p not in taken]

    def fits(self, column: Column, options: Sequence[Part]) -> dict[Part, Fit]:
        """How well a column agrees with parts: in the trial whose commands move most,
        and where none of these moves there, in the one in which the column does."""
        told = [c.values for c, _, _ in self.work.told]
        found: dict[Part, Fit] = {}
        for rows in (self._trial(told), self._trial([column.values])):
            moved = self._moved(rows)
            found = {
                part: rehearsal.fit(
                    column.values[rows],
                    moved[part],
                    _units(self.work.model, part, column),
                    joint=part.quantity == "joint",
                    turning=part.axis in TURNS,
                )
                for part in options
            }
            if any(np.isfinite(fit.score) for fit in found.values()):
                break
        return found

    def _trial(self, values: Sequence[np.ndarray]) -> np.ndarray:
        """Rows of the trial in which values move most, from its start on."""

        def spread(rows: np.ndarray) -> float:
            seen = (v[rows][np.isfinite(v[rows])] for v in values)
            return sum(float(np.ptp(v)) for v in seen if len(v))

        work = self.work
        rows = max(work.rows, key=spread)
        return rows[work.times[rows] <= work.times[rows[0]] + REHEARSED]

    def _moved(self, rows: np.ndarray) -> dict[Part, np.ndarray]:
        first = int(rows[0])
        if first not in self.moved:
            self.moved[first] = _from_start(self.work, rows, self.found)
        return self.moved[first]


def _from_start(
    work: Work, rows: np.ndarray, found: Mapping[str, Part]
) -> dict[Part, np.ndarray]:
    model, data = work.model, mujoco.MjData(work.model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    columns = {column.name: column.values for column in work.table.columns}
    for name, part in found.items():
        if part.quantity == "joint":
            values = columns[name][rows]
            first = values[np.isfinite(values)][:1]
            span = np.abs(values[np.isfinite(values)]).max(initial=0.0)
            if len(first) and span <= 2 * np.pi:
                data.joint(part.name).qpos[0] = first[0]
    return replayed(work, rows, data)


def replayed(
    work: Work, rows: np.ndarray, data: mujoco.MjData
) -> dict[Part, np.ndarray]:
    """What the model does of itself under the commands of some samples.

    Args:
        work: what is known of the log.
        rows: numbers of the samples, ``(T,)``.
        data: the model's state at the first of them; is changed.

    Returns:
        positions of all joints, named sites and bodies, each ``(T,)``.
    """
    told = np.stack([c.values[rows] * factor(unit) for c, _, unit in work.told], axis=1)
    actuators = [work.model.actuator(name).id for _, name, _ in work.told]
    times = work.times[rows] - work.times[rows[0]]
    return rehearsal.motions(work.model, data, actuators, times, np.nan_to_num(told))
