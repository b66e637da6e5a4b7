"""What stands around the code: one version, an image whose steps run, workflows."""

import ast
import os
import re
import subprocess
import tomllib

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
