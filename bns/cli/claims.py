"""`bns claims`: the dissertation's claims, run and judged."""

import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from bns.claims.schedule import Price
from bns.cli.campaign import Batches
from bns.cli.fields import Positional
from bns.cli.parse import Verbs, dispatch
from bns.cli.tables import show
from bns.errors import BnsError
from bns.progress import Each, counting, uncounted

MANUAL = """usage: bns claims {list,plan,run,take,table} [...]

  list           all 157 claims: where, what is compared, what was said
  plan           what all of it costs: sides, runs, processor hours
  run ID ...     run what a claim needs and is missing, then say what it says
  run C ...      the same for all claims of an investigation
  run --all      the same for every claim whose preset exists
  take DIR ...   use finished `bns run` directories below DIR
  table          what they say, with effect sizes: by your runs, and by
                 published ones where you have fewer

The rule is in docs/claims.md. `bns claims VERB --help` is the manual of a verb."""

WORLDS = ("mujoco", "static-snn")
PUBLISHED = "published"
KEEP_EVERY = 300.0  # s
JUDGING = "judging claims"


@dataclass(frozen=True, kw_only=True)
class List:
    """List the claims: id, place, kind, what the dissertation says, comparisons."""

    ids: Positional[tuple[str, ...]] = ()
    """claims to show with all their comparisons; none lists all"""
    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan the processor hours of claims, as if none of them had run."""

    ids: Positional[tuple[str, ...]] = ()
    """claims or investigations, as in `A15 C`; none means all"""
    world: Literal["mujoco", "static-snn"] = "mujoco"
    """where robots run"""
    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class Run(Batches):
    """Run what claims need and is missing, look by look, then judge them. Runs are kept
    in runs/claims/WORLD and never done twice; it goes on wherever it was stopped. What
    is published of today's settings is not run again, unless --own.
    """

    ids: Positional[tuple[str, ...]] = ()
    """claims, as in `bns claims run A15 C22`, or investigations: A, B, C, D"""
    all: bool = False
    """every claim"""
    world: Literal["mujoco", "static-snn"] = "mujoco"
    """where robots run"""
    quick: bool = False
    """six small and short runs a side, kept apart: for a look, not for a verdict"""
    runs: int = 0
    """runs a side at most, instead of the 100 of the design"""
    own: bool = False
    """run what is published as well"""
    findings: str = ""
    """file that all findings are written to as they come; by default
    ROOT/findings.json"""
    root: str = "runs/claims"
    """where runs are kept"""


@dataclass(frozen=True, kw_only=True)
class Take:
    """Use finished runs of `bns run` for the claims: those whose settings are a
    side's, and of which there are none yet.
    """

    folders: Positional[tuple[str, ...]]
    """folders of run directories"""
    world: Literal["mujoco", "static-snn"] = "mujoco"
    """whose runs"""
    root: str = "runs/claims"
    """where runs are kept"""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Judge the claims by the runs that are there, or by the findings that come with
    the package where those rest on more runs of the same settings.
    """

    ids: Positional[tuple[str, ...]] = ()
    """claims or investigations, as in `A15 C`; none means all"""
    world: Literal["mujoco", "static-snn"] = "mujoco"
    """which runs"""
    quick: bool = False
    """judge the quick runs"""
    own: bool = False
    """by the runs in --root alone"""
    json: bool = False
    """print JSON instead of a table"""
    write: str = ""
    """write the whole page, both worlds, to this file (docs/claims.md), and its picture
    to images/ beside it"""
    publish: str = ""
    """write all findings to this file (bns/claims/data/published.json)"""
    root: str = "runs/claims"
    """where runs are kept"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of claims; gives the exit code."""
    does: Verbs = {
        "list": (List, _list),
        "plan": (Plan, _plan),
        "run": (Run, _run),
        "take": (Take, _take),
        "table": (Table, _table),
    }
    return dispatch(verb, argv, does, MANUAL)


def _list(given: List) -> int:
    from bns.claims.claim import chosen
    from bns.claims.report import kind

    wanted = chosen(given.ids)
    head = ["id", "where", "kind", "the dissertation says", "comparisons"]
    rows = []
    for claim in wanted:
        compared = "; ".join(f"{c.text} (p {c.p})" for c in claim.cells)
        short = f"{len(claim.cells)}" if claim.cells else "not tested"
        full = compared or f"not tested: {claim.untested}"
        said = full if given.ids or given.json else short
        rows.append([claim.id, claim.where, kind(claim), claim.says, said])
    show(head, rows, json=given.json)
    return 0


def _plan(given: Plan) -> int:
    from bns.claims import runner, schedule
    from bns.claims.claim import INVESTIGATIONS, chosen

    wanted = chosen(given.ids)
    head = ["investigation", "claims", "sides", "runs", "hours", "without sharing"]
    rows = []
    for letter in INVESTIGATIONS:
        part = [claim for claim in wanted if claim.investigation == letter]
        if part:
            cost = schedule.planned(part, world=given.world)
            rows.append([letter, len(part), *_costs(cost)])
    rows.append(
        ["all", len(wanted), *_costs(schedule.planned(wanted, world=given.world))]
    )
    show(head, [[str(word) for word in row] for row in rows], json=given.json)
    if not given.json:
        lacking = runner.impossible(wanted, world=given.world)
        print(f"Processor hours in {given.world}, one thread, as expected before.")
        if lacking:
            print(f"{len(lacking)} claims have no such world: {_some(lacking)}.")
    return 0


def _costs(price: Price) -> list:
    return [
        price.sides,
        price.runs,
        f"{price.hours:.1f}",
        f"{price.apart:.1f}",
    ]


