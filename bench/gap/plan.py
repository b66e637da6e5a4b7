"""Does the next command that the tool asks for resolve what it left tied?

A hidden effect is recorded with one poor kind of drive only. Where the diagnosis ends
in a tie that holds the truth, the planned command is recorded in the same world and
both recordings are diagnosed together. Resolved: one explanation is left and it is the
true one; or what is left besides it is what the plan said no command can part from it.
"""

import json

from bench.gap.kept_cases import DIRECTORY
from bench.result import Result, bench

SEED = 6_100_000  # lower ones were scored once
TIES, MOST = 25, 100  # ties to judge; cases to look for them in
SIZES = (1.0, 8.0)  # of the effects over what the poor recording shows
POOR = ("straight drive", "turn in place", "arcs, left", "wheel alone")
NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.008"
FILE = DIRECTORY / "gap4_plan.jsonl"


@bench("ties that the planned command resolves", bar=">= 0.8 of ties")
def gap_plan(quick: bool) -> Result:
    """Look for ties, plan, record, diagnose again."""
    from bns.gap.models.wheeled.model import WheeledModel

    model = WheeledModel("khepera3", threads=1)
    rows: list[dict] = []
    looked, done = 0, _done()
    for number in range(4 if quick else MOST):
        looked += 1
        seed = SEED + number
        if str(seed) not in done:
            done[str(seed)] = _case(seed, model)
            _keep(seed, done[str(seed)])
        if done[str(seed)]:
            rows.append(done[str(seed)])
        if len(rows) >= (1 if quick else TIES):
            break
    open_ = [row for row in rows if row["offered"]]
    solved = [row for row in open_ if row["resolved"]]
    figure = len(solved) / len(open_) if open_ else float("nan")
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.8 if open_ else None,
        n=len(open_),
        details={
            "cases_looked_at": looked,
            "ties": len(rows),
            "ties_that_no_command_parts_said_so": len(rows) - len(open_),
            "resolved_of_all_ties": len(solved) / len(rows) if rows else None,
            "to_one_name": sum(row["alone"] for row in open_),
            "below_3_times": _part(open_, 0.0, 3.0),
            "3_times_and_more": _part(open_, 3.0, float("inf")),
            "of_two": _share([row for row in open_ if len(row["tied"]) == 2]),
            "of_more": _share([row for row in open_ if len(row["tied"]) > 2]),
            "cases": rows,
        },
    )


def _part(rows: list[dict], low: float, high: float) -> dict[str, float]:
    return _share([row for row in rows if low <= row["size"] < high])


def _share(rows: list[dict]) -> dict[str, float]:
    """How many ties, and how many of them were resolved."""
    return {"n": len(rows), "resolved": sum(row["resolved"] for row in rows)}


def _done() -> dict[str, dict | None]:
    """Cases that were judged, by seed; None = no tie."""
    if not FILE.is_file():
        return {}
    lines = map(json.loads, FILE.read_text().splitlines())
    return {str(line["seed"]): line["row"] for line in lines}


def _keep(seed: int, row: dict | None) -> None:
    from bns.gap.records import plain

    DIRECTORY.mkdir(parents=True, exist_ok=True)
    with FILE.open("a") as out:
        out.write(json.dumps({"seed": seed, "row": plain(row)}) + "\n")


def _case(seed: int, model) -> dict | None:
    """One case; None where the poor recording left no tie that holds the truth."""
    from bns import seeding
    from bns.gap.diagnose import diagnose
    from bns.gap.planning import excitation, plan

    rng = seeding.generator(seed, "bench", "plan")
    kinds = [e for e in excitation.wheeled(seed=1) if any(p in e.name for p in POOR)]
    picked = kinds[int(rng.integers(len(kinds)))]
    told = [picked.commands] * 3
    name, effect, size = _hidden(rng, told, model)
    if effect is None:
        return None
    trials = _record(told, effect, seed)
    found = diagnose(trials, model, seed=seed, full=False)
    named = [names[0] for names in found.verdict.named if len(names) == 1]
    if found.verdict.kind != "either" or name not in named:
        return None
    made = plan.plan(found, model)
    row = {
        "hidden": str(effect),
        "size": size,
        "first": picked.name,
        "tied": named,
        "offered": bool(made.repeats),
        "plan": made.sentence,
        "runs": [[option.excitation.name, count] for option, count in made.steps],
    }
    if not made.repeats:
        return {**row, "resolved": False, "alone": False}
    asked = [option.excitation.commands for option, n in made.steps for _ in range(n)]
    more = _record(asked, effect, seed + 1)
    again = diagnose([*trials, *more], model, seed=seed, full=False)
    left = [names[0] for names in again.verdict.named if len(names) == 1]
    allowed = {name, *_alike(name, made)}
    return {
        **row,
        "then": again.verdict.kind,
        "left": left,
        "resolved": name in left and set(left) <= allowed,
        "alone": left == [name],
        "p_gap": again.verdict.p_gap,
        "p_misfit": again.verdict.p_misfit,
    }


def _alike(name: str, made) -> set[str]:
    """What the plan said no command parts from an effect."""
    pairs = [[made.tied[at][0] for at in pair] for pair in made.alike]
    return {other for pair in pairs if name in pair for other in pair}


def _hidden(rng, told, model):
    """An explanation's name, its effect as the poor recording shows it, its size."""
    import numpy as np

    from bns.gap.bench.hidden import SEEN, drawn
    from bns.gap.decomposition import descent
    from bns.gap.decomposition.problem import Problem

    problem = Problem.of(_record(told, None, 0), model)
    point = descent.nothing(problem)
    pool = [row for row in problem.rows if not row.nuisance and not row.stepped]
    row = pool[int(rng.integers(len(pool)))]
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    pool = [item for item in pool if item.term == row.term]
    hidden = drawn(rng, problem, point, pool, size * SEEN)
    if hidden is None:
        return row.term, None, 0.0
    return hidden.term, hidden.effect, size


def _record(told, effect, seed: int):
    from bns import seeding
    from bns.worlds.physics.wheeled_world import MujocoWorld

    world = MujocoWorld(
        "khepera3", reality=[*([effect] if effect else []), NOISE], threads=1
    )
    seeds = [seeding.integer(seed, "bench", "plan", n) for n in range(len(told))]
    return world.run(told, seeds=seeds)
