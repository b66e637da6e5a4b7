"""The dissertation's own fake real world beside the physics: the same experiments."""

from bench import experiments, solving
from bench.result import Result, bench
from bns import stats


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
            lambda record: solving.waits(stats.trials_to_solve(record)),
            quick,
        )
    for damage in experiments.DAMAGES:
        for window in (150, 300, 0):
            adaptation = {"window": window} if window else {}
            found[f"recover {damage}, window {window or 'none'}"] = _both(
                lambda world, d=damage, a=adaptation: experiments.damaged(
                    d, world=world, **a
                ),
                lambda record: solving.waits(stats.trials_to_recover(record)),
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
