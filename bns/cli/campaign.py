"""`bns campaign`: run a campaign file, say how far it is and what it says."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bns.cli.fields import Positional
from bns.cli.parse import Verbs, dispatch
from bns.cli.tables import show
from bns.errors import BnsError

if TYPE_CHECKING:
    from bns.campaign.engines.registry import Engine

MANUAL = """usage: bns campaign {run,merge,status,table,plot} ... [...]

  run FILE.toml --out DIR  run what is missing; --resume goes on
  merge DIR OTHER...       take the runs of other machines' directories
  status DIR               what is done, what failed and why
  table DIR                medians, p (Mann-Whitney, Holm), A12, power
  plot DIR                 recovery curves and sensitivity, as PNG

A campaign file varies any setting in a grid, a list or a random sample
(docs/campaigns.md). `bns campaign VERB --help` is the manual of a verb."""

FAILED = 1
"""exit code of a campaign in which batches failed"""

Measure = Literal["observation", "solve", "recover"]


@dataclass(frozen=True, kw_only=True)
class Batches:
    """Where batches run, and which: options that several verbs have."""

    engine: Literal["local", "inline", "ray"] = "local"
    """local: processes of one thread each; inline: this process; ray: a Ray cluster"""
    workers: int = 0
    """processes (local) or CPUs (ray, where it is started here); 0 = one a core"""
    ray_address: str = ""
    """HOST:PORT of a Ray cluster; without it one is started here"""
    retry: bool = False
    """try batches again that failed before"""
    mix: bool = False
    """allow results of several package versions in one directory"""

    def made(self) -> "Engine":
        """The engine, see `bns.campaign.engines.registry.make`."""
        from bns.campaign.engines import registry

        return registry.make(
            self.engine, workers=self.workers, ray_address=self.ray_address
        )


@dataclass(frozen=True, kw_only=True)
class Run(Batches):
    """Run what is missing of a campaign. Ctrl-C stops it after the next batch that is
    done, twice at once; --resume goes on and loses nothing that was done.
    """

    file: Positional[str]
    """the campaign file (TOML), or a campaign's directory to go on with"""
    out: str = ""
    """directory for the results (default: runs/NAME)"""
    resume: bool = False
    """go on with what is in the directory"""
    yes: bool = False
    """take a very large campaign"""


@dataclass(frozen=True, kw_only=True)
class Merge:
    """Take runs that a campaign's directory lacks from others: of the same campaign on
    other machines, or of parts of it. The others are not changed.
    """

    directory: Positional[str]
    """a campaign's directory"""
    others: Positional[tuple[str, ...]]
    """directories to take from"""
    mix: bool = False
    """take results of other package versions as well"""


@dataclass(frozen=True, kw_only=True)
class Status:
    """Say how far a campaign is and which batches failed; it may be running."""

    directory: Positional[str]
    """a campaign's directory"""
    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class TableOf(Status):
    """Medians with 95 % bootstrap intervals; for pairs that differ in one setting
    Mann-Whitney p, Holm's p over the whole table, A12 with its 95 % interval, and the
    power at the observed effect.
    """

    measure: Measure = "observation"
    """observation: cost after the damage (eq 3.1); solve, recover: trials until then"""


@dataclass(frozen=True, kw_only=True)
class Plot:
    """Draw recovery curves (median, 95 % bootstrap interval) and how the measure
    depends on each setting that is varied.
    """

    directory: Positional[str]
    """a campaign's directory"""
    out: str = field(default="")
    """folder for curves.png and, where a setting is varied, sensitivity.png (default:
    the directory)"""
    measure: Measure = "observation"
    """what sensitivity.png shows"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of campaigns; gives the exit code."""
    does: Verbs = {
        "run": (Run, _run),
        "merge": (Merge, _merge),
        "status": (Status, _status),
        "table": (TableOf, _table),
        "plot": (Plot, _plot),
    }
    return dispatch(verb, argv, does, MANUAL)


