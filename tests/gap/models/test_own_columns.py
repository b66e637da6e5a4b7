"""Maps of columns for a robot that a TOML file describes (`--columns`)."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.recordings import load_recordings
from tests.sources import ROOT

ARM = ROOT / "examples" / "arm" / "arm.toml"
MAP = """[columns]
time = { column = "t_ms", unit = "ms" }
shoulder_goal = { column = "g1", unit = "deg" }
elbow_goal = { column = "g2", unit = "deg" }
shoulder = { column = "a1", unit = "deg" }
elbow = { column = "a2", unit = "deg" }
trial = "run"
"""


@pytest.fixture
def log(tmp_path):
    rows = [f"{20 * n},10,-20,{n},{-n},{n // 50}" for n in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t_ms,g1,g2,a1,a2,run", *rows]) + "\n")
    return str(path)


def read(log, text):
    path = log.replace("log.csv", "map.toml")
    with open(path, "w", encoding="utf-8") as out:
        out.write(text)
    model = OwnModel.read(ARM, threads=1)
    return load_recordings.trials([log], model, columns=path)


def test_a_map_names_columns_and_units(log):
    trials = read(log, MAP)
    assert len(trials) == 2
    assert trials[0].commands.values[0] == pytest.approx(np.radians([10, -20]))
    assert trials[0].observed[10] == pytest.approx(np.radians([10, -10]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no table .columns."),
        (f'robot = "khepera3"\n{MAP}', "robot 'khepera3'"),
        (MAP.replace("elbow =", "elbo ="), "Did you mean 'elbow'"),
        (MAP.replace('"a2"', '"a3"'), "no column 'a3'"),
        (MAP.replace('"g2", unit = "deg"', '"g2", unit = "degrees"'), "a unit among"),
    ],
)
def test_what_is_wrong_with_a_map_is_said(log, text, said):
    with pytest.raises(BnsError, match=said) as caught:
        read(log, text)
    assert "\n" not in str(caught.value)
