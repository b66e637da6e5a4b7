"""`bns repertoire`: make controllers beforehand, in a model; list and show them."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from bns.cli.fields import Positional, Seed
from bns.cli.parse import Verbs, dispatch
from bns.cli.tables import show
from bns.errors import BnsError

MANUAL = """usage: bns repertoire {make,list,show} ... [...]

  make NAME  MAP-Elites in a model of the undamaged robot; --resume goes on, or
             makes it larger
  list       those that ship with the package
  show NAME  what one is of, how it was made, and how it grew

A repertoire is one file, NAME.npz, that `--prior.repertoire NAME` gives to
learners which start from one. `bns repertoire VERB --help` is the manual of a
verb."""


@dataclass(frozen=True, kw_only=True)
class Make:
    """Make a repertoire: different controllers, each the best of its kind that was
    found in a model of the undamaged robot. Ctrl-C stops and keeps what there is;
    --resume goes on from there, also to more evaluations than first asked for.
    """

    name: Positional[str]
    """of the repertoire; it becomes NAME.npz"""
    evaluations: int
    """executions of the model in all"""
    preset: str = "hexapod-walk"
    """task, robot and world, see `bns presets`, or a TOML file"""
    genotype: str = "gait"
    """what is searched: gait (36 numbers, for six legs), or vector (all controllers)"""
    behaviour: Literal["contact", "told"] = "contact"
    """what the grid is along: contact = duty factors as they went, told = as the task
    says (walking: what duty factors are asked for; wheels: where trials end)"""
    bins: int = 5
    """of the grid along each behaviour"""
    step: float = 0.008
    """physics step of a hexapod's model [s]; 0 = the world's own"""
    seed: Seed = 1
    """of all that is drawn"""
    out: str = "."
    """folder for the file"""
    resume: bool = False
    """go on with the file that is there"""


@dataclass(frozen=True, kw_only=True)
class Show:
    """Say what a repertoire is of, how it was made, and how it grew."""

    name: Positional[str]
    """of one that ships, or PATH.npz"""
    json: bool = False
    """print JSON instead of text"""


@dataclass(frozen=True, kw_only=True)
class List:
    """List the repertoires that ship with the package."""

    json: bool = False
    """print JSON instead of a table"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of repertoires; gives the exit code."""
    does: Verbs = {"make": (Make, _make), "list": (List, _list), "show": (Show, _show)}
    return dispatch(verb, argv, does, MANUAL)


def _make(given: Make) -> int:
    from bns.cli.run import STOPPED, source, until_interrupted
    from bns.prior import maker, repertoire
    from bns.progress import Bar
    from bns.storage import files
    from bns.storage.lock import Lock

    if given.evaluations < 1:
        raise BnsError(
            f"A repertoire of {given.evaluations} evaluations holds nothing: give "
            "--evaluations 1 or more."
        )
    file = Path(given.out) / f"{given.name.removesuffix('.npz')}.npz"
    if file.exists() and not given.resume:
        raise BnsError(f"{file} is there already: add --resume, or give another name.")
    config = replace(source(given.preset)[0], threads=1)
    made = maker.Maker(
        maker.Plan(
            config=config,
            genotype=given.genotype,
            behaviour=given.behaviour,
            bins=given.bins,
            step=given.step,
            seed=given.seed,
        )
    )
    if file.exists():
        made.restore(repertoire.read(str(file)))
    files.make_directory(file.parent)
    with Lock(file.with_suffix(".making")), until_interrupted() as stop:
        files.remove_temporary(file.parent)
        with Bar(file.stem, given.evaluations, done=made.evaluations) as bar:
            done = maker.make(
                made,
                file,
                evaluations=given.evaluations,
                command=_command(given),
                on_kept=lambda m: bar.update(m.evaluations, _text(m)),
                stop=stop,
            )
    print(f"{made.evaluations} evaluations, {_text(made)}: {file}")
    if not done:
        print(f"Go on: {_command(given)} --resume")
        return STOPPED
    return 0


def _text(made: object) -> str:
    _, cells, best, _ = made.row  # type: ignore[attr-defined]
    return f"{cells} cells, best {best:.3g}"


def _command(given: Make) -> str:
    """The command that makes it, without what is as usual."""
    usual = Make(name="", evaluations=1)
    words = [f"bns repertoire make {given.name} --evaluations {given.evaluations}"]
    for name in ("preset", "genotype", "behaviour", "bins", "step", "seed"):
        value = getattr(given, name)
        if value != getattr(usual, name):
            words.append(f"--{name} {value}")
    return " ".join(words)


def _list(given: List) -> int:
    from bns.prior import repertoire

    heads = {name: repertoire.read(name) for name in repertoire.names()}
    rows = [
        [
            name,
            found.head.task,
            found.head.robot,
            found.head.genotype,
            f"{found.head.evaluations}",
            f"{len(found)}",
            f"{found.worth.max():.3g}",
        ]
        for name, found in heads.items()
    ]
    head = ["name", "task", "robot", "genes", "evaluations", "cells", "best"]
    show(head, rows, json=given.json)
    return 0


def _show(given: Show) -> int:
    import msgspec

    from bns.experiment import robots
    from bns.prior import repertoire

    found = repertoire.read(given.name)
    head = found.head
    if given.json:
        told = msgspec.to_builtins(head) | {"cells": len(found)}
        print(json.dumps(told, indent=2))
        return 0
    same = head.model == robots.digest(head.robot)
    reality = f" with {', '.join(head.reality)}" if head.reality else ""
    print(f"{head.task} of {head.robot} in the world {head.world}{reality}")
    print(f"model {head.model}, {'as here' if same else 'changed since'}")
    print(f"made by: {head.command}")
    step = f"{head.step * 1e3:g} ms" if head.step else "the model's own"
    print(f"seed {head.seed}, physics step {step}")
    print(f"{len(found)} cells along {head.behaviour}, {head.bins} bins each\n")
    rows = [
        [f"{evaluations}", f"{cells}", f"{best:.3f}", f"{total:.1f}"]
        for evaluations, cells, best, total in repertoire.growth(head.growth)
    ]
    show(["evaluations", "cells", "best", "QD score"], rows, json=False)
    return 0