def _run(given: Run) -> int:
    from bns.campaign import drive, file
    from bns.campaign.store import FILE
    from bns.cli.run import STOPPED, until_interrupted

    path = Path(given.file)
    if path.is_dir():
        path, out = path / FILE, path
    else:
        out = Path(given.out or f"runs/{path.stem}")
    if not path.exists():
        raise BnsError(f"There is no campaign file {path}: see docs/campaigns.md.")
    campaign = file.read(path, sure=given.yes)
    with until_interrupted() as stop:
        session = drive.run(
            campaign,
            out,
            given.made(),
            resume=given.resume,
            retry=given.retry,
            mix=given.mix,
            progress=True,
            stop=stop,
        )
    return _say(session, out, STOPPED)


def say(session: Any, out: Path | str) -> int:
    """Print what a session did; gives how many batches failed.

    Args:
        session: that `run` of campaigns, claims or standings gave.
        out: directory of its results.
    """
    bad = len(session.failed) + session.waiting
    print(f"{session.done} batches done, {bad} failed. Results: {out}")
    for key, reason in list(session.failed.items())[:5]:
        print(f"  {key}: {reason}")
    return bad


def _say(session: Any, out: Path, stopped: int) -> int:
    bad = say(session, out)
    if session.missing:
        print(f"{session.missing} are left: bns campaign run {out} --resume")
        return stopped
    if bad:
        print(f"Try them again: bns campaign run {out} --resume --retry")
        return FAILED
    return 0


def _merge(given: Merge) -> int:
    from bns.campaign.store import merge

    if not given.others:
        raise BnsError("No directory was given to take from: name one or more.")
    others = [Path(other) for other in given.others]
    taken = merge(Path(given.directory), others, mix=given.mix)
    print(f"{taken} runs taken. Results: {given.directory}")
    return 0


def _status(given: Status) -> int:
    import json

    from bns.campaign import results

    found = results.status(results.read(given.directory))
    if given.json:
        print(json.dumps(found, indent=2))
        return 0
    rows = [
        [row["member"], row["identity"], f"{row['runs']} of {row['wanted']}"]
        for row in found["members"]
    ]
    show(["member", "identity", "runs"], rows, json=False)
    print(f"{found['runs']} of {found['wanted']} runs are done.")
    for entry in found["failed"]:
        attempts = f"{entry['attempts']} attempts"
        print(f"failed: {entry['key']} ({attempts}): {entry['reason']}")
    return 0


def _table(given: TableOf) -> int:
    from bns.campaign import results
    from bns.campaign.table import table
    from bns.cli.results import span, text
    from bns.stats.compare import A12, MEASURES

    found = table(results.read(given.directory), given.measure)
    head = ["member", "runs", "reached", "median", "95 % interval"]
    rows = [
        [r.label, f"{r.runs}", f"{r.reached}", text(r.median.value), span(r.median)]
        for r in found.rows
    ]
    if not given.json:
        show(head, rows, json=False)
        head, rows = [], []
    pairs = ["a", "b", "p", "p (Holm)", "A12", "95 % interval", "power"]
    lines = [
        [
            v.a,
            v.b,
            f"{v.p:.5f}",
            f"{v.p_holm:.5f}",
            text(v.a12.value),
            span(v.a12),
            f"{v.power:.2f}",
        ]
        for v in found.pairs
    ]
    if given.json:
        _json(head, rows, pairs, lines)
        return 0
    if lines:
        show(pairs, lines, json=False)
    print(f"{given.measure}: {MEASURES[given.measure]}")
    print(A12)
    for note in found.notes:
        print(f"Note: {note}")
    return 0


def _json(head: list, rows: list, pairs: list, lines: list) -> None:
    import json

    members = [dict(zip(head, row, strict=True)) for row in rows]
    compared = [dict(zip(pairs, line, strict=True)) for line in lines]
    print(json.dumps({"members": members, "pairs": compared}, indent=2))


def _plot(given: Plot) -> int:
    from bns.campaign import results
    from bns.viz import campaign as pictures

    out = Path(given.out or given.directory)
    made = pictures.write(results.read(given.directory), out, given.measure)
    for path in made:
        print(path)
    if out / "sensitivity.png" not in made:
        print(
            f"No sensitivity.png: no setting has two values whose runs have "
            f"{given.measure!r}. See docs/campaigns.md, or give another --measure."
        )
    return 0
