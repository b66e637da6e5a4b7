"""`bns gap bench`: blind cases made, diagnosed, and scored against sealed answers."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bns.cli.fields import Count, Positional, Seed, Threads
from bns.cli.parse import Verbs, dispatch
from bns.errors import BnsError, FormatError, UnknownNameError
from bns.progress import each

MANUAL = """usage: bns gap bench {make,run,score} [...]

  make   write recordings with hidden effects, their answers in another place
  run    diagnose them; sees the recordings only
  score  compare what was said with the answers

`bns gap bench VERB --help` is the manual of a verb. Cases of your own making: a
dataset directory each, and an answers file as `make` writes it."""


@dataclass(frozen=True, kw_only=True)
class Make:
    """Write blind cases: a dataset directory each, the answers in a file elsewhere."""

    cases: Positional[str]
    """directory for the cases"""
    answers: str
    """file for the answers, JSON; may not lie in the directory of the cases"""
    model: str = "khepera3"
    """nominal robot, or the TOML file of a model of your own"""
    count: Count = 5
    """cases of each kind"""
    kinds: tuple[str, ...] = ("single", "none")
    """single, none; pair, fault for robots on wheels and models of your own;
    off-library for the latter; lost (a leg, or a joint) for walkers"""
    seed: Seed = 0
    """of the first case"""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Diagnose the cases of a directory; those already in the file are left out."""

    cases: Positional[str]
    """directory of the cases"""
    said: str
    """file for what is said, a JSON line per case; appended to"""
    model: str = "khepera3"
    """nominal robot, or the TOML file of a model of your own"""
    threads: Threads = 2
    """threads of the physics"""


@dataclass(frozen=True, kw_only=True)
class Score:
    """Compare what was said with the answers."""

    said: Positional[str]
    """file that `run` wrote"""
    answers: Positional[str]
    """file that `make` wrote"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    del verb
    does: Verbs = {"make": (Make, _make), "run": (Run, _run), "score": (Score, _score)}
    return dispatch("gap bench", argv, does, MANUAL)


def _make(given: Make) -> int:
    from bns.gap.bench import benchmark_io
    from bns.gap.recordings import load_recordings

    model = load_recordings.model(given.model, threads=2)
    stand = _stand(model)
    for kind in given.kinds:
        if kind not in stand.kinds:
            raise UnknownNameError(f"kind of case of {model.name}", kind, stand.kinds)
    made = benchmark_io.make(
        Path(given.cases), Path(given.answers), _cases(given, stand)
    )
    print(f"{made} cases in {given.cases}, answers in {given.answers}")
    return 0


def _stand(model: Any) -> Any:
    """The robot of a model that cases are made of."""
    from bns.gap.bench import mjcf_cases, walk_cases, wheeled_cases
    from bns.gap.models.legged.model import WalkModel
    from bns.gap.models.mjcf.model import OwnModel
    from bns.gap.models.wheeled.model import WheeledModel

    if isinstance(model, OwnModel):
        return mjcf_cases.OwnStand(model)
    if isinstance(model, WalkModel):
        return walk_cases.WalkStand(model)
    if isinstance(model, WheeledModel):
        return wheeled_cases.WheeledStand(model)
    raise BnsError(f"No cases can be made of {model.name!r}; take a robot that moves.")


def _cases(given: Make, stand: Any) -> Iterator[tuple[str, Any]]:
    from bns.gap.bench import cases

    wanted = [
        (given.seed + 1000 * place + number, kind)
        for place, kind in enumerate(given.kinds)
        for number in range(given.count)
    ]
    for seed, kind in each("making cases", wanted):
        yield f"case_{seed:06d}", cases.build(seed, kind, stand)


def _run(given: Run) -> int:
    from bns.gap.bench import benchmark_io
    from bns.gap.recordings import load_recordings

    if not Path(given.cases).is_dir():
        raise FormatError(f"There is no directory {given.cases} of cases.")
    model = load_recordings.model(given.model, threads=given.threads)
    count = benchmark_io.run(
        Path(given.cases),
        model,
        Path(given.said),
        each=partial(each, "diagnosing"),
    )
    print(f"{count} cases diagnosed: {given.said}")
    return 0


def _score(given: Score) -> int:
    from bns.cli.tables import show
    from bns.gap.bench import benchmark_io, scoring

    rows = benchmark_io.score(Path(given.said), Path(given.answers))
    if not rows:
        raise BnsError(f"{given.said} holds no diagnosis; run the cases first.")
    show(["kind", "cases", "figure", "value"], _figures(rows), json=False)
    confused = scoring.confusion([row for row in rows if "verdict" in row["said"]])
    for line, count in confused.items():
        print(f"  {count:3d}  {line}")
    for row in rows:
        if "error" in row["said"]:
            print(f"  refused {row['seed']}: {row['said']['error']}")
    return 0


def _figures(rows: list[dict]) -> list[list[str]]:
    from bns.gap.bench import scoring

    made = []
    kinds = ("single", 0.0), ("single", scoring.LARGE), ("pair", 0.0), ("lost", 0.0)
    for kind, smallest in kinds:
        found = scoring.of(rows, kind, smallest)
        if not found:
            continue
        label = f"{kind} at >= {smallest:g}x" if smallest else kind
        for name, holds in (
            ("named, aliases merged", scoring.right),
            ("named exactly", scoring.strict),
            ("in the 90 % set", scoring.covered),
            ("one name, wrong", scoring.confident_wrong),
        ):
            share = scoring.share(found, holds)
            made.append([label, str(len(found)), name, f"{share:.2f}"])
    for kind, verdict in (("none", "no gap"), ("off-library", "none of the library")):
        found = scoring.of(rows, kind)
        if found:
            share = scoring.share(found, partial(_says, verdict))
            made.append([kind, str(len(found)), f'said "{verdict}"', f"{share:.2f}"])
    return made


def _says(verdict: str, row: dict[str, Any]) -> bool:
    return bool(row["said"]["verdict"] == verdict)
