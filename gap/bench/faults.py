"""Faults put into recordings of withheld cases."""

from collections.abc import Sequence

import numpy as np

from bns.worlds.trial import Trial


def faulty(
    rng: np.random.Generator, trials: Sequence[Trial]
) -> tuple[tuple[Trial, ...], str]:
    """Break a recording; returns it and what was done."""
    names = ("wrap", "spikes", "duplicate", "stuck", "lost", "infinite", "clock")
    name = names[int(rng.integers(len(names)))]
    made = list(trials)
    number = int(rng.integers(len(made)))
    trial = made[number]
    observed, times = trial.observed.copy(), trial.times.copy()
    count = len(times)
    if name == "wrap":
        turned = np.pi - 0.1  # in another frame, in which the heading crosses pi
        cos, sin = np.cos(turned), np.sin(turned)
        observed[:, :2] = observed[:, :2] @ [[cos, sin], [-sin, cos]]
        observed[:, 2] = np.angle(np.exp(1j * (observed[:, 2] + turned)))
    elif name == "spikes":
        observed[rng.choice(np.arange(5, count - 5, 4), 3, replace=False), :2] += 0.5
    elif name == "duplicate":
        return (*made, trial), name
    elif name == "stuck":
        observed[:, 1] = observed[0, 1]
    elif name == "lost":
        observed[3 : int(0.7 * count)] = np.nan
    elif name == "infinite":
        observed[count // 2, 0] = np.inf
    else:
        times = times * 1.2
    made[number] = trial.replace(observed=observed, times=times)
    return tuple(made), name
