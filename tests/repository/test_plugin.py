"""Another package adds an effect, a world and a robot, by its entry points alone."""

import json
import shutil
import subprocess
import sys
from importlib.util import find_spec

import pytest

from tests.sources import ROOT

pytestmark = pytest.mark.skipif(
    not (find_spec("setuptools") and find_spec("pip")),
    reason="setuptools or pip is not installed",
)

USE = """
import json
import numpy as np
from bns import models
from bns.models import check
from bns.worlds import registry
from bns.worlds.effects import registry as effects
from bns.worlds.trial import Commands

told = [Commands(np.full((2, 2), 0.15), [1.0, 1.0])]
def end(world, **settings):
    (trial,) = registry.make(world, robot="tug", threads=1, **settings).run(told)
    return trial.poses_world[-1].tolist()

nominal = effects.make("loose_wheel")
print(json.dumps({
    "effect": "loose_wheel" in effects.names() and nominal.is_nominal,
    "world": registry.describe()["ice"],
    "robot": models.robot("tug").kind,
    "faults": [f for c in check.check(models.robot("tug")) for f in c.faults],
    "plain": end("mujoco"),
    "ice": end("ice"),
    "loose": end("mujoco", reality=["loose_wheel:slip=0.3"]),
    "nominal": end("mujoco", reality=["loose_wheel:slip=0"]),
}))
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A directory with the example package installed in it."""
    source = tmp_path_factory.mktemp("plugin") / "plugin"
    shutil.copytree(ROOT / "examples" / "plugin", source)
    site = tmp_path_factory.mktemp("site")
    words = ("--no-deps", "--no-build-isolation", "--no-index", "--target", site)
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "-q", *map(str, words), str(source)],
        check=True,
        stdin=subprocess.DEVNULL,
    )
    return site


def test_what_it_adds_is_there_and_acts(run_python, site):
    found = json.loads(run_python("-c", USE, PYTHONPATH=str(site)).splitlines()[-1])
    assert found["effect"] and found["robot"] == "wheeled" and not found["faults"]
    assert found["world"] == "MuJoCo, with a floor that hardly grips."
    assert found["plain"][0] > 0.2
    assert found["nominal"] == found["plain"]
    assert abs(found["loose"][2]) > 0.1, "one wheel lags, so that the robot turns"
    assert found["ice"] != found["plain"]


def test_its_learner_learns(run_python, site, tmp_path):
    words = ["--learner", "climber", "--trials", "4", "--replicates", "2"]
    words += ["--rerun", "off", "--no-report", "--threads", "1"]
    out = ["--out", tmp_path / "run"]
    told = ["-m", "bns", "run", "khepera-simple", *words, *out]
    assert "4 trials of 2 runs" in run_python(*told, PYTHONPATH=str(site))


def test_the_command_line_knows_it(run_python, site):
    shown = run_python("-m", "bns", "effects", "loose_wheel", PYTHONPATH=str(site))
    assert "time constant of the slip" in shown
    words = ["-m", "bns", "--complete", "run", "demo", "--world.robot", "t"]
    assert run_python(*words, PYTHONPATH=str(site)).split() == ["tug"]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("bns_example.worlds:ice", "is not a subclass of"),
        ("bns_example.nothing:LooseWheel", "cannot be imported from"),
        ("bns_example.effects:LooseWheel", "it has to be 'other'"),
    ],
)
def test_a_wrong_entry_is_said_in_one_line(run_python, site, tmp_path, value, message):
    broken = tmp_path / "broken"
    shutil.copytree(site, broken)
    (info,) = broken.glob("*.dist-info")
    (info / "entry_points.txt").write_text(f"[bns.effects]\nother = {value}\n")
    said = run_python("-m", "bns", "effects", code=2, PYTHONPATH=str(broken))
    assert message in said and said.count("\n") == 1
