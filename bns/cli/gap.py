"""`bns gap`: where a recording and a nominal model part, and which effect it is."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tyro

from bns.cli.parse import parse
from bns.errors import BnsError, UnknownNameError

VERBS = ("check", "diagnose")
MANUAL = """usage: bns gap {check,diagnose} DATA... [...]

  check     is the recording sound? repairs and faults, one line each
  diagnose  is there a gap, where, which effect causes it, how far does it shrink?

DATA is a dataset directory (several are pooled) or a CSV log with --columns FILE.toml.
`bns gap VERB --help` is the manual of a verb."""


@dataclass(frozen=True, kw_only=True)
class Check:
    """Check recordings against a model: time stamps, lost and doubled samples, wraps,
    spikes, stuck and quantised channels. Repairs are listed; a fault that cannot be
    repaired stops it.
    """

    data: tyro.conf.Positional[tuple[str, ...]]
    """dataset directories, or one CSV log with --columns"""
    model: str = "khepera3"
    """nominal robot model, see `bns robots`"""
    columns: str = ""
    """TOML file that maps the log's columns to channels (docs/formats.md)"""


@dataclass(frozen=True, kw_only=True)
class Diagnose(Check):
    """Diagnose the sim-to-real gap of recordings: no gap, one effect, several that
    these data cannot tell apart, two together, or none of the library. Writes
    OUT/diagnosis.json and prints the verdict.
    """

    out: str = field(default="")
    """directory for diagnosis.json; none: print only"""
    seed: int = 0
    """of what is drawn (null distributions, bootstraps)"""
    most: int = 3
    """largest number of effects at once"""
    threads: int = 2
    """threads of the physics"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of the gap diagnosis; gives the exit code."""
    del verb
    if not argv or argv[0] in ("-h", "--help"):
        print(MANUAL)
        raise SystemExit(0)
    if argv[0] == "check":
        return _check(parse(Check, argv[1:], prog="bns gap check"))
    if argv[0] == "diagnose":
        return _diagnose(parse(Diagnose, argv[1:], prog="bns gap diagnose"))
    raise UnknownNameError("verb of `bns gap`", argv[0], VERBS)


def _check(given: Check) -> int:
    from bns.gap import check

    model = _model(given.model, 1)
    usable, notes = check.check(_trials(given), model)
    for note in notes:
        print(note)
    print(f"{len(usable)} trials can be used.")
    return 0


def _diagnose(given: Diagnose) -> int:
    from bns.gap.diagnose import diagnose

    out = Path(given.out) if given.out else None
    if out and out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    model = _model(given.model, given.threads)
    found = diagnose(_trials(given), model, seed=given.seed, most=given.most)
    if out:
        out.mkdir(parents=True)
        (out / "diagnosis.json").write_text(found.to_json())
    _say(found)
    if out:
        print(f"Everything: {out}/diagnosis.json")
    return 0


def _say(found: Any) -> None:
    """The verdict in words, then the best fits."""
    print(found.verdict.sentence)
    if found.verdict.change:
        print(found.verdict.change)
    for fit in found.fits[:5]:
        print(
            f"  held-out loss {fit.held_out:.5g}  {' + '.join(fit.names) or 'nothing'}"
        )
    for line in (*found.faults, *found.warnings):
        print(f"note: {line}")


def _model(name: str, threads: int) -> Any:
    from bns import models

    kind = models.robot(name).kind
    if kind != "wheeled":
        raise BnsError(
            f"{name!r} is of kind {kind!r}; `bns gap` takes wheeled robots, the servo "
            "pendulum is reached from Python (bns.gap.servo)."
        )
    from bns.gap.wheeled import WheeledModel

    return WheeledModel(name, threads=threads)


def _trials(given: Check) -> list[Any]:
    from bns.worlds import dataset, importing
    from bns.worlds.column_map import ColumnMap

    if given.columns:
        mapped = ColumnMap.read(given.columns)
        return [t for path in given.data for t in importing.from_csv(path, mapped)]
    return [trial for path in given.data for trial in dataset.read(path).trials]
