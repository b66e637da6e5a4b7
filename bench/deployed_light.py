"""Deployed controllers of BNS in light following: do they solve after damage?"""

from dataclasses import replace

from bench import _deployed, experiments, light_runs
from bench.result import Result
from bns.experiment.config import RunConfig

DOC = "the same in light following, whose trials begin anywhere on the board"
BAR = ">= 0.90 on each of four damages; tried beside it"
RUNS = 10  # of each damage


def run(quick: bool) -> Result:
    """`RUNS` of each damage from trial 20 of 70; quick: few and short."""
    wanted = {damage: config(damage) for damage in light_runs.DAMAGES}
    records = experiments.records(wanted.values(), quick=quick)
    return _deployed.result(wanted, records, quick=quick)


def config(damage: str) -> RunConfig:
    """`khepera-light-recover` with one of the damages, 50 trials after it."""
    usual = replace(light_runs.recovering(damage), trials=light_runs.ONSET + 50)
    named = experiments.named(usual, f"deployed-light-{damage}")
    return replace(named, deploy="seen", replicates=RUNS)
