"""Withheld-setting cases from real servo recordings, and their scores."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.gap.real_data import needed
from bns.gap.importers import kscale_sts3215
from bns.gap.models.servo import curves
from bns.gap.models.servo import nominal as servo_nominal
from bns.gap.models.servo.curves import features
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.runs import SAMPLE, Runs, cells, merged, runs
from bns.worlds.effects import registry

SET = "kscale_sts3215"
KINDS = ("payload", "lever", "gain", "none")
SECONDS = 5.9  # of each run; all last 6 s
FITTED = ((0.535, 0.10, 4.0), (0.741, 0.15, 16.0), (0.969, 0.10, 32.0))
"""cells whose first repeats the nominal law is fitted to, beside the next"""
FITTED_TOO = (1.168, 0.15, 8.0)


FROZEN = 1.0  # [s] that a frozen run stands still


@dataclass(frozen=True)
class Case:
    """One cell whose runs are told one wrong setting.

    Attributes:
        kind: which setting is wrong; "none" = all are right.
        true: (mass, lever, gain) of the runs.
        told: what the diagnosis is told.
    """

    kind: str
    true: tuple[float, float, float]
    told: tuple[float, float, float]

    @property
    def change(self) -> float:
        """True over told setting (a ratio)."""
        at = KINDS.index(self.kind)
        return self.true[at] / self.told[at]


def load() -> Runs:
    """All runs of the set."""
    return runs(kscale_sts3215.read(needed(SET)), seconds=SECONDS)


def nominal(every: Runs) -> Nominal:
    """The law fitted to the first repeats of four cells, 20 runs."""
    wanted = {tuple(np.round(cell, 2)) for cell in (*FITTED, FITTED_TOO)}
    here = np.array([tuple(np.round(cell, 2)) in wanted for cell in cells(every)])
    first = every.where(lambda number: number == 0, "repeat")
    return servo_nominal.fit(every.take(here & first))


def frozen(
    every: Runs, share: float, rng: np.random.Generator
) -> tuple[Runs, np.ndarray]:
    """The runs, some of whose angles stand still for `FROZEN` seconds.

    Args:
        every: all runs.
        share: of the runs that freeze.
        rng: draws which, and when.

    Returns:
        The runs, and the indices of the frozen ones.
    """
    angles, width = every.angles.copy(), round(FROZEN / SAMPLE)
    chosen = rng.permutation(len(every))[: round(share * len(every))]
    for index in chosen:
        begin = int(rng.integers(angles.shape[1] - width))
        angles[index, begin : begin + width] = angles[index, begin]
    return replace(every, angles=angles), chosen


def draw(every: Runs, each: int, rng: np.random.Generator) -> Iterator[Case]:
    """Cases of every kind, cells drawn without replacement within a kind.

    Args:
        every: all runs.
        each: cases of each kind; of "none" half as many again.
        rng: draws the cells and the wrong settings.
    """
    known = sorted(set(cells(every)))
    levels = [sorted({cell[i] for cell in known}) for i in range(3)]
    for at, kind in enumerate(KINDS):
        count = each if kind != "none" else 3 * each // 2
        for index in rng.permutation(len(known))[:count]:
            true = known[index]
            told = list(true)
            if kind != "none":
                others = [value for value in levels[at] if value != true[at]]
                told[at] = float(rng.choice(others))
            yield Case(kind, true, tuple(told))


def of_cell(every: Runs, cell: tuple[float, ...], repeats: tuple[int, ...]) -> Runs:
    """Runs of a cell, some repeats."""
    mine = np.array([name == cell for name in cells(every)])
    return every.take(mine & every.where(lambda r: r in repeats, "repeat"))


def retold(every: Runs, told: tuple[float, ...]) -> Runs:
    """The runs, told another setting; the lever's own mass follows its length."""
    arm = kscale_sts3215.ARM_MASSES[round(told[1], 3)]
    return every.retold(mass=told[0], lever=told[1], gain=told[2], arm_mass=arm)


def error(every: Runs, law: Nominal, effect: str = "") -> float:
    """Root mean square error on runs, with an effect (as text) or without [rad]."""
    together = merged(every)
    if not effect:
        rest = curves.residuals(together, law)
    else:
        from bns.gap.models.servo.candidates import columns
        from bns.worlds.physics.servo_rollout import simulate

        made = columns(law.told(together), [[registry.parse(effect)]])
        angles = simulate(made, together.drive)[:, 0]
        rest = features(together.angles) - features(angles)
    return float(np.sqrt((rest**2).mean()))
