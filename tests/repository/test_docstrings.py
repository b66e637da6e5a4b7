"""Public names say what they are, what they raise, and what their arguments are.

`LEFT` is how many still lack something; it may only fall. `python -m
tests.repository.test_docstrings` lists them.
"""

import ast
from collections.abc import Iterator

from tests.sources import modules

LEFT = 0
"""of all public functions, classes and methods"""
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
    if arrays and not any(
        mark in text for mark in ("(", "shape", "[", "like ", "each")
    ):
        found.append("the shape or unit of the array")
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
    assert len(found) <= LEFT, "\n".join(found)


def test_what_a_docstring_lacks_is_found():
    bare = "def f(a, b, c) -> ndarray:\n    {}\n    raise BnsError('x')\n"
    said = "'''Says. `a`, `b`, `c`, shape ``(N,)``.\n\n    Raises:\n\t    x'''"
    assert lacks(ast.parse(bare.format("pass")).body[0]) == ["a docstring"]
    assert len(lacks(ast.parse(bare.format("'Says.'")).body[0])) == 3
    assert lacks(ast.parse(bare.format(said)).body[0]) == []


if __name__ == "__main__":
    print("\n".join(lacking()))
