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
