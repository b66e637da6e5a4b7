"""Imports point one way: base <- models <- worlds <- the learner; nothing sees viz."""

import graphlib

import pytest

from tests.sources import modules

BASE = {"bns", "bns.errors", "bns.seeding"}
MAY_IMPORT = {
    "base": {"base"},
    "models": {"base", "models"},
    "worlds": {"base", "models", "worlds"},
    "gap": {"base", "models", "worlds", "gap"},
    "hardware": {"base", "models", "worlds", "hardware"},
    "learner": {"base", "learner", "worlds"},
    "viz": {"base", "models", "worlds", "gap", "hardware", "learner", "viz"},
    "cli": {"base", "models", "worlds", "gap", "hardware", "learner", "viz", "cli"},
}
PROTOCOL = {
    "bns.worlds",
    "bns.worlds.trial",
    "bns.worlds.world",
    "bns.worlds.damage",
    "bns.worlds.dataset",
}
"""all that the learner may know of worlds"""

MAY_MAKE_WORLDS = {"bns.run", "bns.loading", "bns.batch", "bns.static_snn"}
"""modules beside the learner that set experiments up, so they reach the registry"""


def layer(name: str) -> str:
    if name in BASE:
        return "base"
    second = name.split(".")[1]
    if second in ("models", "worlds", "gap", "hardware", "viz"):
        return second
    return "cli" if second in ("cli", "__main__", "doctor") else "learner"


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
    wrong = [n for n in ours(module.imports) if layer(n) not in allowed]
    assert not wrong, f"{module.name} ({layer(module.name)}) imports {wrong}"


@pytest.mark.parametrize("module", LEARNER, ids=lambda module: module.name)
def test_the_learner_sees_the_world_protocol_alone(module):
    seen = [n for n in ours(module.imports) if layer(n) == "worlds"]
    if module.name in MAY_MAKE_WORLDS:
        seen = [n for n in seen if n != "bns.worlds.registry"]
    assert set(seen) <= PROTOCOL, f"{module.name} imports {set(seen) - PROTOCOL}"
    packages = {name.split(".")[0] for name in module.imports}
    assert "mujoco" not in packages, f"{module.name} imports mujoco"
    assert "rerun" not in packages, f"{module.name} imports rerun"


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_the_trees_are_reached_through_bns(module):
    tops = {name.split(".")[0] for name in module.imports}
    wrong = tops & {"models", "worlds", "gap", "hardware", "viz", "bench", "tests"}
    assert not wrong, f"{module.name} imports {wrong} beside bns"


def test_no_module_needs_itself_to_be_imported():
    graph = {m.name: {n for n in ours(m.at_once) if n != "bns"} for m in MODULES}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError with the cycle
