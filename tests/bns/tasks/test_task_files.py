"""Tasks and learners of a user's own: what is wrong with their files is said."""

import importlib.metadata
import sys
from types import SimpleNamespace

import pytest

from bns.__main__ import main
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.learners import registry as learners
from bns.tasks import registry

HEAD = 'description = "A test of what is refused"\n'


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Writes files of a package that adds tasks and learners."""
    place = tmp_path / "mine_of_test"
    place.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    found = {registry: {}, learners: {}}
    for known, entries in found.items():
        monkeypatch.setattr(known, "_installed", lambda entries=entries: entries)
    for cached in (registry.names, registry.content):
        cached.cache_clear()

    def write(file: str, text: str) -> None:
        (place / file).write_text(text)
        name, kind = file.split(".")
        if kind == "toml":
            found[registry][name] = SimpleNamespace(value="mine_of_test")
        else:
            entry = importlib.metadata.EntryPoint(
                name, f"mine_of_test.{name}:LEARNER", "bns.learners"
            )
            found[learners][name] = entry

    yield write
    for cached in (registry.names, registry.content):
        cached.cache_clear()
    for module in [m for m in sys.modules if m.startswith("mine_of_test")]:
        del sys.modules[module]


WRONG = {
    "a letter without a place": (
        'kind = "navigation"\norder = "PQZ"\n[objectives]\nP = [0.1, 0.1]',
        r"order of the task 'odd' 'Q'. Available: P. Place it in \[objectives\]",
    ),
    "a list": (
        'kind = "navigation"\norder = ["A", "B"]',
        r"order = \['A', 'B'\] is not allowed: give the objectives' letters as one",
    ),
    "no order": ('kind = "navigation"', "order = '' is not allowed"),
    "a setting": (
        'kind = "navigation"\norder = "AB"\nradius = 0.2',
        r"Unknown key of the task 'odd' 'radius'. .* give --task.radius",
    ),
    "a slip": (
        'kind = "navigation"\norder = "AB"\nobjectivs = 2',
        "Did you mean 'objectives'?",
    ),
    "off the board": (
        'kind = "navigation"\norder = "P"\n[objectives]\nP = [4, 0.1]',
        "x of objectives.P = 4 m is not allowed: give a number from -1.35 to 1.35 m",
    ),
    "no place": (
        'kind = "navigation"\norder = "P"\n[objectives]\nP = "north"',
        "objectives.P = 'north' is not allowed: give two numbers",
    ),
    "a word as objective": (
        'kind = "navigation"\norder = "P"\n[objectives]\nPub = [0.1, 0.1]',
        "objectives.Pub is not allowed: an objective is called by one letter",
    ),
    "kind": ('kind = "navigatoin"', "Did you mean 'navigation'?"),
    "another kind": ('kind = "zzz"', "Available: light, navigation, park, walk"),
    "park without goal": ('kind = "park"', "goal = None is not allowed: give x, y"),
    "park off the board": (
        'kind = "park"\ngoal = [0.1, 3.0, 0.0]',
        "y of goal = 3.0 m is not allowed",
    ),
}


@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=list(WRONG))
def test_what_a_task_s_file_may_not_say(package, text, says):
    package("odd.toml", HEAD + text)
    with pytest.raises(BnsError, match=says):
        _ = registry.of(RunConfig().with_({"task.name": "odd"})).picture


def test_every_kind_of_ours_is_one():
    assert registry.own_kinds() == ("light", "navigation", "park", "walk")


def test_a_task_that_cannot_be_read_is_named_and_the_others_listed(package, capsys):
    package("odd.toml", HEAD + "kind")
    assert main(["tasks"]) == 1
    out, err = capsys.readouterr()
    assert "infinity" in out and "odd" not in out
    assert err.count("\n") == 1 and "odd.toml cannot be read as TOML" in err
    assert "navigation" in registry.kinds()


LEARNERS = {
    "lacks_it": ("x = 1", "(mine_of_test.lacks_it:LEARNER) cannot be used: it has no"),
    "lacks_module": ("import nosuchthing", "cannot be used: No module 'nosuchthing'"),
    "no_python": ("def", "cannot be used: SyntaxError: "),
    "no_class": ("LEARNER = 3", "its learner is 3, to be a subclass of"),
}


@pytest.mark.parametrize("name", LEARNERS)
def test_a_learner_that_cannot_be_used_is_named_and_the_others_listed(
    name, package, capsys
):
    text, says = LEARNERS[name]
    package(f"{name}.py", text)
    assert main(["learners"]) == 1
    out, err = capsys.readouterr()
    assert "Random search" in out and name not in out
    assert says in err and err.count("\n") == 1
    with pytest.raises(BnsError, match="cannot be used"):
        learners.get(name)