def _some(names: Collection[str]) -> str:
    return ", ".join([*names][:3]) + (", ..." if len(names) > 3 else "")


def _run(given: Run) -> int:
    from bns.claims import runner
    from bns.claims.claim import chosen
    from bns.cli.run import STOPPED, until_interrupted

    if bool(given.ids) == given.all:
        raise BnsError(
            "Give claims, as in `bns claims run A15 C22`, or --all for every one."
        )
    if not 0 <= given.runs <= 10_000:
        raise BnsError(f"--runs {given.runs} is not allowed: give 1 to 10000.")
    wanted = chosen(given.ids)
    lacking = runner.impossible(wanted, world=given.world)
    for name, why in list(lacking.items())[: None if given.ids else 3]:
        print(f"{name} cannot run: {why}.")
    keeper = Keeper(given)
    with until_interrupted() as stop:
        session = runner.run(
            wanted,
            given.made(),
            world=given.world,
            quick=given.quick,
            runs=given.runs,
            root=Path(given.root),
            own=given.own or given.quick,
            mix=given.mix,
            retry=given.retry,
            stop=stop,
            found=keeper,
        )
    keeper.keep()
    for key, reason in session.failed.items():
        print(f"failed: {key}: {reason}")
    _table(
        Table(
            ids=given.ids,
            world=given.world,
            quick=given.quick,
            own=given.own or given.quick,
            root=given.root,
        )
    )
    if session.stopped:
        return STOPPED
    return int(bool(session.failed or session.waiting))


@dataclass
class Keeper:
    """Writes the findings of both worlds to a file, every few minutes at most."""

    given: Run
    wrote: float = field(default_factory=time.monotonic)

    def __call__(self) -> None:
        if time.monotonic() - self.wrote > KEEP_EVERY:
            self.keep()

    def keep(self) -> None:
        """Write them now; of quick runs none."""
        if self.given.quick:
            return
        from bns.storage import files

        path = Path(self.given.findings or f"{self.given.root}/findings.json")
        files.make_directory(path.parent)
        _publish(path, self.given.root, _both(self.given.root))
        self.wrote = time.monotonic()


def _both(root: str, *, own: bool = False, each: Each = uncounted) -> dict:
    """World -> all claims, judged."""
    from bns.claims import report, runner
    from bns.claims.claim import chosen

    return {
        world: report.judged(
            chosen(()),
            runner.directory(world, quick=False, root=Path(root)),
            world=world,
            own=own,
            each=each,
        )
        for world in WORLDS
    }


def _publish(path: Path, root: str, worlds: dict) -> None:
    """Write findings, and what was measured of the runs behind them."""
    from bns.claims import published, report, runner

    stores = {
        world: runner.directory(world, quick=False, root=Path(root)) for world in worlds
    }
    published.write(
        path,
        report.publishable(worlds),
        report.settings(worlds),
        report.runs(stores),
    )


def _take(given: Take) -> int:
    from bns.claims import runner
    from bns.claims.claim import chosen

    if not given.folders:
        raise BnsError("Give folders of run directories, as in `bns claims take runs`.")
    taken = runner.take(
        chosen(()),
        [Path(folder) for folder in given.folders],
        world=given.world,
        root=Path(given.root),
    )
    for name in taken:
        print(name)
    print(f"{len(taken)} runs taken.")
    return 0


def _table(given: Table) -> int:
    from bns.claims import report, runner
    from bns.claims.claim import chosen

    wanted = chosen(given.ids)
    if given.write or given.publish:
        if given.ids or given.quick:
            raise BnsError(
                "--write and --publish take all claims: leave ids and --quick out."
            )
        with counting(JUDGING) as each:
            worlds = _both(given.root, own=given.own, each=each)
        _written(given, worlds)
        return 0
    place = runner.directory(given.world, quick=given.quick, root=Path(given.root))
    with counting(JUDGING) as each:
        rows = report.judged(
            wanted,
            place,
            world=given.world,
            quick=given.quick,
            own=given.own,
            each=each,
        )
    _show(rows, json=given.json, brief=not given.ids)
    if not given.json:
        said = ", ".join(f"{n} {name}" for name, n in report.counts(rows).items() if n)
        what = "claim" if len(rows) == 1 else "claims"
        print(f"{len(rows)} {what} in {given.world}: {said}")
        print("* the design asks for more runs. The rule: docs/claims.md")
        if any(finding.published for row in rows for finding in row.findings):
            print(f"{PUBLISHED}: came with bns; `bns claims run ID` runs it here.")
    return 0


def _written(given: Table, worlds: dict) -> None:
    """The page, the findings, or both as files."""
    from bns.claims import page
    from bns.storage import files
    from bns.viz import claims

    if given.write:
        files.write_bytes(Path(given.write), page.page(worlds).encode())
        picture = Path(given.write).parent / page.PICTURE
        claims.write(worlds, picture)
        print(f"{given.write}\n{picture}")
    if given.publish:
        _publish(Path(given.publish), given.root, worlds)
        print(given.publish)


def _show(rows: list, *, json: bool, brief: bool) -> None:
    from bns.claims import report

    head = ["claim", "claim's verdict", *report.HEAD, "from"]
    lines = []
    for row in rows:
        origin = [PUBLISHED if each.published else "" for each in row.findings]
        origin += [PUBLISHED] * len(row.stale)
        told = report.cells(row)
        found = [(*cell, word) for cell, word in zip(told, origin, strict=True)]
        if not found and (json or not brief):
            found = [(row.note, *[""] * len(report.HEAD))]
        for number, cell in enumerate(found):
            first = json or number == 0
            lines.append(
                [row.claim.id if first else "", row.verdict if first else "", *cell]
            )
    show(head, lines, json=json)
