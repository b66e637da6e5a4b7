"""How large a gap is beyond what measuring it scatters, and whether it recurs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from bns import seeding
from bns.gap.decomposition.evidence.latent import Latent
from bns.gap.decomposition.problem import Problem
from bns.gap.recordings import trial_conditions

THIRD = np.sqrt(20.0)  # third differences of noise: 1 + 9 + 9 + 1
NORMAL = 1.4826
DRAWS = 8  # of measurement noise, for what it does to features
WILD = 8.0  # deviations of a full fit beyond which a window is left out
APART = (0.6, 2.0)  # [s] between windows whose errors are compared: beyond a window's
# length, so that they share no sample
PIECE = 2.0  # [s] of a trial that count as independent
SHORT = 0.5  # [s] that do once an autoregression is taken out
APART_BY = 30.0  # times the square of its repeat's error: another way
ANYWHERE = 30.0  # deviations of the floor, and times the variance of other trials
PAIRS = 3  # of repeats from which one may stray
SEARCHED = 1.0  # standard errors that the best of some ten lags exceeds by chance
SURE = 3.0  # standard errors from which an error is said to recur
OVER = (0.0, 0.3, 1.0)  # [s] over which errors of repeats are compared; 0 = as they are
OUTLYING = 4.0  # root mean squares beyond which one error counts no more


@dataclass(frozen=True, eq=False)
class Floor:
    """What measuring alone scatters.

    Attributes:
        sigma: of each observed channel, ``(n_channels,)``.
        sd: of each feature of each window, ``(N, C)``.
    """

    sigma: np.ndarray
    sd: np.ndarray


def floor(problem: Problem, latent: Latent, *, seed: int = 0) -> Floor:
    """The measurement's scatter, from third differences of the recording.

    What moves slowly against the sampling drops out of these, jitter of the time stamps
    does not. To it comes what is not known of trials.

    Args:
        problem: the recording.
        latent: what is not known of its trials.
        seed: of the noise that is drawn.
    """
    count = len(problem.model.channels)
    found = [trial_conditions.third_differences(trial) for trial in problem.trials]
    sigma = NORMAL * np.median(np.concatenate(found)[:, :count], axis=0) / THIRD
    rng = seeding.generator(seed, "gap", "floor")
    squares = np.zeros_like(problem.recorded)
    for _ in range(DRAWS):
        parts = []
        for trial, windows in zip(problem.trials, problem.windows, strict=True):
            seen = trial.observed[:, :count]
            moved = seen + sigma * rng.standard_normal(seen.shape)
            parts.append(problem.model.compare(trial, moved, windows))
        squares += (np.concatenate(parts) - problem.recorded) ** 2
    mean = np.nanmean(squares / DRAWS, axis=0)
    sd = np.sqrt(np.broadcast_to(mean, squares.shape))
    sd = np.hypot(np.maximum(sd, problem.model.least), latent.spread)
    return Floor(sigma, sd)


def kept(problem: Problem, left: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Windows that are no wild points in a full fit's rest, ``(N, C)``.

    Args:
        problem: the recording.
        left: residuals of the full fit, ``(N, C)``.
        sd: their standard deviations, ``(N, C)``.
    """
    with np.errstate(invalid="ignore"):
        return problem.seen & (np.abs(left) < WILD * sd)


def unstable(
    problem: Problem, slopes: Mapping[int, np.ndarray], known: Floor
) -> np.ndarray:
    """Windows of trials that may go anywhere, ``(N,)``.

    A pendulum that just reaches the top goes on or falls back with what lies within the
    slack of the model, and tells nothing of what lies beyond.

    Args:
        problem: the recording.
        slopes: derivatives by number of the row, each ``(N, C)``.
        known: the floor.
    """
    rows = problem.rows
    loose = [
        (slope * (rows[k].sd if rows[k].nuisance else rows[k].slack) / known.sd) ** 2
        for k, slope in slopes.items()
    ]
    spread = np.sum(loose, axis=0).mean(axis=1)
    size = by_trial(problem, spread)
    far = (size > ANYWHERE**2) & (size > ANYWHERE * np.median(size))
    return far[problem.trial]


def strayed(problem: Problem, rest: np.ndarray, known: Floor) -> np.ndarray:
    """Windows of a trial that went another way than its repeat, ``(N,)``.

    One pair of several has to disagree: where more do, something has changed.

    Args:
        problem: the recording.
        rest: residuals, ``(N, C)``.
        known: the floor.
    """
    units = (np.nan_to_num(rest) / known.sd) ** 2
    size = by_trial(problem, units.mean(axis=1))
    pairs = repeats(problem)
    apart = [
        (one, other)
        for one, other in pairs
        if max(size[one], size[other])
        > APART_BY * max(1.0, min(size[one], size[other]))
    ]
    if len(apart) != 1 or len(pairs) < PAIRS:
        return np.zeros(len(problem.trial), dtype=bool)
    return problem.trial == max(apart[0], key=lambda n: size[n])


