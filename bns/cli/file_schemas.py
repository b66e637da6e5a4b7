"""JSON Schemas of the TOML files that describe robots, worlds, logs and set-ups.

Where a file is read into types (`msgspec`), its schema is made of those, and what a key
means is taken from the documented class that it becomes. Descriptions of models of
one's own and maps of columns are read by hand; their schemas are written here.
"""

import inspect
import re
from typing import Any

from bns.storage.reading import BEYOND

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
TRUTH: Schema = {"type": "boolean"}
NUMBER: Schema = {"type": "number", "minimum": -BEYOND, "maximum": BEYOND}
LEAST: Schema = {"type": "number", "minimum": 0, "maximum": BEYOND}
POSITIVE: Schema = {"type": "number", "exclusiveMinimum": 0, "maximum": BEYOND}


def robot() -> Schema:
    """Schema of a robot's `robot.toml`."""
    from bns.models import robot_model as model

    made = _typed(model.Facts, "A robot of the BNS testbed")
    documented = {
        "Facts": model.RobotModel,
        "CommandTable": model.CommandChannel,
        "OptionTable": model.Option,
    }
    for name, kind in documented.items():
        _described(made["$defs"][name], kind)
    radius = made["$defs"]["Facts"]["properties"]["nominal_wheel_radius"]
    radius["description"] = "in place of ctrl_per_command, which is then 1 / radius [m]"
    kinds = {"enum": ["wheeled", "legged", "servo"]}
    made["$defs"]["Facts"]["properties"]["kind"] |= kinds
    return made


def numbers() -> Schema:
    """Schema of a robot's `numbers.toml`: a table a number."""
    from bns.models import numbers as read

    made = _tables(read.Table, "Numbers of a robot of the BNS testbed")
    _described(made["$defs"]["Table"], read.Number)
    return made


def servo() -> Schema:
    """Schema of a servo's `law.toml`: a table a number."""
    from bns.models import numbers as documented
    from bns.models import servo_numbers as read

    made = _tables(read.Table, "Numbers of a servo of the BNS testbed")
    _described(made["$defs"]["Table"], documented.Number)
    for key, what in (("low", "smallest"), ("high", "largest")):
        said = f"{what} likely value, where it is uncertain"
        made["$defs"]["Table"]["properties"][key]["description"] = said
    return made


def servos() -> Schema:
    """Schema of `servos.toml`: which servo of a hexapod is which joint."""
    from bns.hardware.dynamixel import joints

    made = _typed(joints.Entry, "Servos of a hexapod of the BNS testbed")
    _described(made["$defs"]["Entry"], joints.Joint)
    table = {"type": "object", "additionalProperties": {"$ref": "#/$defs/Entry"}}
    return _file(made, {"joints": table}, required=["joints"])


def worlds() -> Schema:
    """Schema of `worlds.toml`: worlds kept by name."""
    from bns.worlds import corrected

    made = _typed(corrected.Entry, "Worlds kept for the BNS testbed")
    _described(made["$defs"]["Entry"], corrected.Corrected)
    table = {"type": "object", "additionalProperties": {"$ref": "#/$defs/Entry"}}
    return _file(made, {"worlds": table})


def hardware() -> Schema:
    """Schema of a hardware set-up, which `bns hardware setup` writes."""
    from bns.hardware.setup import Setup

    made = _typed(Setup, "A robot's set-up for the BNS testbed")
    _described(made["$defs"]["Setup"], Setup)
    return made


def model() -> Schema:
    """Schema of the description of a model of one's own, for `bns gap --model`."""
    bound = _object({"low": NUMBER, "high": NUMBER, "slack": NUMBER})
    names = {"anyOf": [TEXT, {"type": "array", "items": TEXT}]}
    top = {
        "name": TEXT | _said("of the robot; recordings carry it"),
        "model": TEXT | _said("its MJCF file, from here"),
        "window": {"type": "number", "minimum": 1e-3, "maximum": 60}
        | _said("between two samples that are compared [s]"),
        "commands": _named(_commanded(), "what the robot is told, by channel"),
        "observed": _named(_observed(), "what is seen of it, by channel"),
        "start": _start(),
        "effects": _named(names, "parts by effect; without this all that make sense"),
        "bounds": _named(bound, "by effect"),
        "log": _named(_source(), "columns of the log, by channel"),
    }
    needed = ["name", "model", "commands", "observed"]
    title = "A robot of one's own for bns gap"
    return {"$schema": DIALECT, "title": title, **_object(top, needed)}


def _commanded() -> Schema:
    return _object(
        {
            "actuator": TEXT | _said("of the MJCF; one without a name by its joint's"),
            "unit": TEXT,
            "low": NUMBER | _said("smallest command"),
            "high": NUMBER | _said("largest command"),
            "kp": POSITIVE | _said("gain of a position loop that the MJCF lacks"),
            "kd": LEAST | _said("its damping"),
            "torque": LEAST | _said("its largest torque"),
        },
        ["actuator", "unit", "low", "high"],
    )


