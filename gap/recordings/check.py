"""Is a recording sound? Faults are repaired and listed, or stop the diagnosis."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError, FormatError
from bns.gap.models.base import GapModel
from bns.gap.recordings import trial_conditions
from bns.gap.recordings.stuck import without_stuck
from bns.worlds.trial import Trial

TURNS = 1.5  # steps beside it that a spike is larger than; a turn is one; assumed
SPIKE = 8.0  # robust standard deviations from both neighbours
DEGREES = (300.0, 420.0)  # jumps of an angle that is wrapped in degrees
OFTEN = 0.05  # of the samples, that no angle in radians jumps by `WRAP`
WRAP = 0.6  # of a full turn, between two samples, that counts as a wrap
FEWEST = 8  # samples of a trial
LOST = 0.5  # share of samples that may be missing
STUCK = 0.9  # share of equal neighbours, while commands move, that counts as stuck
LONG_GAP = 10.0  # times the usual step
COARSE = 12  # fewer distinct steps than this while moving: quantised
CLOCK = 0.05  # relative disagreement of recorded and commanded time
BEYOND = 30.0  # times as far as the model moves: degrees for radians, mm for m
AGAINST = -0.5  # median correlation with what the model does
SHOWS = 30.0  # times the resolution that a channel has to move to be compared
FAR = 1e3  # [m] beyond it a position is a slip of a unit


def check(
    trials: Sequence[Trial], model: GapModel
) -> tuple[tuple[Trial, ...], tuple[str, ...]]:
    """Repair what can be repaired.

    Args:
        trials: recorded trials.
        model: nominal model.

    Returns:
        usable trials; what was repaired or noticed, one line each.

    Raises:
        FormatError: channels that the model lacks or needs, or no usable trial.
    """
    wanted = tuple(channel.name for channel in model.channels)
    notes: list[str] = []
    kept: list[Trial] = []
    seen: dict[bytes, str] = {}
    timed = model.timed  # else commands end by themselves
    odd = _odd_clocks(trials) if timed else {}
    sound: list[tuple[int, str, Trial, list[str]]] = []
    for number, trial in enumerate(trials):
        label = trial_conditions.label(trial, number)
        _channels(trial, model, label)
        if not trial.outcome.usable:
            notes.append(f"{label}: flagged as diverged, left out")
            continue
        same = trial.observed.tobytes()
        if same in seen:
            notes.append(f"{label}: the same samples as {seen[same]}, left out")
            continue
        seen[same] = label
        sound.append((number, label, *_repaired(trial, label, timed)))
    stuck = without_stuck([trial for _, _, trial, _ in sound], model)
    for (number, label, _, repairs), (trial, found) in zip(sound, stuck, strict=True):
        notes += repairs
        notes += [f"{label}: {note}" for note in found]
        fault = odd.get(number) or _unusable(trial, wanted)
        if fault:
            notes.append(f"{label}: {fault}, left out")
            continue
        kept.append(trial)
    if not kept:
        raise FormatError(
            "No trial of the recording is usable: "
            + "; ".join(notes or ["it is empty"])
        )
    return tuple(kept), (*_moved(kept, model), *_moments(kept), *notes)


def _moments(trials: Sequence[Trial]) -> list[str]:
    """Whether it is known when commands began."""
    count = len(trial_conditions.moments_sampled(trials))
    step = trial_conditions.moments_unknown(trials)
    if not count:
        return []
    return [
        f"{count} trials: when a command began is known to a sample only "
        f"({step:.3g} s), which can pass for a gap; give command_time"
    ]


def _moved(trials: Sequence[Trial], model: GapModel) -> list[str]:
    """Stop at channels that move much farther than their commands can make them; those
    that move against the model."""
    (predicted,) = model.simulate(trials, [()])
    pairs = [
        _as_compared(trial, path, model)
        for trial, path in zip(trials, predicted, strict=True)
    ]
    notes = []
    for column, channel in enumerate(model.channels):
        shares, agree = [], []
        for trial, path, (seen, made) in zip(trials, predicted, pairs, strict=True):
            good = np.isfinite(trial.observed).all(axis=1)
            told = np.ptp(path[:, column])
            if told > SHOWS * model.resolution[column]:  # not where it diverged
                shares.append(np.ptp(trial.observed[good, column]) / told)
                one, other = seen[:, column], made[:, column]
                if len(one) and min(np.ptp(one), np.ptp(other)) > 0:
                    agree.append(np.corrcoef(one, other)[0, 1])
        if shares and np.median(shares) > BEYOND:
            raise FormatError(
                f"{channel.name} moves {np.median(shares):.3g} times as far as its "
                f"commands make the model move: its unit, {channel.unit}, or that of "
                "the commands seems wrong."
            )
        if agree and np.median(agree) < AGAINST:
            notes.append(
                f"{channel.name} moves against the model (correlation "
                f"{np.median(agree):.2f}): are its column and sign those of the model?"
            )
    return notes


def _as_compared(
    trial: Trial, path: np.ndarray, model: GapModel
) -> tuple[np.ndarray, np.ndarray]:
    """What was recorded and predicted ``(n, C)`` where all was seen, as the model
    compares it, where that is by channel: a robot that goes over a floor may head
    otherwise than its model, and its y is not turned for that."""
    seen = trial.observed[:, : len(model.channels)]
    if model.features == model.channels:
        windows = model.windows(trial)
        seen, path = (model.compare(trial, v, windows) for v in (seen, path))
    good = np.isfinite(seen).all(axis=1) & np.isfinite(path).all(axis=1)
    return seen[good], path[good]


def _channels(trial: Trial, model: GapModel, label: str) -> None:
    given = {channel.name: channel.unit for channel in trial.channels}
    for channel in model.channels:
        if channel.name not in given:
            raise FormatError(
                f"The {label} has no channel {channel.name!r}; model {model.name!r} "
                f"needs {', '.join(c.name for c in model.channels)}."
            )
        if given[channel.name] != channel.unit:
            raise FormatError(
                f"The {label}: {channel.name} is in {given[channel.name]!r}, the "
                f"model's in {channel.unit!r}; convert it to SI."
            )
    if [c.name for c in trial.channels][: len(model.channels)] != [
        c.name for c in model.channels
    ]:
        raise BnsError("Observed channels have to begin with those of the model.")


def _repaired(trial: Trial, label: str, timed: bool) -> tuple[Trial, list[str]]:
    notes: list[str] = []
    observed = trial.observed.copy()
    dropped = np.zeros(len(observed), dtype=bool)  # and told as such
    for column, channel in enumerate(trial.channels):
        values = observed[:, column]
        if channel.unit == "rad":
            values, wraps = _unwrapped(values)
            if wraps and _in_degrees(observed[:, column]):
                raise FormatError(
                    f"{channel.name} of {label} jumps by more than half a turn again "
                    "and again: is it in degrees, told as rad?"
                )
            if wraps:
                notes.append(f"{label}: {channel.name} wrapped {wraps} times, undone")
        infinite = np.isinf(values)
        if infinite.any():
            values = np.where(infinite, np.nan, values)
            dropped |= infinite
            notes.append(f"{label}: {infinite.sum()} infinite {channel.name}, dropped")
        observed[:, column] = values
        notes += _noticed(trial, values, channel.name, label)
    spikes = _spikes(observed, trial.times)
    if spikes.any():
        observed[spikes] = np.nan
        dropped |= spikes
        many = "s" if spikes.sum() > 1 else ""
        notes.append(f"{label}: {spikes.sum()} spike{many}, dropped")
    lost = ~np.isfinite(observed).all(axis=1)
    observed[lost] = np.nan
    sampled = _sampled(trial, lost)
    count = (lost & sampled & ~dropped).sum()
    if count:
        notes.append(f"{label}: {count} of {sampled.sum()} samples lost, bridged")
    repeated = np.diff(trial.times, prepend=trial.times[0] - 1) <= 0
    if repeated.any():
        observed[repeated] = np.nan
        notes.append(f"{label}: {repeated.sum()} samples with a repeated time, dropped")
    notes += _timing(trial, label, timed)
    changed = not np.array_equal(observed, trial.observed, equal_nan=True)
    return (trial.replace(observed=observed) if changed else trial), notes


def _unwrapped(values: np.ndarray) -> tuple[np.ndarray, int]:
    """An angle made continuous over lost samples too; number of wraps undone."""
    seen = np.isfinite(values)
    jumps = np.abs(np.diff(values[seen])) > WRAP * 2 * np.pi
    if not jumps.any():
        return values, 0
    made = values.copy()
    made[seen] = np.unwrap(values[seen])
    return made, int(jumps.sum())


def _in_degrees(values: np.ndarray) -> bool:
    """Whether an angle jumps as one does that is wrapped at 180 or 360 degrees, or by
    more than half a turn in many samples, beyond the turn that a wrapped one spans."""
    seen = values[np.isfinite(values)]
    jumps = np.abs(np.diff(seen))
    back = (jumps > DEGREES[0]) & (jumps < DEGREES[1])
    often = (jumps > WRAP * 2 * np.pi).mean() > OFTEN and np.ptp(seen) > 3 * np.pi
    return bool(back.any() or often)


def _spikes(observed: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Single samples far from both neighbours, which agree with each other."""
    found = np.zeros(len(observed), dtype=bool)
    for values in observed.T:
        seen = np.flatnonzero(np.isfinite(values))
        if len(seen) < 8:
            continue
        kept = values[seen]
        off = kept[1:-1] - (kept[:-2] + kept[2:]) / 2
        apart = np.abs(kept[2:] - kept[:-2]) / 2
        scale = max(np.median(np.abs(off)) / 0.6745, _quantum(kept)) + 1e-9
        hit = (np.abs(off) > SPIKE * scale) & (np.abs(off) > 4 * apart)
        # where a motion turns back, going on from either side leads to the sample
        before = 2 * kept[1:-3] - kept[:-4] - kept[2:-2]
        after = 2 * kept[3:-1] - kept[4:] - kept[2:-2]
        hit[1:-1] &= np.minimum(np.abs(before), np.abs(after)) > SPIKE * scale
        # and it stands out by no more than the speeds on either side make of a step
        lasted = np.maximum(np.diff(times[seen]), 1e-9)
        speed = np.abs(np.diff(kept)) / lasted
        step = np.maximum(lasted[1:-2], lasted[2:-1])
        beside = np.minimum(speed[:-3], speed[3:]) * step
        hit[1:-1] &= np.abs(off[1:-1]) > TURNS * beside
        found[seen[1:-1][hit]] = True
    return found