def by_trial(problem: Problem, values: np.ndarray) -> np.ndarray:
    """Mean of values ``(N,)`` over the windows of each trial."""
    count = np.maximum(np.bincount(problem.trial), 1)
    return np.bincount(problem.trial, values) / count


def excess(rest: np.ndarray, known: Floor, inside: np.ndarray) -> float:
    """Mean square of residuals in units of the floor, beyond the floor's own.

    Args:
        rest: residuals, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """
    count = inside.sum(axis=0)
    return float(_by_feature(rest, known, inside) @ count / max(count.sum(), 1))


def most(rest: np.ndarray, known: Floor, inside: np.ndarray) -> float:
    """The same of the feature in which it is largest: one joint of twelve.

    Args:
        rest: residuals, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """
    return float(_by_feature(rest, known, inside).max(initial=0.0))


def beyond(
    rest: np.ndarray, motion: np.ndarray, known: Floor, inside: np.ndarray, share: float
) -> float:
    """The same, beyond a share of what each feature itself moves: that one moves far
    does not excuse the rest of another.

    Args:
        rest: residuals, ``(N, C)``.
        motion: recorded features, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
        share: of the motion.
    """
    count = inside.sum(axis=0)
    allowed = share**2 * np.maximum(_by_feature(motion, known, inside), 1.0)
    more = np.maximum(_by_feature(rest, known, inside) - allowed, 0.0)
    return float(more @ count / max(count.sum(), 1))


