"""`bns presets`, `worlds`, `robots`, `effects`: what exists, one line each."""

from collections.abc import Callable
from dataclasses import dataclass

from bns.cli.parse import parse
from bns.cli.tables import show

FEW = 4  # commands of a robot that a list shows
Rows = tuple[list[str], list[list[str]]]


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """List what exists, one line each."""

    json: bool = False
    """print JSON instead of a table"""


def main(verb: str, argv: list[str]) -> int:
    """Print the list that `verb` names."""
    given = parse(Arguments, argv, prog=f"bns {verb}")
    head, rows = LISTS[verb]()
    show(head, rows, json=given.json)
    return 0


def presets() -> Rows:
    """Every preset with its size."""
    from bns import presets as known

    rows = []
    for name in known.names():
        config = known.load(name)
        size = f"{config.replicates} x {config.trials}"
        rows.append([name, size, known.describe(name)])
    return ["preset", "runs x trials", "what it is"], rows


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
            f"{c.name} {c.low:.4g} to {c.high:.4g} {c.unit}" for c in robot.commands
        ]
        if len(told) > FEW:
            told = [*told[: FEW - 1], f"and {len(told) - FEW + 1} more"]
        rows.append([name, robot.kind, ", ".join(told), robot.doc])
    return ["robot", "kind", "commands", "what it is"], rows


def effects() -> Rows:
    """Every effect, a line for each of its parameters and choices."""
    from bns.worlds.effects import registry

    rows = []
    for name in registry.names():
        effect = registry.get(name)
        rows.append([name, effect.stage, "", "", "", effect.doc])
        for p in effect.parameters:
            span = f"{p.low:g} to {p.high:g}"
            rows.append(
                ["", "", p.name, p.unit, f"{span}, nominal {p.nominal:g}", p.doc]
            )
        for c in effect.choices:
            rows.append(["", "", c.name, "", f"{c.shown} (default {c.default})", c.doc])
    return ["effect", "stage", "parameter", "unit", "range", "meaning"], rows


LISTS: dict[str, Callable[[], Rows]] = {
    "presets": presets,
    "worlds": worlds,
    "robots": robots,
    "effects": effects,
}
