"""The schemas take every file that the program takes, and refuse what it refuses."""

import json
import tomllib

import pytest

from bns import presets
from bns.__main__ import main
from bns.cli.schema import SCHEMAS
from bns.experiment import loading
from bns.presets import __file__ as PRESETS

jsonschema = pytest.importorskip("jsonschema")
from pathlib import Path  # noqa: E402

CAMPAIGN = """
name = "windows"
preset = "khepera-simple"
replicates = 3
[settings]
trials = 100
[grid]
adaptation.window = [0, 150, 300]
world.damage = [["wheel_gain:wheel=left,factor=0.8@30"], []]
[[list]]
label = "both"
adaptation.window = 150
[sample]
count = 20
evolution.mutation_rate = { low = 0.05, high = 0.3, scale = "log" }
"""


def check(kind, content):
    jsonschema.validate(content, SCHEMAS[kind]())


@pytest.mark.parametrize("name", presets.names())
def test_every_preset_and_what_is_written_out_fit(name):
    text = (Path(PRESETS).parent / f"{name}.toml").read_text()
    check("run", tomllib.loads(text))
    check("run", tomllib.loads(loading.to_toml(presets.load(name))))


def test_a_campaign_fits():
    check("campaign", tomllib.loads(CAMPAIGN))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("run", "trails = 3"),
        ("run", "trials = 1.5"),
        ("run", "[task]\nradius = 5.0"),
        ("run", 'preset = "demmo"'),
        ("run", '[evolution]\nselection = "x"'),
        ("campaign", "[settings]\nseed = 3"),
        ("campaign", "[grid]\nadaptation.window = 3"),
    ],
)
def test_what_the_program_refuses_the_schema_refuses(kind, text):
    with pytest.raises(jsonschema.ValidationError):
        check(kind, tomllib.loads(text))


@pytest.mark.parametrize("kind", SCHEMAS)
def test_it_is_printed_and_written(kind, capsys, tmp_path):
    file = tmp_path / "x.json"
    assert main(["schema", kind]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert main(["schema", kind, "--out", str(file)]) == 0
    assert json.loads(file.read_text()) == printed
    jsonschema.Draft202012Validator.check_schema(printed)


FILES = {
    "robot": ["models/*/robot.toml", "examples/*/robot.toml"],
    "numbers": ["models/*/numbers.toml", "examples/*/numbers.toml"],
    "servo": ["models/*/law.toml"],
    "servos": ["hardware/dynamixel/*.toml"],
    "model": ["examples/arm/arm.toml"],
}


@pytest.mark.parametrize("kind", FILES)
def test_every_file_of_ours_fits(kind, root):
    found = [path for glob in FILES[kind] for path in root.glob(glob)]
    assert found
    for path in found:
        check(kind, tomllib.loads(path.read_text()))


MODEL = """
name = "arm"
model = "arm.xml"
[commands.goal]
actuator = "servo"
unit = "rad"
low = -1.0
high = 1
[observed.angle]
joint = "elbow"
unit = "rad"
noise = 0.002
"""
COLUMNS = """
[columns]
time = {column = "t", unit = "ms"}
x = "px"
y = "py"
yaw = {column = "a", unit = "deg"}
"""
NUMBER = """
[mass]
value = [0.1, 0.2]
unit = "kg"
basis = "assumed"
source = "guess"
at = { "body arm mass" = 1 }
"""


@pytest.mark.parametrize(
    ("kind", "right", "old", "new"),
    [
        ("worlds", '[worlds.a]\nreality = ["payload:mass=1"]', "reality", "real"),
        ("worlds", "[worlds.a]\nreality = []", "[]", '"payload"'),
        (
            "hardware",
            'robot = "phantomx"\nport = "/dev/ttyUSB0"',
            "phantomx",
            "khepera",
        ),
        ("hardware", 'port = "/dev/ttyUSB0"', "port", "device"),
        ("model", MODEL, 'joint = "elbow"', ""),
        ("model", MODEL, 'joint = "elbow"', 'joint = "elbow"\nsite = "tip"'),
        ("model", MODEL, "0.002", "0"),
        ("model", MODEL, 'name = "arm"', ""),
        ("columns", COLUMNS, '"ms"', '"min"'),
        ("columns", COLUMNS, 'x = "px"', ""),
        ("numbers", NUMBER, "assumed", "guessed"),
        ("numbers", NUMBER, "[0.1, 0.2]", '"1"'),
    ],
)
def test_a_file_that_is_wrong_is_refused(kind, right, old, new):
    check(kind, tomllib.loads(right))
    assert old in right
    with pytest.raises(jsonschema.ValidationError):
        check(kind, tomllib.loads(right.replace(old, new)))


def test_an_editor_can_say_what_a_key_means():
    robot = SCHEMAS["robot"]()["$defs"]["Facts"]["properties"]
    assert robot["tracker_site"]["description"] == "what an overhead camera tracks."
    assert "null" not in json.dumps(robot)
    lacking = {
        kind: sorted(
            key
            for table in SCHEMAS[kind]().get("$defs", {}).values()
            for key, about in table["properties"].items()
            if "description" not in about and table["title"] not in ("WheelTable",)
        )
        for kind in ("robot", "numbers", "servo", "servos", "worlds", "hardware")
    }
    assert not any(lacking.values()), lacking
