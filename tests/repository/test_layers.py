"""Imports point one way: base <- models <- worlds <- the learner; nothing sees viz."""

import graphlib
import json

import pytest

from tests.sources import modules

BASE = {"bns", "bns.errors", "bns.progress", "bns.seeding", "bns.storage"} | {
    f"bns.storage.{name}"
    for name in (
        "arrays",
        "files",
        "lock",
        "numbers",
        "parquet",
        "reading",
        "seal",
        "tables",
    )
}
"""what knows no robot and no world; of the storage all that knows no run"""

LOW = {"base", "models", "worlds"}
HIGH = LOW | {"gap", "hardware", "learner", "experiment"}
MAY_IMPORT = {
    "base": {"base"},
    "models": {"base", "models"},
    "worlds": LOW,
    "gap": LOW | {"gap"},
    "hardware": LOW | {"hardware"},
    "learner": {"base", "learner", "experiment", "worlds"},
    "experiment": LOW | {"gap", "learner", "experiment"},
    "viz": HIGH | {"viz"},
    "cli": HIGH | {"viz", "cli"},
}
PROTOCOL = {
    "bns.worlds",
    "bns.worlds.world",
    "bns.worlds.trial",
    "bns.worlds.damage",
    "bns.worlds.data.dataset",
}
"""all that the learner may know of worlds"""

EXPERIMENT = {
    f"bns.experiment.{name}"
    for name in (
        "batch",
        "diagnosing",
        "robots",
        "run",
        "static_snn",
        "world_factory",
    )
} | {"bns.doctor", "bns.prior.maker"}
"""modules around the learner that set experiments up: they make worlds by name, and ask
the diagnosis for those that mend their model"""


def layer(name: str) -> str:
    if name in BASE:
        return "base"
    if name in EXPERIMENT:
        return "experiment"
    second = name.split(".")[1]
    if second in ("models", "worlds", "gap", "hardware", "viz"):
        return second
    return "cli" if second in ("cli", "__main__") else "learner"


def ours(names) -> list[str]:
    return sorted(n for n in names if n.split(".")[0] == "bns")


MODULES = sorted(modules().values(), key=lambda module: module.name)
LEARNER = [m for m in MODULES if layer(m.name) == "learner"]


def test_the_trees_are_found():
    found = {layer(module.name) for module in MODULES}
    assert {"base", "models", "worlds", "learner", "viz", "cli"} <= found


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_imports_point_one_way(module):
    allowed = MAY_IMPORT[layer(module.name)]
    # `bns` names what others have, and imports it at its first use
    imports = module.at_once if module.name == "bns" else module.imports
    wrong = [n for n in ours(imports) if layer(n) not in allowed]
    assert not wrong, f"{module.name} ({layer(module.name)}) imports {wrong}"


@pytest.mark.parametrize("module", LEARNER, ids=lambda module: module.name)
def test_the_learner_sees_the_world_protocol_alone(module):
    seen = {n for n in ours(module.imports) if layer(n) == "worlds"}
    assert seen <= PROTOCOL, f"{module.name} imports {seen - PROTOCOL}"


def test_the_learner_does_not_reach_what_makes_worlds():
    reached, waiting = set(), {"bns.learners.bns.learner", "bns.tasks.navigation"}
    while waiting:
        name = waiting.pop()
        reached.add(name)
        known = set(ours(modules()[name].imports)) & set(modules()) - {"bns"}
        waiting |= {n for n in known - reached if layer(n) != "worlds"}
    assert len(reached) > 5
    assert not reached & EXPERIMENT


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_no_concrete_world_and_no_mujoco_outside_their_place(module):
    packages = {name.split(".")[0] for name in module.imports}
    if layer(module.name) in ("base", "learner", "experiment"):
        assert "mujoco" not in packages, f"{module.name} imports mujoco"
        assert "rerun" not in packages, f"{module.name} imports rerun"
        concrete = [n for n in ours(module.imports) if n.endswith("_world")]
        assert not concrete, f"{module.name} imports {concrete}: ask the registry"


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_the_trees_are_reached_through_bns(module):
    tops = {name.split(".")[0] for name in module.imports}
    wrong = tops & {"models", "worlds", "gap", "hardware", "viz", "bench", "tests"}
    assert not wrong, f"{module.name} imports {wrong} beside bns"


def test_no_module_needs_itself_to_be_imported():
    graph = {m.name: {n for n in ours(m.at_once) if n != "bns"} for m in MODULES}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError with the cycle


HEAVY = {"torch", "mujoco", "rerun", "matplotlib", "scipy", "pyarrow", "pandas"}
TREES = {"models", "worlds", "gap", "hardware", "viz"}


def loaded(run_python, code, **options) -> set[str]:
    tell = "import json, sys; print('\\n' + json.dumps(sorted(sys.modules)))"
    output = run_python("-c", f"{code}\n{tell}", **options)
    return {name.split(".")[0] for name in json.loads(output.splitlines()[-1])}


def test_import_bns_is_light(run_python):
    assert not loaded(run_python, "import bns") & HEAVY


def test_help_is_light(run_python):
    code = """
import sys
sys.argv = ["bns", "--help"]
from bns.__main__ import main
try:
    main()
except SystemExit as done:
    assert not done.code, done.code
"""
    assert not loaded(run_python, code) & HEAVY


def test_every_module_is_importable_and_no_tree_is_imported_twice(run_python, root):
    from tests.sources import modules

    names = [name for name in sorted(modules()) if not name.endswith("__main__")]
    code = f"from importlib import import_module\nfor name in {names}:\n"
    found = loaded(run_python, code + "    import_module(name)", cwd=root)
    assert "bns" in found
    assert not found & TREES
