"""Deployed controllers of BNS in navigation: do they solve after damage?"""

from dataclasses import replace

from bench import _deployed, experiments
from bench.result import Result
from bns.experiment.config import RunConfig

DOC = "share of the last ten trials that deployed controllers solve after damage, worst"
BAR = ">= 0.90 on each of four damages; tried beside it"
RUNS = 10  # of each damage


def run(quick: bool) -> Result:
    """`RUNS` of each damage from trial 30 of 100, window 150; quick: few and short."""
    wanted = {damage: config(damage) for damage in experiments.DAMAGES}
    records = experiments.records(wanted.values(), quick=quick)
    return _deployed.result(wanted, records, quick=quick)


def config(damage: str) -> RunConfig:
    """The preset with one of the damages, deploying what was seen to work."""
    usual = experiments.damaged(damage, window=150)
    named = experiments.named(usual, f"deployed-{damage}")
    return replace(named, deploy="seen", replicates=RUNS)
