"""What all 157 claims cost, planned before they run."""

from dataclasses import asdict

from bench.result import Result, bench
from bns.claims import price, runner
from bns.claims.claim import INVESTIGATIONS, claims

MOST = 80


@bench(
    "processor hours planned for all claims in MuJoCo, trials shared, "
    "looks as expected",
    bar="<= 80 h",
)
def claims_plan(quick: bool) -> Result:
    """The plan of `bns claims plan`, in both worlds; the rates are `claims-price`'s."""
    del quick
    every = list(claims().values())
    details: dict[str, object] = {}
    for world in ("mujoco", "static-snn"):
        for letter in INVESTIGATIONS:
            part = [claim for claim in every if claim.investigation == letter]
            details[f"{letter} in {world}"] = asdict(price.planned(part, world=world))
        details[f"without such a world: {world}"] = list(
            runner.impossible(every, world=world)
        )
    whole = price.planned(every, world="mujoco")
    return Result(
        figure=whole.hours,
        unit="h",
        holds=whole.hours <= MOST,
        n=whole.runs,
        details=details,
    )
