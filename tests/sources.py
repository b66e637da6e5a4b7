"""The package's source files and what they import, read without importing them."""

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TREES = {
    "bns": "bns",
    "bns.models": "models",
    "bns.worlds": "worlds",
    "bns.gap": "gap",
    "bns.hardware": "hardware",
    "bns.viz": "viz",
}
OUTSIDE = ("bench", "examples", "tests")


@dataclass(frozen=True, kw_only=True)
class Module:
    """A module of the package.

    Attributes:
        name: importable name.
        path: its file.
        imports: modules it imports anywhere, by full name.
        at_once: those of them that it imports when it is itself imported.
    """

    name: str
    path: Path
    imports: frozenset[str]
    at_once: frozenset[str]


@cache
def modules() -> dict[str, Module]:
    """All modules of the package by name."""
    found = dict(_named())
    return {name: _read(name, path, frozenset(found)) for name, path in found.items()}


def python_files() -> list[Path]:
    """All Python files of the repository."""
    trees = [*TREES.values(), *OUTSIDE]
    return sorted(p for tree in trees for p in (ROOT / tree).rglob("*.py"))


def _named():
    for root, tree in TREES.items():
        for path in sorted((ROOT / tree).rglob("*.py")):
            parts = path.relative_to(ROOT / tree).with_suffix("").parts
            if parts[-1] == "__init__":
                parts = parts[:-1]
            yield ".".join((root, *parts)), path


def _read(name: str, path: Path, known: frozenset[str]) -> Module:
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    lazy = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
    }
    lazy |= {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and "TYPE_CHECKING" in ast.unparse(branch.test)
        for node in ast.walk(branch)
    }
    every, at_once = set(), set()
    for node in ast.walk(tree):
        targets = set(_targets(node, package, known))
        every |= targets
        at_once |= targets if id(node) not in lazy else set()
    return Module(
        name=name, path=path, imports=frozenset(every), at_once=frozenset(at_once)
    )


def _targets(node: ast.AST, package: str, known: frozenset[str]):
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*above, base] if base else above)
        names = {f"{base}.{alias.name}" for alias in node.names}
        inside = names & known
        yield from inside
        if names - inside:
            yield base
