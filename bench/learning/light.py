"""Light following (investigations B, C): solved, and recovered from damage.

Settings that the dissertation lists are those of its tables 5.19 and 6.7; what it
leaves silent is that of the preset `khepera-light`. Runs that differ only from the
damage on share the trials before it, see `bench.learning.experiments`.

What counts as circling is `bns.tasks.light.LightTask.solved`; the trial is one, from a
random start, as the dissertation judged its robot runs. Beside it stands the count for
half a round in the same time, which the slowest robot on the goal radius does not make.

Recovery is from a slow wheel and three sensor damages (table 6.7): all four twice more,
judging no bar, with what the table is silent on as the preset `khepera-light-recover`
has it, and with that preset, whose islands start anew, which table 6.7 does not have.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench.learning import experiments, trunks
from bench.result import Result, bench
from bns import presets, stats
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.config import AdaptationConfig, WatchConfig
from bns.tasks.light import LampGoal

ONSET = 20  # trial of the damage (dissertation, section 6.3.2)
AFTER = 20  # trials from the damage on
SOLVING = 15  # trials of the undamaged experiment
DAMAGES = {
    "slow-wheel": "wheel_gain:wheel=left,factor=0.5",  # the percentage is silent
    "noisy": "sensor_noise:factor=2",  # all sensors (6.3.1: the noise is doubled)
    "minimum": "sensor_stuck_min:sensor=left,blend=1",
    "maximum": "sensor_stuck_max:sensor=left,blend=1",
}
OTHERS = {  # the rest of 6.2.1; every fifth command or reading (silent)
    "both-slow": "wheel_gain:wheel=both,factor=0.5",
    "wheel-minimum": "wheel_stuck_min:wheel=left,blend=1",
    "wheel-maximum": "wheel_stuck_max:wheel=left,blend=1",
    "wheel-intermittent": "wheel_intermittent:wheel=left,every=5,speed=0.0555",
    "sensor-intermittent": "sensor_intermittent:sensor=left,every=5",
}
ALL = DAMAGES | OTHERS
UNHARMED = {"unharmed": "wheel_intermittent:wheel=left,every=1000"}
"""what would have been: no trial has that many commands"""
AFFECTED = {  # which of `bns.learners.bns.light.simulator.CHANNELS` a damage touches
    "slow-wheel": ("left wheel",),
    "noisy": ("left sensor", "right sensor"),
    "minimum": ("left sensor",),
    "maximum": ("left sensor",),
    "both-slow": ("left wheel", "right wheel"),
    "wheel-minimum": ("left wheel",),
    "wheel-maximum": ("left wheel",),
    "wheel-intermittent": ("left wheel",),
    "sensor-intermittent": ("left sensor",),
}


def undamaged(**light: object) -> RunConfig:
    """The preset (table 5.19), `SOLVING` trials.

    Args:
        light: settings of the section `light` that differ.
    """
    config = presets.load("khepera-light")
    config = replace(config, trials=SOLVING, light=replace(config.light, **light))
    words = [f"{key}={value}" for key, value in sorted(light.items())]
    return experiments.named(config, "-".join(["light", *words]))


def damaged(
    damage: str,
    *,
    light: Mapping[str, object] | None = None,
    watch: Mapping[str, object] | None = None,
    ensemble: bool = False,
    runs: int = experiments.REPLICATES,
    after: int = AFTER,
    **adaptation: object,
) -> RunConfig:
    """Table 6.7 over table 6.1, damaged from trial `ONSET` on.

    Args:
        damage: key of `ALL` or `UNHARMED`; empty = none.
        light: settings of the section `light` that differ.
        watch: settings of the section `watch`.
        ensemble: five networks with all outputs instead of one an output.
        runs: runs a side.
        after: trials from the damage on.
        adaptation: fields of `AdaptationConfig` that differ from table 6.7.
    """
    config = presets.load("khepera-light")
    light, watch = dict(light or {}), dict(watch or {})
    snn = replace(config.snn, kind="ensemble", hidden=15) if ensemble else config.snn
    settings = {"window": 600, "population_reset": True} | adaptation
    own = {"hidden": 5, "weights": 5.0, "mirror": False} | light
    texts = (f"{(ALL | UNHARMED)[damage]}@{ONSET}",) if damage else ()
    config = replace(
        config,
        trials=ONSET + after,
        snn=snn,
        light=replace(config.light, **own),
        watch=WatchConfig(**watch),
        evolution=replace(config.evolution, headless_chicken=0.05),
        adaptation=AdaptationConfig(**settings),
        world=WorldConfig(name="light", damage=texts),
    )
    differing = light | watch | adaptation
    words = [f"{key}={value}" for key, value in sorted(differing.items())]
    words += ["ensemble"] if ensemble else []
    config = experiments.named(config, "-".join(["light", damage or "whole", *words]))
    config = replace(config, replicates=runs)
    return replace(config, seed=trunks.seed(config)) if damage else config


def recovering(damage: str, *, runs: int = experiments.REPLICATES) -> RunConfig:
    """The preset `khepera-light-recover` with another damage.

    Args:
        damage: key of `ALL`.
        runs: runs a side.
    """
    config = presets.load("khepera-light-recover")
    world = replace(config.world, damage=(f"{ALL[damage]}@{ONSET}",))
    config = replace(config, trials=ONSET + AFTER, world=world)
    config = experiments.named(config, f"light-recover-{damage}")
    config = replace(config, replicates=runs)
    return replace(config, seed=trunks.seed(config))


MEDIAN, FEWEST, LIMIT = 6, 27, 15
HALF = 180.0  # [deg]


@bench(
    "median trials until the robot circles the lamp, undamaged, settings T5.19",
    bar="median <= 6 trials, >= 27 of 30 runs within 15",
)
def solve_light(quick: bool) -> Result:
    """30 runs of the preset `khepera-light`, 15 trials each."""
    config = undamaged()
    record = experiments.records([config], quick=quick)[config.preset]
    waits = experiments.waits(stats.trials_to_solve(record))
    median, within = waits["median"], experiments.solved_within(record, LIMIT)
    good = median is not None and median <= MEDIAN and within >= FEWEST
    last = record["solved"][:, -5:].mean()
    return Result(
        figure=median if median is not None else float(record.trials + 1),
        unit="trials",
        holds=None if quick else good,
        n=record.replicates,
        details={
            "solved within 15": within,
            "of them with half a round": int(half_rounds(record).any(1).sum()),
            "solved trials among the last five": round(float(last), 3),
            "stopped at the lamp among the last five": round(
                float((record["lamp_stops"][:, -5:] > 0).mean()), 3
            ),
            **waits,
        },
    )


def half_rounds(record: RunRecord) -> np.ndarray:
    """Trials that solved the task and got half round the lamp, ``(R, T)`` bool."""
    light = record.config.light
    lamp = LampGoal.of(light).lamp
    way = record.poses[..., -light.circle_cycles - 1 :, :2] - np.asarray(lamp)
    azimuth = np.unwrap(np.arctan2(way[..., 1], way[..., 0]))
    far = np.abs(azimuth[..., -1] - azimuth[..., 0]) >= np.radians(HALF)
    return (record["solved"] > 0) & far


MEDIANS = {"slow-wheel": 12, "noisy": 10, "minimum": 12, "maximum": 10}
RUNS = 30  # of each damage
SILENT = {"readings": "balanced", "charge_stopped": "far"}  # as in the preset
THESIS = {"slow-wheel": 10, "noisy": 4, "minimum": "8 and 9", "maximum": 7}


@bench(
    "most trials to recover (median, over four damages) in light following, T6.7",
    bar="slow wheel / noisy / minimum / maximum sensor: median <= 12 / 10 / 12 / 10",
)
def recover_light(quick: bool) -> Result:
    """`RUNS` of each damage, from trial 20 of 40."""
    configs = {damage: damaged(damage, runs=RUNS) for damage in DAMAGES}
    silent = {damage: damaged(damage, light=SILENT, runs=RUNS) for damage in DAMAGES}
    ours = {damage: recovering(damage, runs=RUNS) for damage in DAMAGES}
    wanted = [*configs.values(), *silent.values(), *ours.values()]
    records = trunks.forked(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    holds, worst = True, 0.0
    for damage, config in configs.items():
        record = records[config.preset]
        row = _row(record)
        median = row["median"]
        holds = holds and median is not None and median <= MEDIANS[damage]
        worst = max(worst, record.trials + 1.0 if median is None else median)
        found[damage] = {
            "bar": MEDIANS[damage],
            "one run on the robot (6.5)": THESIS[damage],
            **row,
            "other silent choices": _row(records[silent[damage].preset]),
            "khepera-light-recover": _row(records[ours[damage].preset]),
        }
    return Result(
        figure=worst,
        unit="trials",
        holds=None if quick else holds,
        n=record.replicates,
        details=found,
    )


def _row(record: RunRecord) -> dict[str, object]:
    onset, solved = int(record.damage_onset[0]), record["solved"]
    return {
        "solved trials, five before the damage": _share(solved[:, onset - 5 : onset]),
        "solved in the onset trial": _share(solved[:, onset]),
        "solved trials, last five": _share(solved[:, -5:]),
        **_circling(record),
        **experiments.waits(stats.trials_to_recover(record)),
    }


def _circling(record: RunRecord) -> dict[str, object]:
    """Where robots are in the last five trials, and how fast they go round the lamp.

    `circle_sweep` is what the slowest robot makes that has nothing wrong.
    """
    task = LampGoal.of(record.config.light)
    off, sweep = task.circling(record.poses[:, -5:, :, :2])
    there = off <= record.config.light.circle_within
    round_it = np.degrees(sweep[there])
    ways = {"left": round_it[round_it > 0], "right": -round_it[round_it <= 0]}
    return {"at the goal radius, last five": _share(there)} | {
        f"with the lamp on the {side}": {
            "trials": len(way),
            "degrees round it (median)": round(float(np.median(way)), 1),
        }
        for side, way in ways.items()
        if len(way)
    }


def _share(solved) -> float:
    return round(float(solved.mean()), 3)
