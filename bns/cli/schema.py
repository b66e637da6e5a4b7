"""`bns schema`: JSON Schema of the TOML files, for editors to complete and check."""

import json
from collections.abc import Callable
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from bns.cli.fields import Positional, Setting, settings
from bns.cli.file_schemas import DIALECT
from bns.cli.file_schemas import SCHEMAS as OTHERS
from bns.cli.parse import parse
from bns.errors import BnsError
from bns.storage import files

ANY_NUMBER = {"type": "number"}


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Print the JSON Schema of a kind of TOML file. An editor with the Even Better TOML
    or Taplo extension completes settings and shows what they mean where the file begins
    with `#:schema run.schema.json`.
    """

    kind: Positional[
        Literal[
            "run", "campaign", "worlds", "robot", "numbers", "servo", "servos",
            "hardware", "model", "columns",
        ]
    ] = "run"  # fmt: skip
    """run: what `bns run FILE.toml` reads; campaign: `bns campaign run`; worlds:
    worlds.toml; robot, numbers, servo: robot.toml, numbers.toml and law.toml of a
    robot; servos: of a hexapod; hardware: what `bns hardware setup` writes; model: what
    `bns gap --model` reads; columns: what `bns gap --columns` reads"""
    out: str = ""
    """file to write, such as run.schema.json; without it the schema is printed"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code.

    Raises:
        BnsError: a file is there that is no schema, or cannot be written.
    """
    del verb
    given = parse(Arguments, argv, prog="bns schema")
    text = json.dumps(SCHEMAS[given.kind](), indent=2, ensure_ascii=False)
    if given.out:
        path = Path(given.out)
        if path.is_file() and DIALECT not in path.read_text("utf-8", "replace"):
            raise BnsError(
                f"{path} is no JSON Schema and is not overwritten; give another --out."
            )
        files.write_text(path, text + "\n")
        print(given.out)
    else:
        print(text)
    return 0


def run() -> dict[str, Any]:
    """Schema of a run's configuration."""
    from bns import presets
    from bns.experiment.config import RunConfig

    top = _table(settings(RunConfig), _value)
    top["properties"]["preset"] |= {"enum": list(presets.names())}
    top["properties"]["description"] = {"type": "string", "description": "free text"}
    return {"$schema": DIALECT, "title": "A run of the BNS testbed", **top}


def campaign() -> dict[str, Any]:
    """Schema of a campaign's file."""
    from bns import presets
    from bns.campaign.identity import OWN
    from bns.experiment.config import RunConfig

    own = [s for s in settings(RunConfig) if ".".join(s.path) not in OWN]
    one, many = _table(own, _value), _table(own, _values)
    sample = _table(own, _drawn)
    sample["properties"]["count"] = {"type": "integer", "minimum": 1}
    one_of_list = {**one, "properties": {**one["properties"], "label": _TEXT}}
    counts = {"type": "integer", "minimum": 1}
    return {
        "$schema": DIALECT,
        "title": "A campaign of the BNS testbed",
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "name": _TEXT,
            "description": _TEXT,
            "preset": {"enum": list(presets.names())},
            "replicates": {**counts, "description": "runs of each configuration"},
            "seed": {"type": "integer", "minimum": 0},
            "batch_runs": {**counts, "description": "runs that share a batch"},
            "settings": one,
            "grid": many,
            "list": {"type": "array", "items": one_of_list},
            "sample": sample,
        },
    }


def _table(known: list[Setting], shape: Callable[[Setting], Any]) -> dict[str, Any]:
    """An object with the settings; those of an inner dataclass are in its own."""
    top: dict[str, Any] = _object(known[0].title if known else "")
    for setting in known:
        at = top
        for name in setting.path[:-1]:
            title = setting.title
            at = at["properties"].setdefault(name, _object(title))
        at["properties"][setting.path[-1]] = shape(setting)
    return top


def _object(description: str) -> dict[str, Any]:
    return {
        "type": "object",
        "description": description,
        "additionalProperties": False,
        "properties": {},
    }


def _value(setting: Setting) -> dict[str, Any]:
    said: dict[str, Any] = {"description": " ".join(setting.doc.split())}
    if setting.default is not MISSING:
        said["default"] = setting.default
    return said | _kind(setting)


def _values(setting: Setting) -> dict[str, Any]:
    return {"type": "array", "minItems": 1, "items": _value(setting)}


def _drawn(setting: Setting) -> dict[str, Any]:
    span = {"low": ANY_NUMBER, "high": ANY_NUMBER, "scale": {"enum": ["linear", "log"]}}
    drawn = {"type": "object", "properties": span, "required": ["low", "high"]}
    return {"anyOf": [drawn, _values(setting), _value(setting)]}


def _kind(setting: Setting) -> dict[str, Any]:
    from bns.experiment.validate import BOUNDS

    if setting.several:
        effect = {"type": "object", "required": ["effect"]}
        return {"type": "array", "items": {"anyOf": [_TEXT, effect]}}
    if get_origin(setting.kind) is Literal:
        return {"enum": list(get_args(setting.kind))}
    made: dict[str, Any] = dict(_KINDS[setting.kind])
    bound = BOUNDS.get(".".join(setting.path))
    if bound and setting.kind in (int, float):
        made |= {"minimum": bound.low, "maximum": bound.high}
    return made


_TEXT = {"type": "string"}
_KINDS: dict[Any, dict[str, Any]] = {
    str: _TEXT,
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
}
SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "run": run,
    "campaign": campaign,
    **OTHERS,
}