def sizes(
    rest: np.ndarray, known: Floor, inside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square of each feature, ``(C,)``, and what of it is beyond the floor,
    ``(C,)``: averaged where the floor is low, as `excess` is. The last windows of an
    unstable robot's pieces may be anywhere, and would hide it.

    Args:
        rest: residuals, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """
    count = np.maximum(inside.sum(axis=0), 1)
    square = np.where(inside, np.nan_to_num(rest) ** 2, 0.0).sum(axis=0) / count
    weight = np.where(inside, 1 / known.sd**2, 0.0).sum(axis=0) / count
    beyond = _by_feature(rest, known, inside) / np.maximum(weight, 1e-300)
    return np.sqrt(square), np.sqrt(np.clip(beyond, 0.0, square))


def _by_feature(values: np.ndarray, known: Floor, inside: np.ndarray) -> np.ndarray:
    """Mean square of each feature in units of the floor, less one, ``(C,)``."""
    units = np.where(inside, np.nan_to_num(values) / known.sd, 0.0)
    made: np.ndarray = (units**2).sum(axis=0) / np.maximum(inside.sum(axis=0), 1) - 1.0
    return made


def recurrence(
    problem: Problem, rest: np.ndarray, sd: np.ndarray, *, piece: float = PIECE
) -> float:
    """Standard errors by which errors of windows that share no sample go together.

    Products of a residual with later ones of its trial, and with those at the same time
    of trials that were told the same, are 0 in the mean for what only scatters. Either
    all lags say it together or one of them does, positive or negative: an error that
    swings recurs, too.

    Args:
        problem: the recording.
        rest: residuals, ``(N, C)``.
        sd: of them.
        piece: seconds whose sum counts as one independent value.
    """
    units = np.clip(np.nan_to_num(rest) / sd, -4, 4)
    part = _pieces(problem, piece)
    count = int(part.max()) + 1
    lags: dict[int, np.ndarray] = {}
    for number, windows in enumerate(problem.windows):
        rows = np.flatnonzero(problem.trial == number)
        if len(rows) < 2:
            continue
        step = max(float(np.median(np.diff(windows.times))), 1e-6)
        first = max(round(APART[0] / step), 1)
        last = min(max(round(APART[1] / step), first), len(rows) - 1)
        for lag in range(first, last + 1):
            product = (units[rows[lag:]] * units[rows[:-lag]]).sum(axis=1)
            sums = lags.setdefault(lag, np.zeros(count))
            np.add.at(sums, part[rows[:-lag]], product)
    same = np.zeros(count)
    for one, other in repeats(problem):
        a, b = (np.flatnonzero(problem.trial == n) for n in (one, other))
        length = min(len(a), len(b))
        product = (units[a[:length]] * units[b[:length]]).sum(axis=1)
        np.add.at(same, part[a[:length]], product)
    every = [*lags.values(), same]
    alone = max(abs(_errors(sums)) for sums in every) - SEARCHED
    return max(_errors(np.sum(every, axis=0)), _errors(same), alone)


def repeated(problem: Problem, rest: np.ndarray) -> float:
    """Standard errors by which repeats have errors in common.

    What only scatters is independent in two trials that were told the same: the sum of
    their errors is as large as the difference. Both are compared by Fisher's F for each
    feature and each of `OVER`, with as many degrees of freedom as the difference shows
    (Satterthwaite, 1946), and as many tests count. Changes over a time tell what recurs
    from a robot that goes astray slowly.

    Args:
        problem: the recording.
        rest: residuals, ``(N, C)``.

    Returns:
        of a normal distribution, for the least probability; 0 without repeats.
    """
    rest = np.nan_to_num(rest)
    most = OUTLYING * np.sqrt((rest**2).mean(axis=0))
    rest = np.clip(rest, -most, most)
    pairs = [
        [np.flatnonzero(problem.trial == number) for number in pair]
        for pair in repeats(problem)
    ]
    chances: list[float] = []
    for over in OVER:
        chances += _chances([_changes(problem, rest, pair, over) for pair in pairs])
    least = min(chances, default=1.0) * max(len(chances), 1)
    return float(stats.norm.isf(np.clip(least, 1e-300, 0.5)))


def _chances(pieces: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[float]:
    """Probability, by feature, that errors of repeats are as much alike by chance.

    Args:
        pieces: by pair of repeats, squares of sums and of differences of their errors
            in pieces that count as independent, ``(K, C)`` each.
    """
    if not any(len(common) for common, _ in pieces):
        return []
    common, apart = (np.concatenate(part) for part in zip(*pieces, strict=True))
    found = []
    for one, other in zip(common.T, apart.T, strict=True):
        size = max(float(other.sum()), 1e-300)
        free = size**2 / max(float((other**2).sum()), 1e-300)
        found.append(float(stats.f.sf(one.sum() / size, free, free)))
    return found


def _changes(
    problem: Problem, rest: np.ndarray, pair: Sequence[np.ndarray], over: float
) -> tuple[np.ndarray, np.ndarray]:
    """Squares of the sum and of the difference of two trials' errors, or of what these
    change over a time [s], in pieces of both, ``(K, C)`` each."""
    length = min(map(len, pair))
    one, other = (rest[rows[:length]] for rows in pair)
    times = problem.windows[problem.trial[pair[0][0]]].times[:length]
    step = max(float(np.median(np.diff(times))), 1e-6) if length > 1 else np.inf
    lag = max(round(over / step), 1) if over else 0
    if length <= lag:
        none = np.zeros((0, rest.shape[1]))
        return none, none
    if lag:
        one, other = one[lag:] - one[:-lag], other[lag:] - other[:-lag]
    piece = max(over, SHORT) if over else PIECE
    part = ((times[: len(one)] - times[0]) / piece).astype(int)
    starts = np.flatnonzero(np.diff(part, prepend=-1))
    return (
        np.add.reduceat((one + other) ** 2, starts, axis=0),
        np.add.reduceat((one - other) ** 2, starts, axis=0),
    )


def scattered(
    problem: Problem, rest: np.ndarray, known: Floor, inside: np.ndarray
) -> float:
    """Excess over the floor, per residual, of what differs between repeats: the
    robot's own scatter; 0 where there are no repeats.

    Args:
        problem: the recording.
        rest: residuals, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """
    units = np.where(inside, np.nan_to_num(rest) / known.sd, 0.0)
    total, count = 0.0, 0
    for one, other in repeats(problem):
        a, b = (np.flatnonzero(problem.trial == n) for n in (one, other))
        length = min(len(a), len(b))
        both = inside[a[:length]] & inside[b[:length]]
        apart = (units[a[:length]] - units[b[:length]])[both]
        total, count = total + float((apart**2).sum()) / 2, count + int(both.sum())
    return max(total / count - 1.0, 0.0) if count else 0.0


def _errors(sums: np.ndarray) -> float:
    """A sum of independent values over its standard error."""
    size = np.sqrt((sums**2).sum())
    return float(sums.sum() / size) if size > 0 else 0.0


def _pieces(problem: Problem, length: float) -> np.ndarray:
    """Number of the stretch of a length [s] that each window lies in, ``(N,)``."""
    made, first = [], 0
    for trial, windows in zip(problem.trials, problem.windows, strict=True):
        number = ((windows.times - trial.times[0]) / length).astype(int)
        made.append(first + number)
        first += int(number.max(initial=0)) + 1
    return np.concatenate(made)


def repeats(problem: Problem, tolerance: float = 1e-3) -> list[tuple[int, int]]:
    """Pairs of trials that were told the same, but for a tolerance and 20 ms."""
    found = []
    trials = problem.trials
    for first in range(len(trials)):
        for second in range(first + 1, len(trials)):
            one, other = trials[first].commands, trials[second].commands
            if one.values.shape != other.values.shape:
                continue
            same = np.abs(one.values - other.values).max(initial=0) < tolerance
            late = np.abs(np.cumsum(one.durations - other.durations))
            if same and late.max(initial=0) < 0.02:
                found.append((first, second))
    return found
