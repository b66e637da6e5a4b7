"""Navigation by the undamaged and the damaged Khepera III, in physics and as an SNN.

What the settings decide that the dissertation leaves silent is tried one by one in the
static-SNN world, which costs no physics: the simple problem, left wheel 50 % slower
(the hardest of the four damages) from trial 12, window 150.
"""

import os
from dataclasses import replace

import numpy as np

from bench.learning import ceiling, experiments, light, trunks
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

LIMIT, FEWEST, MEDIAN = 70, 27, 16
CLAIMS = dict(zip(experiments.DAMAGES, ("A15", "A16", "A17", "A18"), strict=True))
LEVEL = 0.01


@bench(
    "median trials to solve the simple problem, undamaged",
    bar="median <= 12 trials, >= 28 of 30 runs within 30",
)
def solve_simple(quick: bool) -> Result:
    """30 runs of the preset `khepera-simple` without damage, 30 trials each."""
    config = experiments.undamaged("simple")
    record = experiments.records([config], quick=quick)[config.preset]
    waits = experiments.waits(stats.trials_to_solve(record))
    median = waits["median"]
    within = experiments.solved_within(record, 30)
    return Result(
        figure=median if median is not None else float(record.trials + 1),
        unit="trials",
        holds=None if quick else median is not None and median <= 12 and within >= 28,
        n=record.replicates,
        details={"solved within 30": within, **waits},
    )


@bench(
    "runs that solve the infinity problem within 60 trials, undamaged",
    bar=">= 24 of 30 runs within 60 trials",
)
def solve_infinity(quick: bool) -> Result:
    """30 runs of the preset `khepera-infinity`, 60 trials each."""
    config = experiments.undamaged("infinity")
    record = experiments.records([config], quick=quick)[config.preset]
    within = experiments.solved_within(record, 60)
    return Result(
        figure=within,
        unit="runs",
        holds=None if quick else within >= 24,
        n=record.replicates,
        details=experiments.waits(stats.trials_to_solve(record)),
    )


@bench(
    "window 150 and 300 against none on four damages (claims A15-A18): cells that hold",
    bar="better in all 8 cells, p < 0.01 each",
)
def window_claims(quick: bool) -> Result:
    """30 runs a side, damage at trial 30 of 100; O of eq 3.1, Mann-Whitney, A12."""
    sides = {
        (damage, window): experiments.damaged(damage, **_adaptation(window))
        for damage in experiments.DAMAGES
        for window in (0, 150, 300)
    }
    records = experiments.records(sides.values(), quick=quick)
    cells: dict[str, dict[str, object]] = {}
    for damage, claim in CLAIMS.items():
        found = {w: records[sides[damage, w].preset] for w in (0, 150, 300)}
        for window in (150, 300):
            cell = experiments.versus(found[window], found[0])
            cells[f"{claim} {damage} {window} v none"] = cell
        label = f"{claim} {damage} 150 v 300"
        cells[label] = experiments.versus(found[150], found[300])
    adjusted = stats.holm([float(cell["p"]) for cell in cells.values()])
    for cell, p in zip(cells.values(), adjusted, strict=True):
        cell["p holm"] = float(p)
    against_none = [cell for name, cell in cells.items() if name.endswith("none")]
    hold = sum(cell["better"] > 0.5 and cell["p"] < LEVEL for cell in against_none)
    return Result(
        figure=hold,
        unit="cells of 8",
        holds=None if quick else hold == len(against_none),
        n=next(iter(records.values())).replicates,
        details=cells,
    )


def _adaptation(window: int) -> dict[str, int]:
    return {"window": window} if window else {}


@bench(
    "fewest runs (over four damages) that recover within 70 trials, window 150",
    bar=">= 27 of 30 in each; median <= 16 trials for 20 %; all four solvable at all",
)
def recover_window(quick: bool) -> Result:
    """30 runs of each damage (from trial 30 of 100); quick: few and short.

    Every run that recovers shows that the encoding leaves the damage solvable. Beside
    it stands the ceiling (`python -m bench ceiling`), where it has been run: what
    evolution *directly in the damaged world*, without any SNN, reaches.
    """
    configs = {d: experiments.damaged(d, window=150) for d in experiments.DAMAGES}
    records = experiments.records(configs.values(), quick=quick)
    found: dict[str, dict[str, object]] = {}
    holds = True
    for damage, config in configs.items():
        record = records[config.preset]
        waits = experiments.waits(stats.trials_to_recover(record))
        within = experiments.recovered_within(record, LIMIT)
        found[damage] = {"recovered within 70": within, **waits}
        quickly = waits["median"] is not None and waits["median"] <= MEDIAN
        holds = holds and within >= FEWEST and (quickly or damage.endswith("50"))
        found[damage]["ceiling"] = ceiling.known(damage) or "not run"
    return Result(
        figure=min(int(row["recovered within 70"]) for row in found.values()),
        unit="runs",
        holds=None if quick else holds,
        n=record.replicates,
        details=found,
    )


