"""The settings of a dataclass as options: names, types, defaults, what they mean.

What an attribute means stands as a string below it, as everywhere in this package.
"""

import ast
import inspect
import textwrap
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError

T = TypeVar("T")


class Mark(Enum):
    """What an annotation can say of a setting on the command line."""

    POSITIONAL = "positional"
    FLAT = "flat"
    RARE = "rare"


@dataclass(frozen=True)
class Within:
    """The whole numbers that an option takes.

    Args:
        low: the smallest.
        high: the largest.
    """

    low: int
    high: int


Positional = Annotated[T, Mark.POSITIONAL]
"""given by its place, without a name"""
Flat = Annotated[T, Mark.FLAT]
"""a dataclass whose settings are named without its own name before them"""
Rare = Annotated[T, Mark.RARE]
"""shown by `--help-all` alone"""
Seed = Annotated[int, Within(0, 2**63 - 1)]
"""what random draws begin from"""
Threads = Annotated[int, Within(1, 1024)]
"""threads of the physics"""
Count = Annotated[int, Within(1, 1_000_000)]
"""how many are made"""


@dataclass(frozen=True)
class Setting:
    """One setting of a dataclass or of one inside it.

    Args:
        path: attributes that lead to it, the outermost first.
        name: as on the command line, "task.corner-x".
        kind: its type.
        default: `dataclasses.MISSING` where it has to be given.
        doc: what it means, with unit.
        group: the dataclass it is in, by the name before the dot; "" = the outermost.
        title: what that dataclass is.
        positional: given by its place.
        rare: left out of the short manual.
        within: the whole numbers that it takes; None = what its type takes.
    """

    path: tuple[str, ...]
    name: str
    kind: Any
    default: Any
    doc: str
    group: str
    title: str
    positional: bool
    rare: bool
    within: Within | None = None

    @property
    def several(self) -> bool:
        """Whether it takes more than one value."""
        return get_origin(self.kind) is tuple

    @property
    def choices(self) -> tuple[str, ...]:
        """The values that it can have, where they are few."""
        kind = get_args(self.kind)[0] if self.several else self.kind
        words = get_args(kind) if get_origin(kind) is Literal else ()
        return tuple(word for word in words if word)  # "" is that none is given


def settings(kind: type, default: Any = MISSING) -> list[Setting]:
    """All settings of the dataclass `kind`, in their order.

    Args:
        kind: a dataclass; what it holds may be dataclasses as well.
        default: an instance whose values are the defaults.
    """
    title = _first_paragraph(inspect.getdoc(kind) or "")
    return list(_walk(kind, default, (), "", "", title))


def build(kind: type[T], default: Any, values: Mapping[tuple[str, ...], Any]) -> T:
    """An instance of `kind` with `values` by path, the rest as in `default`."""
    given: dict[str, Any] = {}
    for item in fields(kind):  # type: ignore[arg-type]
        if (item.name,) in values:
            given[item.name] = values[(item.name,)]
            continue
        before = _default(item, default)
        below = {path[1:]: v for path, v in values.items() if path[0] == item.name}
        if below or (before is MISSING and is_dataclass(item.type)):
            inner = _dataclass_of(get_type_hints(kind)[item.name], before)
            given[item.name] = build(inner, before, below)
        elif before is not MISSING:
            given[item.name] = before
    made = type(default) if default is not MISSING else kind
    return made(**given)


def convert(setting: Setting, words: list[str]) -> Any:
    """The value that words of the command line mean.

    Raises:
        BnsError: they mean none.
    """
    flag = setting.name if setting.positional else f"--{setting.name}"
    if not setting.several:
        value, within = _value(setting.kind, words[0], flag), setting.within
        if within and not within.low <= value <= within.high:
            raise OutOfBoundsError(flag, value, within.low, within.high, "")
        return value
    parts = get_args(setting.kind)
    if parts[-1] is Ellipsis:
        return tuple(_value(parts[0], word, flag) for word in words)
    if len(words) != len(parts):
        raise BnsError(f"{flag} takes {len(parts)} values, {len(words)} were given.")
    return tuple(
        _value(part, word, flag) for part, word in zip(parts, words, strict=True)
    )


@cache
def docs(kind: type) -> Mapping[str, str]:
    """What the attributes of a dataclass mean: the strings below them."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if not is_dataclass(base):
            continue
        try:
            source = textwrap.dedent(inspect.getsource(base))
        except (OSError, TypeError):
            continue
        (tree,) = ast.parse(source).body
        body = tree.body if isinstance(tree, ast.ClassDef) else []
        for above, below in pairwise(body):
            if not isinstance(above, ast.AnnAssign) or not isinstance(below, ast.Expr):
                continue
            target, text = above.target, below.value
            if isinstance(target, ast.Name) and isinstance(text, ast.Constant):
                found[target.id] = inspect.cleandoc(str(text.value))
    return found


def _walk(
    kind: type, default: Any, path: tuple[str, ...], before: str, group: str, title: str
) -> Iterator[Setting]:
    hints = get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        if not item.init:
            continue
        bare, marks = _marks(hints[item.name])
        value, here = _default(item, default), (*path, item.name)
        name = before + item.name.replace("_", "-")
        inner = _dataclass_of(bare, value)
        if inner is not None:
            flat = Mark.FLAT in marks
            prefix, below = (before, group) if flat else (f"{name}.", name)
            said = _first_paragraph(inspect.getdoc(inner) or "")
            yield from _walk(inner, value, here, prefix, below or "run", said)
            continue
        yield Setting(
            here,
            name,
            bare,
            value,
            docs(kind).get(item.name, ""),
            group,
            title,
            Mark.POSITIONAL in marks,
            Mark.RARE in marks,
            next((mark for mark in marks if isinstance(mark, Within)), None),
        )


def _marks(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    if get_origin(hint) is not Annotated:
        return hint, ()
    bare, *marks = get_args(hint)
    return bare, tuple(marks)


def _default(item: Any, default: Any) -> Any:
    if default is not MISSING:
        return getattr(default, item.name)
    if item.default_factory is not MISSING:
        return item.default_factory()
    return item.default


def _dataclass_of(hint: Any, value: Any) -> Any:
    """The dataclass that a setting is, by its value before its annotation."""
    if value is not MISSING and is_dataclass(value):
        return type(value)
    bare, _ = _marks(hint)
    return bare if isinstance(bare, type) and is_dataclass(bare) else None


def _value(kind: Any, word: str, flag: str) -> Any:
    """One word as a value of a type."""
    if get_origin(kind) is Literal:
        if word not in get_args(kind):
            known = filter(None, get_args(kind))
            raise UnknownNameError(f"value of {flag}", word, known)
        return word
    if get_origin(kind) in (Union, types.UnionType):
        if word.lower() == "none":
            return None
        (kind,) = (part for part in get_args(kind) if part is not type(None))
    make, what = _KINDS[kind]
    try:
        return make(word)
    except ValueError:
        raise BnsError(f"{flag} {word}: give {what}.") from None


def _truth(word: str) -> bool:
    if word.lower() not in ("yes", "no", "true", "false"):
        raise ValueError(word)
    return word.lower() in ("yes", "true")


def _first_paragraph(text: str) -> str:
    return " ".join(text.split("\n\n")[0].split())


_KINDS: dict[Any, tuple[Callable[[str], Any], str]] = {
    str: (str, "a text"),
    int: (int, "a whole number"),
    float: (float, "a number"),
    bool: (_truth, "yes or no"),
    Path: (Path, "a path"),
    Any: (str, "a text"),
}
