"""House rules that a machine can check: docstrings, sizes, formatting."""

import ast
import subprocess
import sys
from importlib.util import find_spec

import pytest

from tests.sources import ROOT, python_files

FILE_LINES, FUNCTION_LINES = 500, 50
FILES = python_files()


def ids(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", FILES, ids=ids)
def test_a_file_says_what_it_is_and_is_short(path):
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    empty = not tree.body
    assert empty or ast.get_docstring(tree), f"{ids(path)} has no docstring"
    lines = len(text.splitlines())
    assert lines <= FILE_LINES, f"{ids(path)} has {lines} lines"


@pytest.mark.parametrize("path", FILES, ids=ids)
def test_functions_are_short(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = node.end_lineno - node.lineno + 1 - _docstring_lines(node)
            assert lines <= FUNCTION_LINES, f"{ids(path)}: {node.name}, {lines} lines"


@pytest.mark.skipif(find_spec("ruff") is None, reason="ruff is not installed")
@pytest.mark.parametrize("words", [("check",), ("format", "--check")], ids=" ".join)
def test_ruff_has_nothing_to_say(words):
    done = subprocess.run(
        [sys.executable, "-m", "ruff", *words, "--no-cache", "."],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def _docstring_lines(node) -> int:
    if not ast.get_docstring(node):
        return 0
    return node.body[0].end_lineno - node.body[0].lineno + 1
