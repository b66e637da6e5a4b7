"""Which setting of a real servo is not as told? Named from its recordings alone."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bench.gap.real_data import needed
from bench.result import Result, bench
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


BAR_VALUE, FROZEN_BAR = 0.95, 0.93
FREEZE = 0.05  # share of all runs that stand still for a second in the second row
SEED, EACH, QUICK = 2027, 32, 6  # 2026 was used while the tool was made
LEARNED, HELD_OUT = (1, 2), (3,)  # repeats that are diagnosed and that are predicted
SMOOTH = ("sin_sin", "sin_time_square", "up_and_down")
EDITED = 2  # predictions of another payload per case
CLASSES = {"servo_voltage": "servo_gain"}  # alike while the duty does not saturate
ERROR_BARS = {"payload": 0.08, "lever": 0.03, "gain": 0.04}


@bench(
    "STS3215 recordings, one setting mis-told: share named right, aliases merged",
    bar=">= 0.95; with 5 % of the runs frozen for 1 s >= 0.93",
)
def gap_servo(quick: bool) -> Result:
    """Four kinds of cases; quick takes 6 of each instead of 32 (of none: 9 of 48)."""
    from bns.gap.models.servo import diagnosis

    every = load()
    law = nominal(every)
    reference = diagnosis.learn(every.take(every.where(lambda r: r > 0, "repeat")), law)
    rng = np.random.default_rng(SEED)
    cases = list(draw(every, QUICK if quick else EACH, rng))
    rows = [_row(case, every, reference, LEARNED) for case in cases]
    for row in rows:
        row |= _consequences(every, row["case"], row, law)
    named = np.array([row["named"] == row["truth"] for row in rows])
    details = _details(rows)
    errors = details["median_relative_error"]
    still = _frozen(cases, every)
    held = named.mean() >= BAR_VALUE and still["named"] >= FROZEN_BAR
    holds = held and all(errors[kind] <= bar for kind, bar in ERROR_BARS.items())
    return Result(
        figure=round(float(named.mean()), 4),
        unit="of cases",
        holds=bool(holds),
        n=len(rows),
        details={
            **details,
            "frozen_for_a_second": still,
            "left_out_as_recorded": reference.left_out,
            **({} if quick else _harder(cases, every, law)),
            "candidates": len(reference.candidates),
            "nominal_error_rad": law.error,
            "nominal": {k: round(v, 5) for k, v in law.values.items()},
        },
    )


def _frozen(cases: list[Case], every) -> dict[str, object]:
    """The same cases with frozen runs among all: law, reference and diagnosed ones."""
    from bns.gap.models.servo import diagnosis, repeats

    rng = np.random.default_rng(SEED)
    stuck, chosen = frozen(every, FREEZE, rng)
    law = nominal(repeats.sound(stuck)[0])
    past = stuck.take(stuck.where(lambda r: r > 0, "repeat"))
    reference = diagnosis.learn(past, law)
    rows = [_row(case, stuck, reference, LEARNED) for case in cases]
    found = set(repeats.odd(stuck))
    return {
        "named": _share(rows),
        "frozen": len(chosen),
        "frozen_left_out": len(found & set(chosen.tolist())),
        "others_left_out": len(found - set(chosen.tolist())),
        "false_alarm": float(
            np.mean([r["named"] != "none" for r in rows if r["truth"] == "none"])
        ),
        "confusion": dict(
            sorted(Counter(f"{r['truth']} -> {r['named']}" for r in rows).items())
        ),
    }


def _harder(cases: list[Case], every, law) -> dict[str, object]:
    """The same cases from one repeat of the powered, smooth runs alone."""
    from bns.gap.models.servo import diagnosis

    smooth = every.take(every.where(lambda kind: kind in SMOOTH, "trajectory"))
    past = smooth.take(smooth.where(lambda r: r > 0, "repeat"))
    reference = diagnosis.learn(past, law)
    rows = [_row(case, smooth, reference, LEARNED[:1]) for case in cases]
    sets = [row["truth"] in row["sets"] for row in rows]
    return {
        "one_repeat_of_smooth_runs": {
            "named": _share(rows),
            "set_coverage": float(np.mean(sets)),
            "mean_set_size": float(np.mean([len(row["sets"]) for row in rows])),
            "confusion": dict(
                sorted(Counter(f"{r['truth']} -> {r['named']}" for r in rows).items())
            ),
        }
    }


def _row(case: Case, every, reference, repeats) -> dict[str, object]:
    from bns.gap.models.servo import diagnosis

    mine = of_cell(every, case.true, repeats)
    told = retold(mine, case.told)
    found, scores = diagnosis.diagnose(told, reference, without=[case.true])
    truth = "none" if case.kind == "none" else f"servo_{case.kind}"
    best = scores.ranked[0]
    named = "none" if found.kind == "no gap" else CLASSES.get(best, best)
    sets = {CLASSES.get(s[0], s[0]) if s else "none" for s in found.sets}
    row = {
        "truth": truth,
        "named": "none of the library" if found.kind.startswith("none") else named,
        "verdict": found.kind,
        "sets": sets,
        "case": case,
        "statistic": scores.statistic,
        "effect": "",
    }
    if found.kind != "no gap":
        row["effect"] = str(reference.candidates[best].make(scores.magnitudes[best]))
    if case.kind != "none":
        value = scores.magnitudes[truth]
        told = case.told[KINDS.index(case.kind)]
        if case.kind == "payload":
            row["error"] = abs(value / (told * (case.change - 1)) - 1)
            row["error_of_mass"] = abs((told + value) / told / case.change - 1)
        else:
            row["error"] = abs(value / case.change - 1)
    return row


def _consequences(every, case: Case, row: Mapping, law) -> dict[str, float]:
    """How much closer the chosen effect brings held-out runs and another payload's."""
    held = of_cell(every, case.true, HELD_OUT)
    told = retold(held, case.told)
    before = error(told, law)
    after = error(told, law, row["effect"])
    oracle = error(held, law)
    result = {"before": before, "after": after, "oracle": oracle}
    masses = sorted({c[0] for c in cells(every)} - {case.true[0]})
    ratios = []
    for mass in masses[:EDITED]:
        runs = of_cell(every, (mass, *case.true[1:]), HELD_OUT)
        shifted = case.told[0] + mass - case.true[0]
        if shifted <= 0:
            continue
        edited = retold(runs, (shifted, *case.told[1:]))
        chosen = error(edited, law, row["effect"])
        ratios.append(chosen / error(runs, law))
    return result | {"edit": float(np.mean(ratios)) if ratios else float("nan")}


