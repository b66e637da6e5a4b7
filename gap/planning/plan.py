"""The next command: what to run so that what is still tied comes apart.

Each excitation of a bounded family is simulated under the tied explanations. How far
two of them part there is the whitened distance of their predictions, after each
magnitude has been allowed to move as far as the recording so far leaves it free
(T-optimal discrimination, Atkinson and Fedorov 1975). Half its square is the expected
logarithm of the Bayes factor. Squares of distances add up over runs; where one command
leaves a pair, a second one is asked for besides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.stats import norm

from bns.errors import BnsError
from bns.gap import store
from bns.gap.models.base import GapModel
from bns.gap.planning import excitation as excite
from bns.gap.planning.excitation import Excitation
from bns.gap.planning.plan_runs import repeats, runs
from bns.gap.recordings import load_recordings
from bns.gap.records import Diagnosis, Fit
from bns.gap.where.compared import Compared
from bns.progress import Each, uncounted
from bns.worlds.effects.base import Effect, Parameter
from bns.worlds.trial import Commands, Trial

SAMPLE = 0.1  # [s] between the samples that a recording is assumed to have
MARGIN = 0.12  # [m] that a robot keeps from the edge of its arena
ARENA = (2.7, 1.8)  # [m] the board (thesis); its centre is where drives start
TIED = 8  # explanations that are compared, at most
LEVEL = 1.6449  # 90 % interval
FREE = 0.05  # share by which a magnitude without an interval may move


@dataclass(frozen=True, eq=False)
class Option:
    """One excitation and what it would tell.

    Attributes:
        excitation: the commands.
        distances: whitened, by pair of tied explanations, ``(pairs,)``.
        wrong: probability to name the wrong one of a pair after it, mean over pairs.
    """

    excitation: Excitation
    distances: np.ndarray
    wrong: float


@dataclass(frozen=True, eq=False)
class Plan:
    """What to run next.

    Attributes:
        tied: names of the tied explanations; fewer than two: nothing is tied.
        options: excitations, the best first; empty where nothing is tied.
        repeats: how often the best has to be run to part, in 9 of 10 cases, the pairs
            that it parts at all; 0 = no command of the family parts any.
        sentence: in words.
        alike: pairs of `tied`, by number, that no command of the family parts.
        steps: what to run and how often, the best option first; together they part
            all pairs that some command parts.
    """

    tied: tuple[tuple[str, ...], ...]
    options: tuple[Option, ...]
    repeats: int
    sentence: str
    alike: tuple[tuple[int, int], ...] = ()
    steps: tuple[tuple[Option, int], ...] = ()


def plan(
    found: Diagnosis,
    model: GapModel,
    *,
    family: Sequence[Excitation] = (),
    arena: tuple[float, float] = ARENA,
    seed: int = 0,
    each: Each = uncounted,
) -> Plan:
    """The command that best separates what a diagnosis left tied.

    Args:
        found: the diagnosis.
        model: the nominal model that it was made with.
        family: excitations to choose from; empty = those of the robot's kind.
        arena: size of the board [m] that a wheeled robot may not leave.
        seed: of the random excitations.
        each: goes through the excitations, and may count them.
    """
    fits = tied(found)
    if len(fits) < 2:
        return Plan(tuple(f.names for f in fits), (), 0, why_nothing(found))
    effects = [[store.parse(text, model) for text in fit.effects] for fit in fits]
    told = found.provenance.get("told", {})
    family = tuple(family) or _family(model, seed, told)
    family = _safe(family, model, effects, arena)
    made = [_option(item, found, model, fits, effects) for item in each(family)]
    names = tuple(fit.names for fit in fits)
    if not made:
        return Plan(names, (), 0, "No command of the family is safe in this arena.")
    return _ranked(names, made)


def _ranked(names: tuple[tuple[str, ...], ...], made: Sequence[Option]) -> Plan:
    """The options in order, what to run, and which pairs none of them parts."""
    pairs = list(combinations(range(len(names)), 2))
    table = np.array([option.distances for option in made])
    open_ = np.array([repeats(float(best)) > 0 for best in table.max(axis=0)])
    counted = open_ if open_.any() else np.ones(len(pairs), bool)
    wrong = norm.sf(table[:, counted] / 2).mean(axis=1)
    options = [
        Option(option.excitation, option.distances, float(chance))
        for option, chance in zip(made, wrong, strict=True)
    ]
    counts = runs(table[:, open_]) if open_.any() else {}
    first = list(counts)
    order = first + [at for at in np.argsort(wrong, kind="stable") if at not in first]
    steps = tuple((options[at], count) for at, count in counts.items())
    alike = tuple(p for p, parted in zip(pairs, open_, strict=True) if not parted)
    ranked = tuple(options[at] for at in order)
    said = in_words(names, steps or ((ranked[0], 0),), open_, alike)
    count = steps[0][1] if steps else 0
    return Plan(names, ranked, count, said, alike, steps)


def tied(found: Diagnosis) -> list[Fit]:
    """The fits between which the verdict could not decide."""
    if found.verdict.kind != "either":
        return [found.best] if found.verdict.named else []
    by_names = {frozenset(fit.names): fit for fit in found.fits}
    return [
        by_names[frozenset(names)]
        for names in found.verdict.named[:TIED]
        if frozenset(names) in by_names
    ]


def blank(
    commands: Commands,
    model: GapModel,
    name: str = "",
    conditions: Mapping[str, float] | None = None,
) -> Trial:
    """A trial that nobody has run yet: as the nominal model would do it.

    Args:
        commands: to be told.
        model: nominal model.
        name: of the world in which it will be run.
        conditions: of the trial, by name.
    """
    ends = np.concatenate([[0.0], np.cumsum(commands.durations)])
    grid = np.arange(0.0, ends[-1] + 1e-9, SAMPLE)
    times = np.unique(np.concatenate([grid, ends]).round(6))
    trial = Trial(
        commands=commands,
        times=times,
        observed=np.zeros((len(times), len(model.channels))),
        boundaries=np.searchsorted(times, ends.round(6)),
        channels=tuple(model.channels),
        robot=model.name,
        world=name,
        conditions=dict(conditions or {}),
    )
    ((seen,),) = model.simulate([trial], [()])
    return trial.replace(observed=seen)


def _family(
    model: GapModel, seed: int, told: Mapping[str, float]
) -> tuple[Excitation, ...]:
    if own := tuple(model.excitations(seed=seed, told=told)):
        return own
    limits = load_recordings.limits(model)
    if not limits:
        raise BnsError(
            f"No safe commands are known for {model.name!r}: give a family of "
            "excitations in Python (bns.gap.planning.plan.plan), or describe the robot "
            "in a TOML file with limits (docs/gap_your_robot.md)."
        )
    if set(limits) == {"left_speed", "right_speed"}:
        top = min(high for _, high, _ in limits.values())
        return excite.wheeled(seed=seed, fastest=excite.fastest(top))
    return excite.general(limits, seed=seed)


def _safe(
    family: Sequence[Excitation],
    model: GapModel,
    effects: Sequence[Sequence[Effect]],
    arena: tuple[float, float],
) -> list[Excitation]:
    """Those that stay on the board, whichever explanation is true."""
    if [channel.name for channel in model.channels][:2] != ["x", "y"]:
        return list(family)
    half = np.asarray(arena) / 2 - MARGIN
    trials = [blank(item.commands, model, "", item.conditions) for item in family]
    paths = model.simulate(trials, [(), *effects])
    return [
        item
        for number, item in enumerate(family)
        if all((np.abs(made[number][:, :2]) < half).all() for made in paths)
    ]


def _option(
    item: Excitation,
    found: Diagnosis,
    model: GapModel,
    fits: Sequence[Fit],
    effects: Sequence[Sequence[Effect]],
) -> Option:
    trial = blank(item.commands, model, "", item.conditions)
    moved = [_moved(fit, model) for fit in fits]
    unsure = _unsure(trial, model)
    sets = [*effects, *(row for rows in moved for row in rows)]
    made = _whitened(found, trial, model, sets, unsure)
    slopes: list[np.ndarray] = []
    shapes, at = made[: len(fits)], len(fits)
    slack = made[len(sets) :] - made[-1]
    for rows in moved:
        own = [made[at + k] - shapes[len(slopes)] for k in range(len(rows))]
        slopes.append(np.array([*own, *slack[:-1]]))
        at += len(rows)
    distances = np.array(
        [
            min(_apart(shapes, slopes, i, j), _apart(shapes, slopes, j, i))
            for i, j in combinations(range(len(fits)), 2)
        ]
    )
    return Option(item, distances, float(norm.sf(distances / 2).mean()))


def _unsure(trial: Trial, model: GapModel) -> list[dict[str, float]]:
    """Rows by which the nominal model may be off, one standard deviation each."""
    return [
        {row.name: row.nominal + row.slack}
        for row in model.rows([trial])
        if row.slack > 0 and row.smooth
    ]


def _whitened(
    found: Diagnosis,
    trial: Trial,
    model: GapModel,
    sets: Sequence[Sequence[Effect]],
    unsure: Sequence[Mapping[str, float]],
) -> np.ndarray:
    """Features in deviations: of sets of effects, of rows changed, and of the nominal
    model, ``(E + R + 1, N)``."""
    paths = model.simulate([trial], sets)
    paths += model.paths([trial], [[row] for row in (*unsure, {})])
    windows = model.joint_windows(trial)
    features = model.compare(trial, np.stack([path for (path,) in paths]), windows)
    known = found.floor
    if "features" in known:
        sd = np.array(known["features"], dtype=float) * np.sqrt(known["counted"])
    else:  # an earlier diagnosis
        sd = np.sqrt(Compared.diagnosed(found, [trial], model).noise(0, windows))
    return (features / sd).reshape(len(features), -1)


def _apart(shapes: np.ndarray, slopes: Sequence[np.ndarray], i: int, j: int) -> float:
    """Distance of i's prediction to j's, j's magnitudes free within what is known."""
    gap = np.nan_to_num(shapes[i] - shapes[j])
    if not len(slopes[j]):
        return float(np.linalg.norm(gap))
    rows = np.nan_to_num(slopes[j])
    # Magnitudes in units of their own deviation: a prior of variance 1.
    normal = rows @ rows.T + np.eye(len(rows))
    left = rows @ gap
    return float(np.sqrt(max(gap @ gap - left @ np.linalg.solve(normal, left), 0.0)))