def _observed() -> Schema:
    from bns.gap.models.mjcf import described

    parts = {name: TEXT | _said(f"name of the {name}") for name in described.QUANTITIES}
    parts["speed"] = TEXT | _said("name of the joint whose speed it is")
    scatter = "of what the robot scatters itself, per square root of a second"
    known = {
        **parts,
        "axis": {"enum": [*described.AXES, *described.TURNS]}
        | _said("of a site, body or gyro"),
        "unit": TEXT,
        "noise": POSITIVE | _said("standard deviation of its measurement"),
        "scatter": LEAST | _said(scatter),
    }
    one = {"oneOf": [{"required": [name]} for name in described.QUANTITIES]}
    return _object(known, ["unit", "noise"]) | one


def _start() -> Schema:
    settle = "how long it stands at rest before a trial [s]"
    cut = "length of pieces of long recordings [s]; needs recorded"
    return _object(
        {
            "keyframe": TEXT | _said("pose at the start of a trial; else the model's"),
            "recorded": TRUTH | _said("joints start where they were recorded"),
            "settle": LEAST | {"maximum": 60} | _said(settle),
            "cut": LEAST | _said(cut),
        }
    )


def columns() -> Schema:
    """Schema of the map of a log's columns, for `--columns`."""
    from bns.worlds.data import importing
    from bns.worlds.data.units import FACTORS
    from bns.worlds.trial import POSE

    known = {
        name: _source(tuple(FACTORS[unit])) for name, unit in importing.UNITS.items()
    }
    table = {
        "type": "object",
        "properties": known,
        "required": ["time", *POSE],
        "additionalProperties": _source(),
    }
    top = {"robot": TEXT | _said("that the recording is of"), "columns": table}
    title = "Columns of a log for the BNS testbed"
    return {"$schema": DIALECT, "title": title, **_object(top, ["columns"])}


def _source(units: tuple[str, ...] = ()) -> Schema:
    """A column, alone or with its unit."""
    unit = {"enum": list(units)} if units else TEXT
    whole = _object({"column": TEXT, "unit": unit}, ["column"])
    return {"anyOf": [TEXT | _said("name of the column"), whole]}


def _said(description: str) -> Schema:
    return {"description": description}


def _object(properties: Schema, required: list[str] | None = None) -> Schema:
    return {
        "type": "object",
        "properties": properties,
        "required": required or [],
        "additionalProperties": False,
    }


def _named(item: Schema, description: str) -> Schema:
    return {
        "type": "object",
        "description": description,
        "additionalProperties": item,
    }


def _typed(kind: Any, title: str) -> Schema:
    """The schema that msgspec makes of a type; no TOML file holds null."""
    import msgspec

    return {"$schema": DIALECT, **_plain(msgspec.json.schema(kind)), "title": title}


def _tables(kind: Any, title: str) -> Schema:
    """Of a file that is nothing but tables of one type, by name."""
    made = _typed(kind, title)
    return _file(made, {}, more=made["$ref"])


def _file(
    made: Schema,
    properties: Schema,
    *,
    required: list[str] | None = None,
    more: str = "",
) -> Schema:
    """A schema's definitions, with a file around them."""
    del made["$ref"]
    rest = {"$ref": more} if more else False
    return made | _object(properties, required) | {"additionalProperties": rest}


def _plain(schema: Any) -> Any:
    """A schema without null among the values."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    made = {key: _plain(value) for key, value in schema.items()}
    kinds = [k for k in made.get("anyOf", ()) if k != {"type": "null"}]
    if "anyOf" in made and len(kinds) < len(made["anyOf"]):
        del made["anyOf"]
        made |= kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
        if made.get("default", 0) is None:
            del made["default"]
    return made


def _described(schema: Schema, documented: type) -> None:
    """Say of each key what the attributes of a class say."""
    doc = inspect.getdoc(documented) or ""
    schema["description"] = doc.partition("\n")[0]
    _, _, listed = doc.partition("Attributes:\n")
    for names, said in re.findall(r"^    ([\w, ]+): (.*(?:\n      .*)*)", listed, re.M):
        for name in names.split(", "):
            if name in schema["properties"]:
                about = schema["properties"][name]
                if "$ref" in about:  # an editor shows what stands beside it
                    about = schema["properties"][name] = {"allOf": [about]}
                about["description"] = " ".join(said.split())


SCHEMAS = {
    "robot": robot,
    "numbers": numbers,
    "servo": servo,
    "servos": servos,
    "worlds": worlds,
    "hardware": hardware,
    "model": model,
    "columns": columns,
}
