"""The wheel holds the source trees, all of them, under the one name `bns`.

Another package adds one of each kind that can be added, by entry points alone.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.sources import ROOT

pytestmark = pytest.mark.skipif(
    not (find_spec("setuptools") and find_spec("pip")),
    reason="setuptools or pip is not installed",
)
BESIDE = ("pyproject.toml", "README.md", "LICENSE")
NO_SOURCE = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")

USE = """
import sys
from pathlib import Path
import bns
from bns import models
from bns.worlds.effects import registry as effects
assert Path(bns.__file__).is_relative_to(sys.prefix), bns.__file__
for name in models.names():
    assert models.spec(name).compile().nbody > 1, name
from bns import presets
assert presets.names() and effects.names()
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A copy of what is packaged, so that the checkout stays clean."""
    copy = tmp_path_factory.mktemp("source")
    shutil.copytree(ROOT / "bns", copy / "bns", ignore=NO_SOURCE)
    for name in BESIDE:
        shutil.copy(ROOT / name, copy)
    return copy


@pytest.fixture(scope="module")
def wheel(source, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("dist")
    words = ("wheel", "--no-deps", "--no-build-isolation", "--no-index")
    _run("pip", *words, "--wheel-dir", out, source, cwd=out)
    (built,) = out.glob("*.whl")
    return built


def test_the_wheel_holds_the_source_trees(source, wheel):
    names = zipfile.ZipFile(wheel).namelist()
    held = {name for name in names if not name.split("/")[0].endswith(".dist-info")}
    wanted = {p.relative_to(source).as_posix() for p in _files(source / "bns")}
    assert held - wanted == set(), "in the wheel alone"
    assert wanted - held == set(), "missing from the wheel: see package-data"
    assert {name.split("/")[0] for name in held} == {"bns"}


def test_the_licence_is_in_the_wheel(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)


def test_the_wheel_works_where_there_is_no_checkout(wheel, tmp_path):
    environment = tmp_path / "env"
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", environment], check=True
    )
    python = environment / "bin" / "python"
    words = ("install", "--no-deps", "--no-index", "--no-compile", wheel)
    _run("pip", "--python", python, *words, cwd=tmp_path)
    _lend_dependencies(environment)
    neutral = tmp_path / "neutral"
    neutral.mkdir()
    for words in ([python, "-c", USE], [environment / "bin" / "bns", "--help"]):
        done = subprocess.run(
            words,
            cwd=neutral,
            env={**os.environ, "PYTHONPATH": ""},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr


def _lend_dependencies(environment: Path) -> None:
    """Let the environment find this one's packages, but not this one's `bns`.

    Plain paths: the hook of an editable install is in a `.pth` file, which Python
    reads in its own site directory alone.
    """
    paths = [path for path in sys.path if Path(path).name == "site-packages"]
    (site,) = environment.glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text("\n".join(paths) + "\n")


def _files(tree: Path):
    return (path for path in tree.rglob("*") if path.is_file())


def _run(module: str, *words, cwd: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, words)],
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


USE_PLUGIN = """
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
    found = json.loads(
        run_python("-c", USE_PLUGIN, PYTHONPATH=str(site)).splitlines()[-1]
    )
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


@pytest.mark.parametrize("learner", ["climber", "bns"])
def test_its_task_is_learned(run_python, site, tmp_path, learner):
    words = ["--task.name", "edge", "--learner", learner, "--replicates", "2"]
    words += ["--rerun", "off", "--threads", "1", "--trials", "3"]
    out = ["--out", tmp_path / "run"]
    told = ["-m", "bns", "run", "khepera-simple", *words, *out]
    assert "3 trials of 2 runs" in run_python(*told, PYTHONPATH=str(site))
    assert "near the upper edge" in (tmp_path / "run" / "report.html").read_text()


def test_the_command_line_knows_it(run_python, site):
    shown = run_python("-m", "bns", "effects", "loose_wheel", PYTHONPATH=str(site))
    assert "time constant of the slip" in shown
    words = ["-m", "bns", "--complete", "run", "demo", "--world.robot", "t"]
    assert run_python(*words, PYTHONPATH=str(site)).split() == ["tug"]


RUN = ("run", "demo", "--task.name", "other", "--out", "run")


@pytest.mark.parametrize(
    ("group", "value", "words", "message"),
    [
        ("effects", "bns_example.worlds:ice", (), "is not a subclass of"),
        ("effects", "bns_example.nothing:LooseWheel", (), "cannot be imported from"),
        ("effects", "bns_example.effects:LooseWheel", (), "it has to be 'other'"),
        ("tasks", "bns_example.nothing", RUN, "be had from 'bns_example.nothing'"),
        ("tasks", "bns_example", RUN, "the package bns_example holds no other.toml"),
    ],
)
def test_a_wrong_entry_is_said_in_one_line(
    run_python, site, tmp_path, group, value, words, message
):
    broken = tmp_path / "broken"
    shutil.copytree(site, broken)
    (info,) = broken.glob("*.dist-info")
    (info / "entry_points.txt").write_text(f"[bns.{group}]\nother = {value}\n")
    told = ("-m", "bns", *(words or ("effects",)))
    said = run_python(*told, code=2, PYTHONPATH=str(broken))
    assert message in said and said.count("\n") == 1