def _moved(fit: Fit, model: GapModel) -> list[list[Effect]]:
    """The fit with each magnitude one standard deviation further."""
    effects = [store.parse(text, model) for text in fit.effects]
    rows = []
    for at, (name, interval) in enumerate(zip(fit.names, fit.intervals, strict=True)):
        about = _strength(name, effects[at])
        if about.integer:
            continue
        spread = (interval[1] - interval[0]) / 2 / LEVEL
        magnitude = float(effects[at][about.name])
        if spread <= 0:
            spread = FREE * max(abs(magnitude - about.nominal), 1e-9)
        value = magnitude + spread
        if value > about.high:
            value = magnitude - spread
        values = {**effects[at].values, about.name: max(value, about.low)}
        rows.append([*effects[:at], type(effects[at])(values), *effects[at + 1 :]])
    return rows


def _strength(name: str, effect: Effect) -> Parameter:
    """The parameter of an effect that an explanation's name stands for."""
    stem = name.partition("[")[0].partition("@")[0]
    strengths = [item for item in effect.parameters if item.scales]
    said = [item for item in strengths if item.name == stem.rpartition(".")[2]]
    return (said or strengths)[0]


def why_nothing(found: Diagnosis) -> str:
    """Why there is nothing to plan."""
    said = {
        "no gap": "no gap was found",
        "none of the library": "no effect of the library explains the gap",
    }
    reason = said.get(found.verdict.kind, "one explanation stands alone")
    return f"Nothing is tied: {reason}."


