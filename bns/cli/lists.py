"""What there is: `bns presets`, `learners`, `tasks`, `worlds`, `robots`, `effects`,
`examples`; and what this machine has: `bns doctor`.
"""

import ast
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.cli.tables import show
from bns.errors import BnsError, UnknownNameError

PLACE = Path(__file__).parents[1] / "examples"
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
BAD = 1
"""exit code of `bns doctor`, and of a list that leaves something out, when something
must be changed"""
FEW = 4  # commands of a robot that a list shows
Stage = Literal["", "command", "actuator", "body", "optics", "sensor", "tracking"]
Rows = tuple[list[str], list[list[str]]]


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """List what exists, one line each."""

    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class Effects:
    """List the effects: one line each, or those that FILTER finds with parameters,
    units and ranges.
    """

    filter: Positional[str] = ""
    """part of a name or of a meaning, such as wheel or friction"""
    stage: Stage = ""
    """only effects that act there"""
    json: bool = False
    """print JSON instead of a table, parameters included"""


@dataclass(frozen=True, kw_only=True)
class Examples:
    """List the examples, print one, or copy them all: scripts of less than 100 lines,
    notebooks, robots, and a package that adds to the testbed.
    """

    name: Positional[str] = ""
    """script to print, such as 01_drive_a_robot"""
    copy: str = ""
    """directory to copy all examples to; must not be there yet"""
    json: bool = False
    """print JSON instead of a table"""


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """Check versions, known-bad pins, graphics, compiler, cores, disk and serial
    ports, and say what to install. Exit code 1 if something must be changed; what is
    only missing for one feature does not count.
    """

    json: bool = False
    """print JSON instead of a table"""


def main(verb: str, argv: list[str]) -> int:
    """Print the list that `verb` names; gives the exit code."""
    if verb == "doctor":
        return _doctor(parse(Doctor, argv, prog="bns doctor"))
    if verb == "effects":
        return _effects(parse(Effects, argv, prog="bns effects"))
    if verb == "examples":
        return _examples(parse(Examples, argv, prog="bns examples"))
    given = parse(Arguments, argv, prog=f"bns {verb}")
    head, rows = LISTS[verb]()
    show(head, rows, json=given.json)
    return _left_out(verb)


def _left_out(verb: str) -> int:
    """Say what a list lacks because it cannot be used; gives the exit code."""
    if verb == "learners":
        from bns.learners.registry import faults
    elif verb == "tasks":
        from bns.tasks.registry import faults
    else:
        return 0
    found = faults()
    for error in found.values():
        print(f"Left out: {error}", file=sys.stderr)
    return BAD if found else 0


def presets() -> Rows:
    """Every preset with its size."""
    from bns import presets as known

    rows = []
    for name in known.names():
        config = known.load(name)
        size = f"{config.replicates} x {config.trials}"
        rows.append([name, size, known.describe(name)])
    return ["preset", "runs x trials", "what it is"], rows


def learners() -> Rows:
    """Every learner that can be used."""
    from bns.learners import registry

    bad = registry.faults()
    good = [name for name in registry.names() if name not in bad]
    rows = [[name, registry.describe(name)] for name in good]
    return ["learner", "what it is"], rows


def tasks() -> Rows:
    """Every task that can be read, with its kind."""
    from bns.tasks import registry

    rows = [
        [name, registry.kind(name), registry.describe(name)]
        for name in registry.readable()
    ]
    return ["task", "kind", "what it is"], rows


def worlds() -> Rows:
    """Every world."""
    from bns.worlds import registry

    rows = [[name, doc] for name, doc in registry.describe().items()]
    return ["world", "what it is"], rows


def robots() -> Rows:
    """Every robot model with what it can be told."""
    from bns import models

    rows = []
    for name in models.names():
        robot = models.robot(name)
        told = [
            f"{c.name} {c.low:.4g} to {c.high:.4g} {c.unit}".removesuffix(" 1")
            for c in robot.commands
        ]
        if len(told) > FEW:
            told = [*told[: FEW - 1], f"and {len(told) - FEW + 1} more"]
        rows.append([name, robot.kind, ", ".join(told), robot.doc])
    return ["robot", "kind", "commands", "what it is"], rows