@bench(
    "the same experiments in the static-SNN world and in MuJoCo, side by side",
    bar="none: printed beside the physics world's",
)
def static_snn_world(quick: bool) -> Result:
    """Solving both problems and recovering from four damages with three windows."""
    found: dict[str, object] = {}
    for problem in ("simple", "infinity"):
        found[f"solve {problem}"] = _both(
            lambda world, problem=problem: experiments.undamaged(problem, world),
            lambda record: experiments.waits(stats.trials_to_solve(record)),
            quick,
        )
    for damage in experiments.DAMAGES:
        for window in (150, 300, 0):
            adaptation = {"window": window} if window else {}
            found[f"recover {damage}, window {window or 'none'}"] = _both(
                lambda world, d=damage, a=adaptation: experiments.damaged(
                    d, world=world, **a
                ),
                lambda record: experiments.waits(stats.trials_to_recover(record)),
                quick,
            )
    static = [row["static-snn"]["came"] for row in found.values()]
    physics = [row["mujoco"]["came"] for row in found.values()]
    agree = sum(abs(a - b) <= 3 for a, b in zip(static, physics, strict=True))
    return Result(
        figure=agree,
        unit=f"of {len(static)} rows within 3 runs of the physics world",
        holds=None,
        n=6 if quick else experiments.REPLICATES,
        details=found,
    )


def _both(config, summary, quick: bool) -> dict[str, dict[str, object]]:
    configs = {world: config(world) for world in ("mujoco", "static-snn")}
    records = experiments.records(configs.values(), quick=quick)
    return {world: summary(records[c.preset]) for world, c in configs.items()}


SPAN = 10
RUNS = 30  # a side


@bench(
    "cost of the last ten trials over the first ten with an intermittent wheel",
    bar="noise-aware: no decline (<= 1.0); the plain one beside it",
)
def intermittent_wheel(quick: bool) -> Result:
    """`RUNS` a side, every fifth command lost from trial 20 of 40, no adaptation."""
    sides = {
        name: light.damaged(
            "wheel-intermittent",
            light={"noise": noise},
            runs=RUNS,
            window=0,
            population_reset=False,
        )
        for name, noise in (("noise-aware", 1.0), ("plain", 0.0))
    }
    records = trunks.forked(sides.values(), quick=quick)
    aware, plain = (records[config.preset] for config in sides.values())
    declines = {"noise-aware": _decline(aware), "plain": _decline(plain)}
    middle = float(np.median(declines["noise-aware"]))
    return Result(
        figure=middle,
        unit="x",
        holds=None if quick else middle <= 1.0,
        n=aware.replicates,
        details={
            "plain": float(np.median(declines["plain"])),
            "p of the two declines": stats.mann_whitney(*declines.values()),
            "noise-aware against plain (O)": experiments.versus(aware, plain),
        },
    )