def _details(rows: list[dict]) -> dict[str, object]:
    confusion = Counter(f"{row['truth']} -> {row['named']}" for row in rows)
    changed = [row for row in rows if row["truth"] != "none"]
    same = [row for row in rows if row["truth"] == "none"]
    errors: dict[str, list[float]] = defaultdict(list)
    for row in changed:
        errors[row["case"].kind].append(row["error"])
    small = [
        row
        for row in changed
        if row["case"].kind == "payload"
        and abs(row["case"].true[0] - row["case"].told[0]) < 0.25
    ]
    closed = [
        (row["before"] - row["after"]) / (row["before"] - row["oracle"])
        for row in changed
        if row["before"] > 1.2 * row["oracle"]
    ]
    return {
        "confusion": dict(sorted(confusion.items())),
        "verdicts": dict(Counter(row["verdict"] for row in rows)),
        "by_kind": {
            kind: _share([r for r in rows if r["case"].kind == kind]) for kind in KINDS
        },
        "false_alarm": float(np.mean([row["named"] != "none" for row in same])),
        "detected": float(np.mean([row["named"] != "none" for row in changed])),
        "small_payloads_below_0.25_kg": [_share(small), len(small)],
        "median_relative_error": {k: float(np.median(v)) for k, v in errors.items()},
        "payload_median_error_over_whole_mass": float(
            np.median([r["error_of_mass"] for r in changed if "error_of_mass" in r])
        ),
        "set_coverage": float(np.mean([row["truth"] in row["sets"] for row in rows])),
        "mean_set_size": float(np.mean([len(row["sets"]) for row in rows])),
        "gap_closed_on_held_out_median": float(np.median(closed)),
        "edit_error_over_oracle_median": float(
            np.nanmedian([row["edit"] for row in changed])
        ),
        "failures": [
            f"{row['truth']}: said {row['named']}, true {row['case'].true}, told "
            f"{row['case'].told}, statistic {row['statistic']:.2f}"
            for row in rows
            if row["named"] != row["truth"]
        ],
    }


def _share(rows: list[dict]) -> float | None:
    named = [row["named"] == row["truth"] for row in rows]
    return float(np.mean(named)) if named else None