def _effects(given: Effects) -> int:
    found = _chosen(given.filter.lower(), given.stage)
    if given.json:
        show(*_parameters(found), json=True)
        return 0
    if given.filter:
        _print_parameters(found)
        return 0
    show(
        ["effect", "stage", "what it is"],
        [[effect.name, effect.stage, effect.doc] for effect in found],
        json=False,
    )
    print("Parameters, units and ranges: bns effects NAME, or a part of one.")
    return 0


def _chosen(filter: str, stage: str) -> list[Any]:
    """The effects that are asked for: by name, else by what they mean."""
    from bns.worlds.effects import registry

    known = [registry.get(name) for name in registry.names()]
    there = [effect for effect in known if stage in ("", effect.stage)]
    found = [e for e in there if filter == e.name] or [
        e for e in there if filter in f"{e.name} {e.doc}".lower()
    ]
    if not found:
        raise UnknownNameError("effect", filter, [effect.name for effect in there])
    return found


def _print_parameters(found: list[Any]) -> None:
    """Effects with their parameters, in three columns that fit a terminal."""
    rows: list[list[str]] = []
    for effect in found:
        rows += [[effect.name, f"({effect.stage})", effect.doc]]
        for p in effect.parameters:
            unit = "" if p.unit == "1" else f" {p.unit}"
            span = f"{p.low:g} to {p.high:g}{unit}, nominal {p.nominal:g}"
            rows.append([f"  {p.name}", span, p.doc])
        for c in effect.choices:
            rows.append([f"  {c.name}", f"{c.shown} (default {c.default})", c.doc])
    show(["effect", "range", "meaning"], rows, json=False)


def _parameters(found: list[Any]) -> Rows:
    """Effects, a line for each of their parameters and choices."""
    rows = []
    for effect in found:
        rows.append([effect.name, effect.stage, "", "", "", effect.doc])
        for p in effect.parameters:
            span = f"{p.low:g} to {p.high:g}"
            rows.append(
                ["", "", p.name, p.unit, f"{span}, nominal {p.nominal:g}", p.doc]
            )
        for c in effect.choices:
            rows.append(["", "", c.name, "", f"{c.shown} (default {c.default})", c.doc])
    return ["effect", "stage", "parameter", "unit", "range", "meaning"], rows


def _examples(given: Examples) -> int:
    if given.copy:
        if given.name:
            raise BnsError(
                f"--copy takes all examples, not {given.name!r} alone: leave the name "
                f"out, or write `bns examples {given.name} > FILE`."
            )
        return _copy(Path(given.copy))
    scripts = {path.stem: path for path in sorted(PLACE.glob("*.py"))}
    if not given.name:
        rows = [[name, says(path)] for name, path in scripts.items()]
        show(["example", "what it shows"], rows, json=given.json)
        if not given.json:
            print("Read one: bns examples NAME. Take all: bns examples --copy DIR.")
        return 0
    name = given.name.removesuffix(".py")
    if name not in scripts:
        raise UnknownNameError("example", given.name, scripts)
    print(scripts[name].read_text(encoding="utf-8"), end="")
    return 0


def says(path: Path) -> str:
    """The first line of a script's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.split("\n", 1)[0]


def _copy(to: Path) -> int:
    if to.exists():
        raise BnsError(f"{to} exists and is not overwritten; give another directory.")
    try:
        shutil.copytree(PLACE, to, ignore=LEFT_OUT)
    except OSError as error:
        raise BnsError(
            f"Cannot write {to}: {error.strerror or 'not all of it'}. Give a directory "
            "that can be written."
        ) from error
    print(f"examples:  {to}")
    return 0


LISTS: dict[str, Callable[[], Rows]] = {
    "presets": presets,
    "learners": learners,
    "tasks": tasks,
    "worlds": worlds,
    "robots": robots,
}


def _doctor(given: Doctor) -> int:
    from bns.doctor import examine

    findings = examine()
    rows = [[f.state, f.what, f.found, f.remedy] for f in findings]
    show(["state", "what", "found", "what to do"], rows, json=given.json)
    bad = [f.what for f in findings if f.state == "bad"]
    if not given.json:
        print(f"To be changed: {', '.join(bad)}." if bad else "Ready to run.")
    return BAD if bad else 0
