"""Every bench keeps the contract of `bench/result.py`; rows are stored and shown."""

import ast
import importlib.util
import json

import pytest

from bench import __main__ as command
from bench import runner
from bench.result import Result
from bench.runner import Bench, discover, measure, page, plain, store, stored, table
from bns.errors import BnsError
from tests.sources import ROOT

BENCHES = discover()
KEYS = ["name", "figure", "unit", "bar", "holds", "n", "seconds", "command"]
KEYS += ["versions", "machine", "commit", "date", "quick", "details"]


@pytest.fixture
def small(monkeypatch):
    """A bench that measures 1.05 x, or what it is told."""
    result = Result(figure=1.05, unit="x", holds=True, n=3, details={"a": float("nan")})

    def run(self, *, quick):
        print("chatter")
        return result

    monkeypatch.setattr(Bench, "run", run)
    return Bench(name="small", module="none", doc="how small", bar="<= 1.10 x")


def test_every_function_marked_as_a_bench_is_found_once_and_takes_quick():
    marked = []
    for path in (ROOT / "bench").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and any(
                ast.unparse(mark).startswith("bench(") for mark in node.decorator_list
            ):
                marked.append(node.name.replace("_", "-"))
                assert [a.arg for a in node.args.args] == ["quick"], node.name
    assert sorted(marked) == sorted(BENCHES)


@pytest.mark.parametrize("bench", BENCHES.values(), ids=lambda bench: bench.name)
def test_a_bench_says_what_it_measures_and_its_bar(bench):
    assert bench.doc and "\n" not in bench.doc
    assert bench.bar and "\n" not in bench.bar


def test_the_benches_of_time_exist():
    assert {"suite-time", "demo-time"} <= set(BENCHES)


@pytest.mark.parametrize(
    "name,row", stored().items(), ids=lambda value: str(value)[:20]
)
def test_a_committed_result_is_whole_and_not_quick(name, row):
    assert set(KEYS) <= set(row)
    assert not row["quick"]
    assert name in BENCHES, "a result whose bench is gone"


def test_a_row_holds_everything(small, capsys):
    row = measure(small, quick=False)
    assert list(row) == KEYS
    assert row["figure"] == 1.05 and row["holds"] is True and row["n"] == 3
    assert row["command"] == "python -m bench small"
    assert row["details"] == {"a": None}
    assert row["versions"]["python"] and row["machine"]["cores"] >= 1
    json.dumps(row, allow_nan=False)
    assert capsys.readouterr().out == "", "a bench may not print between JSON lines"


def test_a_quick_row_never_replaces_a_full_one(small, tmp_path):
    store({**measure(small, quick=False), "commit": "abc"}, "speed", tmp_path)
    store({**measure(small, quick=True), "figure": 9.0}, "speed", tmp_path)
    assert stored(directory=tmp_path)["small"]["figure"] == 1.05
    assert stored(quick=True, directory=tmp_path)["small"]["figure"] == 9.0


def test_a_full_row_of_code_that_no_commit_has_is_not_kept(small, tmp_path):
    row = measure(small, quick=False)
    with pytest.raises(BnsError, match="not kept"):
        store({**row, "commit": "abc-dirty"}, "speed", tmp_path)
    store({**row, "commit": "abc-dirty", "quick": True}, "speed", tmp_path)
    assert not stored(directory=tmp_path)


def test_a_row_has_the_commit_and_seconds_of_what_it_read(small, monkeypatch):
    result = Result(
        figure=1.0, unit="x", holds=None, n=1, commits=("1" * 40, "2" * 40 + "+"),
        seconds=99.0,
    )  # fmt: skip
    monkeypatch.setattr(Bench, "run", lambda self, *, quick: result)
    row = measure(small, quick=False)
    assert row["commit"] == f"{'1' * 12}, {'2' * 12}-dirty"
    assert row["seconds"] == 99.0


def test_the_table_has_every_bench_measured_or_not(small):
    other = Bench(name="other", module="none", doc="another", bar="> 1 | 2")
    rows = {"small": measure(small, quick=False)}
    lines = table({"small": small, "other": other}, rows).splitlines()
    assert len(lines) == 4
    assert lines[2] == "| `other` | not measured yet | > 1 \\| 2 |  |  |  |  |"
    assert lines[3].startswith("| `small` | 1.05 x | <= 1.10 x | yes | 3 |")
    assert "how small" in page({"small": small}, rows)


def test_a_broken_bar_is_bold(small):
    row = {**measure(small, quick=False), "holds": False}
    assert "| **no** |" in table({}, {"small": row})


def test_plain_makes_arrays_json():
    import numpy as np

    value = {"a": np.array([1.0, np.inf]), 2: (np.int64(3), "text"), "n": None}
    assert plain(value) == {"a": [1.0, None], "2": [3, "text"], "n": None}


def test_a_figure_that_is_no_number_is_refused(monkeypatch, small):
    result = Result(figure=float("nan"), unit="x", holds=None, n=1)
    monkeypatch.setattr(Bench, "run", lambda self, *, quick: result)
    with pytest.raises(ValueError, match="small measured nan"):
        measure(small, quick=True)


def test_an_unknown_bench_is_exit_code_2_with_a_suggestion(capsys):
    assert command.main(["suite-tine"]) == 2
    assert "Did you mean 'suite-time'?" in capsys.readouterr().err


@pytest.mark.parametrize("holds,code", [(True, 0), (None, 0), (False, 1)])
def test_the_exit_code_tells_whether_the_bar_holds(
    small, monkeypatch, tmp_path, capsys, holds, code
):
    result = Result(figure=1.0, unit="x", holds=holds, n=1)
    monkeypatch.setattr(Bench, "run", lambda self, *, quick: result)
    monkeypatch.setattr(command, "find", lambda name: small)
    monkeypatch.setattr(
        command, "store", lambda row, subject: runner.store(row, subject, tmp_path)
    )
    monkeypatch.setattr(runner, "commit", lambda: "abc")
    assert command.main(["small"]) == code
    assert json.loads(capsys.readouterr().out)["holds"] is holds


def test_what_benches_import_is_there_within_functions_as_well():
    missing = []
    for path in (ROOT / "bench").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            module = node.module if isinstance(node, ast.ImportFrom) else ""
            if module.startswith(("bench", "bns")):
                names = [alias.name for alias in node.names]
                lost = [name for name in names if not _there(module, name)]
                missing += [f"{path.name}: {module}.{name}" for name in lost]
    assert not missing


def _there(module, name):
    """Whether a module has a name, or a package a module of that name."""
    home = importlib.import_module(module)
    return hasattr(home, name) or (
        hasattr(home, "__path__")
        and importlib.util.find_spec(f"{module}.{name}") is not None
    )
