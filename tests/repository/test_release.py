"""What is released: the wheel, one version, an image whose steps run, workflows.

The wheel holds the source trees, all of them, under the one name `bns`. Another package
adds one of each kind that can be added, by entry points alone.
"""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from tests.sources import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def test_the_version_is_the_same_everywhere():
    tree = ast.parse((ROOT / "bns" / "__init__.py").read_text())
    (own,) = (
        node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "__version__"
    )
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert own == PROJECT["version"] == str(cited["version"])
    assert cited["references"][0]["type"] == "thesis"


def test_pictures_of_the_readme_are_absolute_and_here():
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", (ROOT / "README.md").read_text())
    raw = PROJECT["urls"]["Source"].replace("github.com", "raw.githubusercontent.com")
    assert pictures
    for picture in pictures:
        assert picture.startswith(f"{raw}/main/"), picture
        assert (ROOT / picture.removeprefix(f"{raw}/main/")).is_file(), picture


def test_one_address_of_the_repository():
    source = PROJECT["urls"]["Source"]
    assert (
        yaml.safe_load((ROOT / "CITATION.cff").read_text())["repository-code"] == source
    )
    assert f"repo_url: {source}\n" in (ROOT / "mkdocs.yml").read_text()


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_is_whole(path):
    flow = yaml.safe_load(path.read_text())
    assert {"name", "jobs", "permissions"} <= set(flow)
    for job in flow["jobs"].values():
        assert job["runs-on"] and all(
            "run" in step or "uses" in step for step in job["steps"]
        )


def test_every_python_is_tested():
    flow = yaml.safe_load((ROOT / ".github/workflows/tests.yml").read_text())
    tested = flow["jobs"]["tests"]["strategy"]["matrix"]["python"]
    named = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if "3." in c]
    assert tested == named == ["3.11", "3.12", "3.13"]


def test_the_image_copies_what_is_there():
    copied = re.findall(r"^COPY (.+)$", (ROOT / "Dockerfile").read_text(), re.M)
    for line in copied:
        *sources, _ = line.split()
        assert all((ROOT / source).exists() for source in sources), line


STUB = """#!/bin/sh
echo "$(basename "$0") $*" >> "$CALLS"
case "$(basename "$0") $*" in
"ray list"*) printf '[{"node_id": 1}\\n,{"node_id": 2}]' ;;
"ray status"*) exit 1 ;;
esac
"""


@pytest.fixture
def steps(tmp_path):
    """Runs a script of docker/ with stubs for the programs that it calls."""
    for name in ("ray", "bns", "apt-get", "python", "rm"):
        (tmp_path / name).write_text(STUB)
        (tmp_path / name).chmod(0o755)
    calls = tmp_path / "calls"

    def run(script, *words, code=0):
        calls.write_text("")
        done = subprocess.run(
            ["sh", ROOT / "docker" / script, *map(str, words)],
            env={
                **os.environ,
                "PATH": f"{tmp_path}:{os.environ['PATH']}",
                "CALLS": str(calls),
            },
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.returncode == code, done.stderr
        return calls.read_text().splitlines()

    return run


def test_the_head_waits_for_all_nodes_and_runs_the_campaign(steps, tmp_path):
    calls = steps("node.sh", "head", 2, "c.toml", tmp_path / "out")
    assert calls[0].startswith("ray start --head")
    run = "bns campaign run c.toml --out"
    (campaign,) = (call for call in calls if call.startswith(run))
    assert campaign.endswith("--engine ray --ray-address 127.0.0.1:6379")
    (tmp_path / "out").mkdir()
    again = steps("node.sh", "head", 2, "c.toml", tmp_path / "out")
    assert any(call.startswith(run) and call.endswith("--resume") for call in again)
    assert calls[-1] == "ray stop"


def test_what_the_head_calls_is_understood(steps, tmp_path):
    from bns.cli import campaign
    from bns.cli.parse import parse

    calls = steps("node.sh", "head", 2, "c.toml", tmp_path / "out")
    (line,) = (call for call in calls if call.startswith("bns campaign run"))
    given = parse(campaign.Run, line.split()[3:], prog="bns campaign run")
    assert (given.engine, given.file) == ("ray", "c.toml")


def test_a_worker_joins_and_leaves(steps):
    calls = steps("node.sh", "worker", "head:6379")
    assert calls == [
        "ray start --address=head:6379 --disable-usage-stats",
        "ray status --address=head:6379",
    ]


def test_the_image_installs_the_pinned_torch_and_extras_that_exist(steps):
    (torch,) = (call for call in steps("install.sh", "system") if "torch==" in call)
    pinned = re.search(r"torch==([\d.]+)", (ROOT / "constraints.txt").read_text())
    assert f"torch=={pinned[1]} " in torch
    calls = steps("install.sh", "package", "/opt/bns")
    extras = re.search(r"/opt/bns\[(.+)\]", calls[0])[1].split(",")
    assert set(extras) <= set(PROJECT["optional-dependencies"])


@pytest.mark.parametrize("script", ["node.sh", "install.sh"])
def test_a_wrong_call_says_how(steps, script):
    steps(script, "nothing", code=2)


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
def installers() -> None:
    """Skips where nothing can be built or installed."""
    if not (find_spec("setuptools") and find_spec("pip")):
        pytest.skip("setuptools or pip is not installed")


@pytest.fixture(scope="module")
def source(tmp_path_factory, installers) -> Path:
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
def site(tmp_path_factory, installers):
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
