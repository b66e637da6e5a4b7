"""`bns standings`: all learners on the same robots; who recovers, and how soon."""

from dataclasses import dataclass
from pathlib import Path

from bns.cli.campaign import FAILED, Batches, say
from bns.cli.fields import Positional
from bns.cli.parse import Verbs, dispatch
from bns.cli.tables import show

MANUAL = """usage: bns standings {plan,run,table,plot} [RIVAL ...] [...]

  plan   what a part of the standings costs in processor hours
  run    run what is missing of it; it goes on wherever it was stopped
  table  what the runs say: trials to the bar, shares of the ceiling, wins
  plot   what is deployed over the trials after the damage, as PNG

RIVAL is an entry of the standings or any learner, one of your own as well;
none means all entries. `bns standings VERB --help` is the manual of a verb."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Say what a part of the standings costs in processor hours; nothing runs."""

    rivals: Positional[tuple[str, ...]] = ()
    """entries or learners; none means all entries"""
    tasks: tuple[str, ...] = ()
    """walk, navigate, light; none means all"""
    priors: tuple[str, ...] = ()
    """P0 none, P1 exact, P2 off by a fixed gap, PG geometry; none: all of a rival"""
    kinds: tuple[str, ...] = ()
    """sets of damages: inside, outside; none means both"""
    damages: tuple[str, ...] = ()
    """some of these sets by name, as type0; none means all"""
    runs: int = 30
    """of each learner, prior and damage"""
    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class Run(Batches, Plan):
    """Run what is missing. Runs are kept and never done twice; learners that are the
    same until the damage train those trials once. Ctrl-C stops after the next batch.
    """

    root: str = "runs/standings"
    """where runs are kept"""


@dataclass(frozen=True, kw_only=True)
class Table(Plan):
    """Say what the runs say, for each task, prior and set of damages."""

    root: str = "runs/standings"
    """where runs are kept"""
    write: str = ""
    """write the page to this file (docs/standings.md); tasks without a run here keep
    what it says of them"""


@dataclass(frozen=True, kw_only=True)
class Plot(Plan):
    """Draw what is deployed over the trials after the damage, a picture a task."""

    root: str = "runs/standings"
    """where runs are kept"""
    out: str = "."
    """folder for the pictures"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of the standings; gives the exit code."""
    does: Verbs = {
        "plan": (Plan, _plan),
        "run": (Run, _run),
        "table": (Table, _table),
        "plot": (Plot, _plot),
    }
    return dispatch(verb, argv, does, MANUAL)


def _entries(given: Plan) -> list:
    from bns.standings.design import Wanted, entries

    return entries(
        Wanted(
            tasks=given.tasks,
            rivals=given.rivals,
            priors=given.priors,
            kinds=given.kinds,
            damages=given.damages,
            runs=given.runs,
        )
    )


def _plan(given: Plan) -> int:
    from bns.standings.run import hours

    found = hours(_entries(given), given.runs)
    rows = [[*key, f"{value:.2f}"] for key, value in found.items()]
    show(["task", "rival", "prior", "hours"], rows, json=given.json)
    if not given.json:
        print(f"{sum(found.values()):.1f} processor hours in all.")
    return 0


def _run(given: Run) -> int:
    from bns.cli.run import STOPPED, until_interrupted
    from bns.standings.run import hours, run

    entries = _entries(given)
    print(
        f"{sum(hours(entries, given.runs).values()):.1f} processor hours from nothing."
    )
    with until_interrupted() as stop:
        session = run(
            entries,
            given.made(),
            runs=given.runs,
            root=Path(given.root),
            retry=given.retry,
            mix=given.mix,
            stop=stop,
        )
    bad = say(session, given.root)
    if session.stopped:
        return STOPPED
    return FAILED if bad else 0


def _table(given: Table) -> int:
    from bns.standings import figures, page
    from bns.storage import files
    from bns.viz import standings

    cells = figures.read(_entries(given), Path(given.root))
    if given.write:
        path = Path(given.write)
        before = path.read_text(encoding="utf-8") if path.is_file() else ""
        files.write_text(path, page.page(cells, before))
        made = standings.write(cells, path.parent / page.PICTURES)
        print(f"{len(cells)} cells: {path}", *made, sep="\n")
        return 0
    rows = []
    for key, held in figures.groups(cells).items():
        for name, some in figures.by_rival(held).items():
            found = figures.row(name, some)
            middle, never, runs = found.waits["the task"]
            waits = f"{middle.value:g} [{middle.low:g}, {middle.high:g}]"
            shares = (found.deployed, found.last, found.tried)
            size = f"{found.runs[0]} x {found.runs[1]}"
            texts = [waits, f"{never} of {runs}", *(f"{share:.2f}" for share in shares)]
            rows.append([" ".join(key), name, size, *texts])
    head = ["standing", "learner", "n", "trials", "never", "deployed", "last", "tried"]
    show(head, rows, json=given.json)
    return 0


def _plot(given: Plot) -> int:
    from bns.standings import figures
    from bns.viz import standings

    cells = figures.read(_entries(given), Path(given.root))
    for path in standings.write(cells, Path(given.out)):
        print(path)
    return 0
