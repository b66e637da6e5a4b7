"""House rules that a machine can check: docstrings, sizes, formatting.

Public names say what they are, what they raise, and what their arguments are.
`python -m tests.repository.test_style` lists those that lack something.
"""

import ast
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from tests.sources import ROOT, modules, python_files

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


MANY = 3
"""arguments from which a docstring has to say what they are"""


def public(tree):
    """Public functions, classes and methods of a module, with their names."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_":
            yield node.name, node
            if isinstance(node, ast.ClassDef):
                for item in node.body:
                    if isinstance(item, ast.FunctionDef) and item.name[0] != "_":
                        yield f"{node.name}.{item.name}", item


def lacks(node) -> list[str]:
    """What the docstring of a public name lacks; overloads have none of their own."""
    if any(ast.unparse(mark) == "overload" for mark in node.decorator_list):
        return []
    text = ast.get_docstring(node)
    if not text:
        return ["a docstring"]
    if isinstance(node, ast.ClassDef) or text.startswith("See `"):
        return []
    found = []
    raised = {
        raise_.exc.func.id
        for raise_ in ast.walk(node)
        if isinstance(raise_, ast.Raise)
        and isinstance(raise_.exc, ast.Call)
        and isinstance(raise_.exc.func, ast.Name)
        and raise_.exc.func.id.endswith("Error")
    }
    if raised and "Raises:" not in text:
        found.append(f"Raises: {', '.join(sorted(raised))}")
    names = [a.arg for a in (*node.args.args, *node.args.kwonlyargs)]
    names = [name for name in names if name not in ("self", "cls")]
    if len(names) >= MANY and "Args:" not in text:
        unsaid = [name for name in names if f"`{name}`" not in text]
        if len(unsaid) >= MANY:
            found.append(f"Args: {', '.join(unsaid)}")
    arrays = [
        a for a in (node.returns,) if a is not None and "ndarray" in ast.unparse(a)
    ]
    takes = [
        a.arg
        for a in (*node.args.args, *node.args.kwonlyargs)
        if a.annotation is not None
        and "ndarray" in ast.unparse(a.annotation)
        and not ast.unparse(a.annotation).startswith("Mapping")
    ]
    marked = any(mark in text for mark in ("(", "shape", "[", "like ", "each"))
    if arrays and not marked:
        found.append("the shape or unit of the array")
    if takes and not marked:
        found.append(f"the shape or unit of {', '.join(takes)}")
    return found


def lacking() -> Iterator[str]:
    """Names whose docstrings lack something, and what."""
    for module in modules().values():
        tree = ast.parse(module.path.read_text(encoding="utf-8"))
        for label, node in public(tree):
            if missing := lacks(node):
                yield f"{module.name}.{label}: {'; '.join(missing)}"


def test_public_names_say_what_they_are():
    found = list(lacking())
    assert not found, "\n".join(found)


def test_what_a_docstring_lacks_is_found():
    bare = "def f(a: ndarray, b, c) -> ndarray:\n    {}\n    raise BnsError('x')\n"
    said = "'''Says. `a`, `b`, `c`, shape ``(N,)``.\n\n    Raises:\n\t    x'''"
    assert lacks(ast.parse(bare.format("pass")).body[0]) == ["a docstring"]
    assert len(lacks(ast.parse(bare.format("'Says.'")).body[0])) == 4
    assert lacks(ast.parse(bare.format(said)).body[0]) == []


if __name__ == "__main__":
    print("\n".join(lacking()))