def _decline(record: RunRecord) -> np.ndarray:
    """Cost of the last trials over that of the first damaged ones, ``(R,)``."""
    onset = int(record.damage_onset[0])
    span = min(SPAN, (record.trials - onset) // 2)
    cost = record["fitness_best"]
    return cost[:, -span:].mean(1) / cost[:, onset : onset + span].mean(1)


NULL_LEVEL = 0.05

RATE, MAGNITUDE = 0.2, 3500.0  # dissertation, table 4.1


def _sides() -> dict[str, tuple[dict[str, object], dict[str, object], str]]:
    """Claim -> adaptation, what it is compared with, damage."""
    reset = {"population_reset": True}
    rate, size = {"mutation_rate_after": RATE}, {"mutation_magnitude_after": MAGNITUDE}
    fresh = {"simulator_reset": True}
    return {
        "A8 population reset, left-20": (reset, {}, "left-20"),
        "A9 population reset, right-20": (reset, {}, "right-20"),
        "A9 population reset, left-50": (reset, {}, "left-50"),
        "A9 population reset, right-50": (reset, {}, "right-50"),
        "A11 mutation rate 0.2": (rate, {}, "left-20"),
        "A12 mutation magnitude 3500": (size, {}, "left-20"),
        "A13 both": (rate | size, {}, "left-20"),
        "A21 simulator reset": (fresh, {}, "left-20"),
        "A23 window 150 + simulator reset": (
            fresh | {"window": 150},
            {"window": 150},
            "left-20",
        ),
    }


NULLS = ("A9", "A11", "A12", "A13", "A23")


@bench(
    "nulls A9, A11-A13, A23, claims A8, A21 and A24's onset: nulls found null",
    bar="none: reported as they come out",
)
def nulls_a(quick: bool) -> Result:
    """30 runs a side; O of eq 3.1, Mann-Whitney, share of pairs won with interval."""
    sides = _sides()
    configs = {
        (damage, tuple(sorted(adaptation.items()))): experiments.damaged(
            damage, **adaptation
        )
        for one, other, damage in sides.values()
        for adaptation in (one, other)
    }
    records = experiments.records(configs.values(), quick=quick)

    def of(damage: str, adaptation: dict[str, object]) -> RunRecord:
        return records[configs[damage, tuple(sorted(adaptation.items()))].preset]

    cells = {
        claim: experiments.versus(of(damage, one), of(damage, other))
        for claim, (one, other, damage) in sides.items()
    }
    null = [c for name, c in cells.items() if name.split()[0] in NULLS]
    plain = of("left-20", {})
    details = {**cells, "A21 cost just after": drop(of, plain), "A24": onset(plain)}
    return Result(
        figure=sum(cell["p"] >= NULL_LEVEL for cell in null),
        unit=f"nulls of {len(null)}",
        holds=None,
        n=plain.replicates,
        details=details,
    )


def drop(of, plain: RunRecord) -> dict[str, float]:
    """Median cost over the ten trials after the damage, with and without a reset."""
    after = slice(int(plain.damage_onset[0]) + 1, int(plain.damage_onset[0]) + 11)
    fresh = of("left-20", {"simulator_reset": True})
    return {
        "reset": float(np.median(fresh["fitness_best"][:, after])),
        "none": float(np.median(plain["fitness_best"][:, after])),
    }


def onset(plain: RunRecord) -> dict[str, float | None]:
    """A24: first trial at which the mean cost has made up a fifth of its rise.

    The claim: without a window nothing improves until patterns of the damaged robot
    outnumber the old ones, about trial 60 for damage at 30. The mean over runs is
    smoothed over five trials.
    """
    start = int(plain.damage_onset[0])
    mean = plain["fitness_best"].mean(0)
    before = mean[max(0, start - 10) : start].mean()
    smooth = np.convolve(mean[start:], np.ones(5) / 5, mode="valid")
    peak = smooth.max()
    low = np.flatnonzero(smooth <= peak - 0.2 * (peak - before))
    late = low[low > smooth.argmax()]
    return {
        "cost before": float(before),
        "worst after": float(peak),
        "cost at the end": float(smooth[-1]),
        "onset of improvement [trial]": float(late[0] + start) if len(late) else None,
    }


ONSET, TRIALS, EACH = 12, 40, 8

VARIANTS: dict[str, tuple[str, object]] = {
    "defaults": ("preset", "defaults"),
    "printed fitness (rest not charged)": ("task.charge_unused", False),
    "squared distances": ("task.squared", True),
    "command cost 0.5 cm": ("task.command_cost", 0.5),
    "start heading 90 deg": ("task.start_yaw", 90.0),
    "no stops (lowest speed 8000)": ("controller.speed_low", 8000.0),
    "speeds from 0": ("controller.speed_low", 0.0),
    "lists up to 24": ("controller.max_commands", 24),
    "fixed length": ("controller.fixed_length", True),
    "world controller by tournament 0.1": ("choose", "tournament"),
    "20 generations a trial": ("evolution.generations", 20),
    "120 generations a trial": ("evolution.generations", 120),
    "no headless chicken": ("evolution.headless_chicken", 0.0),
    "no elitism": ("evolution.elitism", 0),
    "two-point crossover": ("evolution.crossover", "n-point"),
    "tournament of 2": ("evolution.tournament", 2),
    "100 epochs": ("snn.epochs", 100),
    "fresh SNN each trial": ("snn.warm_start", False),
    "no weight decay": ("snn.weight_decay", 0.0),
    "weight decay 0.01": ("snn.weight_decay", 0.01),
}


@bench(
    "sweep of the dissertation's silent settings: variants that beat the defaults",
    bar="none: the table behind docs/choices.md",
)
def choices(quick: bool) -> Result:
    """8 runs of 40 trials a variant; quick: 3 variants, 2 runs of 6 trials."""
    names = list(VARIANTS)[:3] if quick else list(VARIANTS)
    with experiments.pool_of_workers() as pool:
        rows = list(pool.map(_row, names, [quick] * len(names)))
    found = dict(zip(names, rows, strict=True))
    base = found["defaults"]["recovered"]["came"]
    better = sum(row["recovered"]["came"] > base for row in rows)
    return Result(
        figure=better, unit="variants", holds=None, n=len(names), details=found
    )


def _row(name: str, quick: bool) -> dict[str, dict[str, object]]:
    os.environ["OMP_NUM_THREADS"] = "1"
    from bns.experiment.run import train

    record = train(_config(name, quick))
    return {
        "solved": experiments.waits(_before(stats.trials_to_solve(record), ONSET)),
        "recovered": experiments.waits(stats.trials_to_recover(record)),
    }


def _before(waits, onset: int):
    """Waits that ended before the damage; the others count as never."""
    waits = waits.copy()
    waits[waits > onset] = float("inf")
    return waits


def _config(name: str, quick: bool) -> RunConfig:
    from bns import presets

    config = presets.load("khepera-simple")
    onset = 3 if quick else ONSET
    damage = (f"wheel_gain:wheel=left,factor=0.5@{onset}",)
    config = replace(
        config,
        world=replace(config.world, name="static-snn", damage=damage),
        trials=6 if quick else TRIALS,
        replicates=2 if quick else EACH,
        threads=1,
        compiled="no",
        seed=20261121,
    )
    path, value = VARIANTS[name]
    if "." not in path:
        return replace(config, **{path: value})
    part, field = path.split(".")
    changed = replace(getattr(config, part), **{field: value})
    return replace(config, **{part: changed})
