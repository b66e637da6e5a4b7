"""What a diagnosis is worth for control: evolve in the corrected simulator.

A robot with a hidden effect is recorded and diagnosed. Controllers (lists of commands
that have to be at three places at three moments) are evolved by differential evolution
in the nominal simulator, in the corrected one, and in one with the true effect; all
are then run in the real world. Transfer loss is how much farther from the places, in
the real world, than what was evolved with the true effect.
"""

from itertools import repeat

from bench.learning import experiments
from bench.result import Result, bench

HIDDEN = (
    "wheel_gain:wheel=left,factor=0.8",
    "dead_band:wheel=right,speed=0.05",
    "command_latency:delay=0.3",
    "axle_length:factor=0.9",
    "motor_lag:wheel=both,time_constant=0.3",
    "wheel_diameter:wheel=right,factor=1.08",
    "rolling_drag:wheel=left,torque=0.002",
    "speed_saturation:wheel=both,limit=0.09",
)
COMMANDS, HELD = 6, 2.0  # of a controller; how long each lasts [s]
MARKS = (2, 4, 6)  # commands after which it has to be at a place
FASTEST = 0.12  # [m/s]
SIZE, GENERATIONS, SEEDS = 7, 100, 1  # of the evolution: times genes; controllers
SEED = 4_000_000


@bench(
    "transfer loss of controllers evolved in the corrected simulator over "
    "the nominal's",
    bar="<= 0.5 x",
)
def gap_transfer(quick: bool) -> Result:
    """One case per hidden effect."""
    from statistics import median

    hidden = HIDDEN[: 1 if quick else 8]
    with experiments.pool_of_workers() as pool:
        rows = list(pool.map(_case, range(len(hidden)), hidden, repeat(quick)))
    ratios = [row["ratio"] for row in rows]
    figure = float(median(ratios))
    return Result(
        figure=figure,
        unit="x",
        holds=figure <= 0.5,
        n=len(rows),
        details={
            "cases": rows,
            "halved": sum(ratio <= 0.5 for ratio in ratios),
            "mean_loss_nominal_cm": _mean(rows, "nominal"),
            "mean_loss_corrected_cm": _mean(rows, "corrected"),
        },
    )


def _mean(rows, key: str) -> float:
    return sum(row[key] - row["true"] for row in rows) / len(rows)


def _case(number: int, text: str, quick: bool) -> dict:
    import numpy as np

    from bns import seeding
    from bns.gap import store
    from bns.gap.bench import wheeled_cases as cases
    from bns.gap.diagnose import diagnose
    from bns.gap.models.wheeled.model import WheeledModel
    from bns.worlds.effects import registry

    model = WheeledModel("khepera3", threads=1)
    seed = SEED + number
    rng = seeding.generator(seed, "bench", "transfer")
    effect = registry.parse(text)
    reality = [*cases.imperfection(rng), effect]
    order = {"command": 0, "actuator": 1, "body": 2, "tracking": 3}
    reality.sort(key=lambda item: order[item.stage])
    trials = cases.record(
        cases.commands(rng), [*reality, *cases.tracker(rng)], seed, model.name
    )
    found = diagnose(trials, model, seed=seed, full=False)
    texts = store.chosen(found).effects if found.verdict.named else ()
    corrected = [store.parse(item, model) for item in texts]
    places = _places(rng, model, [effect])
    costs = {}
    for name, effects in (
        ("nominal", []),
        ("corrected", corrected),
        ("true", [effect]),
    ):
        tried = [
            _evolved(model, effects, places, seed + 100 * k, quick)
            for k in range(1 if quick else SEEDS)
        ]
        costs[name] = float(np.mean([_real(genes, reality, places) for genes in tried]))
    before = max(costs["nominal"] - costs["true"], 1e-9)
    after = max(costs["corrected"] - costs["true"], 0.0)
    return {
        "hidden": text,
        "verdict": found.verdict.kind,
        "applied": list(texts),
        **costs,
        "ratio": after / before,
    }


def _places(rng, model, effects):
    """Where a random controller goes in a world with the effects: all are reachable."""
    genes = rng.uniform(-FASTEST, FASTEST, (COMMANDS, 2))
    genes[:, 0] = (genes[:, 0] + genes[:, 1]) / 2 + 0.3 * genes[:, 0]
    return _ends(genes.ravel()[:, None], model, effects)[0]


def _evolved(model, effects, places, seed: int, quick: bool):
    import numpy as np
    from scipy.optimize import differential_evolution

    def cost(genes):
        ends = _ends(genes, model, effects)
        return 100 * np.linalg.norm(ends - places, axis=2).mean(axis=1)

    found = differential_evolution(
        cost,
        [(-FASTEST, FASTEST)] * (2 * COMMANDS),
        maxiter=8 if quick else GENERATIONS,
        popsize=SIZE,
        rng=np.random.default_rng(seed),
        polish=False,
        vectorized=True,
        updating="deferred",
        tol=0.0,
    )
    return found.x


def _ends(genes, model, effects):
    """Places at the marks, ``(S, 3, 2)``, of controllers ``(genes, S)``."""
    import numpy as np

    trials = [_blank(row) for row in genes.T]
    (seen,) = model.simulate(trials, [tuple(effects)])
    return np.array([poses[list(MARKS), :2] for poses in seen])


def _blank(genes):
    import numpy as np

    from bns.worlds.trial import Trial

    times = np.arange(COMMANDS + 1) * HELD
    return Trial(
        commands=_commands(genes),
        times=times,
        observed=np.zeros((COMMANDS + 1, 3)),
        boundaries=np.arange(COMMANDS + 1),
    )


def _commands(genes):
    import numpy as np

    from bns.worlds.trial import Commands

    return Commands(np.reshape(genes, (COMMANDS, 2)), np.full(COMMANDS, HELD))


def _real(genes, reality, places) -> float:
    """Mean distance from the places in the real world [cm]."""
    import numpy as np

    from bns.worlds.physics.wheeled_world import MujocoWorld

    world = MujocoWorld("khepera3", reality=reality, threads=1)
    (trial,) = world.run([_commands(genes)])
    ends = trial.command_poses_world[list(MARKS), :2]
    return float(100 * np.linalg.norm(ends - places, axis=1).mean())