def in_words(
    names: Sequence[tuple[str, ...]],
    steps: Sequence[tuple[Option, int]],
    open_: np.ndarray,
    alike: Sequence[tuple[int, int]],
) -> str:
    """What to run, and what it will tell.

    Args:
        names: of the tied explanations.
        steps: options and how often to run each; 0 = it is no use.
        open_: which pairs some command parts, ``(pairs,)``.
        alike: pairs that no command parts.
    """
    words = [" + ".join(name) for name in names]
    tied_ = " or ".join(words)
    best, count = steps[0]
    if not count:
        return (
            f"Tied: {tied_}. No safe command of the family tells them apart (the best, "
            f"{best.excitation.name}, by {best.distances.max():.2g} deviations): they "
            "do the same whatever is commanded. Observe another quantity."
        )
    runs = ", and ".join(
        f"{_often(count)}: {option.excitation.name} "
        f"({option.excitation.commands.duration:.0f} s)"
        for option, count in steps
    )
    squares = sum(count * option.distances[open_] ** 2 for option, count in steps)
    parted = np.sqrt(squares)
    wrong = norm.sf(parted / 2).mean()
    text = (
        f"Tied: {tied_}. Run {runs}; {'that' if len(steps) > 1 else 'it'} parts them "
        f"by {parted.min():.2g} deviations (expected log Bayes factor "
        f"{parted.min() ** 2 / 2:.3g}, wrong one named {100 * wrong:.2g} %)."
    )
    for first, second in alike:
        text += f" No command parts {words[first]} from {words[second]}."
    return text


def _often(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")