def _quantum(values: np.ndarray) -> float:
    """Step in which a channel counts, of one that rests in most samples: there a single
    step is no spike."""
    steps = np.abs(np.diff(values))
    moved = steps[steps > 0]
    return float(moved.min()) if 0 < len(moved) <= len(steps) / 2 else 0.0


def _noticed(trial: Trial, values: np.ndarray, name: str, label: str) -> list[str]:
    seen = values[np.isfinite(values)]
    if len(seen) < 20 or not np.abs(trial.commands.values).any():
        return []
    steps = np.diff(seen)
    if (steps == 0).mean() > STUCK:
        return [f"{label}: {name} is stuck at {np.median(seen):.4g}"]
    notes = []
    moving = np.abs(steps[steps != 0])
    if len(moving) > 20 and len(np.unique(moving.round(12))) < COARSE:
        notes.append(f"{label}: {name} comes in steps of {moving.min():.3g}")
    ends = [(seen == seen.min()).sum(), (seen == seen.max()).sum()]
    if max(ends) > max(5, 0.1 * len(seen)) and (steps == 0).mean() < STUCK:
        notes.append(f"{label}: {name} rests at its extreme value; clipped?")
    return notes


def _timing(trial: Trial, label: str, timed: bool) -> list[str]:
    notes = []
    steps = np.diff(trial.times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual > 0 and (steps > LONG_GAP * usual).any():
        notes.append(f"{label}: a gap of {steps.max():.3g} s in the samples")
    told = trial.commands.duration
    recorded = _span(trial)
    if timed and abs(recorded - told) > CLOCK * told + usual:
        notes.append(
            f"{label}: commands last {told:.3g} s, the samples between their start and "
            f"end {recorded:.3g} s; clocks disagree or samples were lost"
        )
    if len(steps) and trial.times[0] > 1e6:
        notes.append(f"{label}: time stamps are absolute ({trial.times[0]:.6g} s)")
    return notes


def _odd_clocks(trials: Sequence[Trial]) -> dict[int, str]:
    """Trials whose clock runs otherwise than that of most, and by how much."""
    ratios = np.array([_span(t) / max(t.commands.duration, 1e-9) for t in trials])
    usual = float(np.median(ratios)) if len(ratios) else 1.0
    if usual <= 0:
        return {}
    apart = np.abs(ratios / usual - 1)
    if (apart <= CLOCK).sum() <= len(ratios) / 2:
        return {}
    return {
        int(number): f"its clock runs {ratios[number] / usual:.3g} times as fast as "
        "that of the other trials"
        for number in np.flatnonzero(apart > CLOCK)
    }


def _span(trial: Trial) -> float:
    """Recorded time from the first command to the end of the last [s]."""
    first, last = trial.boundaries[0], trial.boundaries[-1]
    return float(trial.times[last] - trial.times[first])


def _sampled(trial: Trial, lost: np.ndarray) -> np.ndarray:
    """Which rows are samples, ``(T,)``: a reader adds moments without one, at which
    commands began.

    Args:
        trial: a recording.
        lost: rows without an observation, ``(T,)``.
    """
    made = np.ones(len(lost), dtype=bool)
    made[trial.boundaries[1:-1]] = False
    return made | ~lost


def _unusable(trial: Trial, wanted: Sequence[str]) -> str:
    seen = np.isfinite(trial.observed).all(axis=1)
    count = _sampled(trial, ~seen).sum()
    if seen.sum() < max(LOST * count, FEWEST):
        least = int(np.ceil(max(LOST * count, FEWEST)))
        return f"{seen.sum()} of {count} samples were seen, {least} are needed"
    values = trial.observed[seen][:, : len(wanted)]
    if (np.ptp(values, axis=0) == 0).all() and np.abs(trial.commands.values).any():
        return "nothing moves although it is told to"
    if (np.abs(values) > FAR).any():
        return f"values beyond {FAR:g}; a unit seems wrong"
    return ""
