"""The wheel holds the source trees, all of them, under the one name `bns`."""

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
