"""Claims in each world: those settled, findings that are stale, and what they cost.

All of them are planned, and the rates of the plan measured: processor times of a trial
of a run in the claims, by learner. A batch of ten on one thread, as `bns claims run`
makes them. Trials before evolution starts give what world and training take, those
after it what evolution takes, and a late trial of navigation without a window what its
patterns take. Compiled code is used where the claims use it; the time to compile is
left out.
"""

import time
from dataclasses import asdict, replace

import numpy as np

from bench.result import Result, bench
from bench.versions import ROOT
from bns.claims import claim, provenance, published, report, runner, schedule
from bns.claims.claim import INVESTIGATIONS, member_of
from bns.claims.report import Judged
from bns.experiment.config import RunConfig

LEAST_MUJOCO, LEAST_STATIC = 150, 120


@bench(
    "claims with all comparisons at the runs that their design asks for, in MuJoCo",
    bar=">= 150 of 157",
)
def claims(quick: bool) -> Result:
    """Judge what has been run: nothing is trained here; `bns claims run --all` does."""
    del quick
    return settled("mujoco", bar=LEAST_MUJOCO)


@bench(
    "claims with all comparisons at the runs that their design asks for, static-SNN",
    bar=">= 120 of 157",
)
def claims_static(quick: bool) -> Result:
    """Judge what has been run: `bns claims run --all --world static-snn` runs it."""
    del quick
    return settled("static-snn", bar=LEAST_STATIC)


@bench("findings shown as current that do not match today's settings or code", bar="0")
def claims_stale(quick: bool) -> Result:
    """Every side of every finding shown, its settings resolved anew; and those stale.

    The settings kept with a finding have to give its digest, too.
    """
    del quick
    wrong, shown, stale = [], 0, {}
    for world in ("mujoco", "static-snn"):
        rows = judged(world)
        shown += sum(len(row.findings) for row in rows)
        wrong += [text for row in rows for text in _wrong(row, world)]
        stale[world] = sum(len(row.stale) for row in rows)
    known = published.library().settings
    broken = [digest for digest, kept in known.items() if provenance.of(kept) != digest]
    return Result(
        figure=len(wrong) + len(broken),
        unit="findings",
        holds=not wrong and not broken,
        n=shown,
        details={
            "shown as current": shown,
            "wrong": wrong,
            "settings that do not give their digest": broken,
            "shown as stale": stale,
            "claims": len(claim.claims()),
        },
    )


def _wrong(row: Judged, world: str) -> list[str]:
    """Findings of a claim that today's settings or code would not give."""
    found = []
    for each in row.findings:
        letter = row.claim.investigation
        now = []
        for side in each.cell.sides:
            config = member_of(letter, side, world=world).config
            ignored = claim.content(letter)["ignored"]
            now.append(provenance.of(provenance.resolved(config, ignored)))
        if each.made is None or not provenance.current(each.made, tuple(now)):
            found.append(f"{world} {row.claim.id}: {each.cell.text}")
    return found


def judged(world: str) -> list[Judged]:
    """All claims in a world; nothing is trained."""
    place = runner.directory(world, quick=False, root=ROOT / "runs" / "claims")
    return report.judged(list(claim.claims().values()), place, world=world, own=False)


def settled(world: str, *, bar: int) -> Result:
    """Claims whose comparisons all have the runs that the design asks for.

    Commit and seconds are those of the findings, not of this reading.

    Args:
        world: where.
        bar: how many there are to be.
    """
    rows = judged(world)
    made = [each.made for row in rows for each in row.findings if each.made]
    done = [row for row in rows if row.settled]
    details: dict[str, object] = {"all": report.counts(rows)}
    for letter in claim.INVESTIGATIONS:
        part = [row for row in rows if row.claim.investigation == letter]
        details[letter] = report.counts(part)
    details["not settled"] = {
        row.claim.id: row.note or "more runs" for row in rows if not row.settled
    }
    details["verdicts"] = {row.claim.id: row.verdict for row in done}
    return Result(
        figure=len(done),
        unit=f"of {len(rows)}",
        holds=len(done) >= bar,
        n=min((row.fewest for row in done), default=0),
        details=details,
        commits=tuple(sorted({c for each in made for c in each.commits})),
        seconds=sum(each.seconds for each in made) if made else None,
    )


MOST = 80


@bench(
    "processor hours planned for all claims in MuJoCo, trials shared, "
    "looks as expected",
    bar="<= 80 h",
)
def claims_plan(quick: bool) -> Result:
    """The plan of `bns claims plan`, in both worlds; the rates are `claims-price`'s."""
    del quick
    every = list(claim.claims().values())
    details: dict[str, object] = {}
    for world in ("mujoco", "static-snn"):
        for letter in INVESTIGATIONS:
            part = [claim for claim in every if claim.investigation == letter]
            details[f"{letter} in {world}"] = asdict(
                schedule.planned(part, world=world)
            )
        details[f"without such a world: {world}"] = list(
            runner.impossible(every, world=world)
        )
    whole = schedule.planned(every, world="mujoco")
    return Result(
        figure=whole.hours,
        unit="h",
        holds=whole.hours <= MOST,
        n=whole.runs,
        details=details,
    )


RUNS = 10
CASES = {
    "navigation": ("A", "left-20"),
    "light": ("B", "plain"),
    "walk": ("D", "type-0"),
}
SOON, LATE = 8, {"navigation": 60}


@bench(
    "seconds of a processor for one trial of one run of the dearest learner",
    bar="none: bns/claims/data/price.toml is to have these rates",
)
def claims_price(quick: bool) -> Result:
    """Three learners; quick: navigation alone, and for a few trials."""
    found = {
        name: rates(name, trials=6 if quick else LATE.get(name, 2 * SOON))
        for name in (["navigation"] if quick else CASES)
    }
    return Result(
        figure=max(row["a trial"] for row in found.values()),
        unit="s",
        holds=None,
        n=RUNS,
        details={"measured": found, "price.toml": schedule.rates()},
    )


def rates(name: str, *, trials: int) -> dict[str, float]:
    """The rates of a learner, each of one run [s]."""
    letter, side = CASES[name]
    whole = member_of(letter, side, world="mujoco").config
    config = replace(whole, trials=trials, replicates=RUNS)
    config = replace(config, world=replace(config.world, damage=()))
    idle = np.median(_times(replace(config, trials=4), whole, evolved=False)[1:])
    times = _times(config, whole, evolved=True)
    first = max(config.evolve_from, 1) + 3  # one more may compile
    soon = np.median(times[first : first + SOON])
    late = np.median(times[-SOON:])
    evolution = config.evolution
    work = evolution.population * evolution.generations
    per_trial = schedule.rates()[name]["patterns"] * (trials - SOON - first)
    grown = (late - soon) / per_trial if per_trial > 0 else 0.0
    return {
        "a trial": float(soon / RUNS),
        "trial": float(idle / RUNS),
        "evolution": float(max(0.0, soon - idle) / RUNS / work),
        "pattern": float(max(0.0, grown) / RUNS),
    }


def _times(config: RunConfig, whole: RunConfig, *, evolved: bool) -> np.ndarray:
    """Processor time of each trial of a batch [s]."""
    from bns.experiment.batch import resolve
    from bns.experiment.run import train_many

    mode = resolve(replace(whole, replicates=RUNS))[1]
    config = replace(config, compiled="yes" if mode == "compiled" else "no")
    if not evolved:
        config = replace(config, evolve_from=config.trials)
    marks = [time.process_time()]
    train_many([config], on_trial=lambda *_: marks.append(time.process_time()))
    return np.diff(marks)
