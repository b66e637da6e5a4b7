"""Parsing of the command line: dataclasses in, dataclasses out, errors on one line."""

import argparse
import contextvars
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, replace
from difflib import get_close_matches
from typing import Any, NoReturn, TypeAlias, TypeVar, get_args

from bns.cli.fields import Setting, build, convert, settings
from bns.errors import BnsError, UnknownNameError

Verbs: TypeAlias = Mapping[str, tuple[type, Callable[[Any], int]]]
"""a verb's own verbs: what their arguments are, and what they do with them"""


T = TypeVar("T")

SHORT = 30
"""options up to which the short manual is the whole"""
TITLE_ENDS = (". ", "; ", ": ", " (", ", ")
HELP, HELP_ALL = ("-h", "--help"), "--help-all"

completing: contextvars.ContextVar[bool] = contextvars.ContextVar(
    "completing", default=False
)
"""whether the shell asks what could come next; then nothing is done"""


class Candidates(BaseException):
    """Raised instead of parsing, where the shell asks what could come next.

    Args:
        known: the settings of the verb.
        words: what was given already.
    """

    def __init__(self, known: Sequence[Setting], words: Sequence[str]):
        self.known, self.words = known, words
        super().__init__()


def parse(
    kind: type[T], argv: Sequence[str], *, prog: str, default: Any = MISSING
) -> T:
    """An instance of the dataclass `kind` from command-line arguments.

    `--help` prints the manual and exits, `--help-all` one with every option.

    Args:
        kind: its attributes are the options, the strings below them the manual;
            `bns.cli.fields.Positional`, `Flat` and `Rare` mark some.
        argv: the words.
        prog: what the words follow, as in "bns run".
        default: an instance whose values are the defaults.

    Raises:
        BnsError: the arguments are not understood.
    """
    known = settings(kind, default)
    if completing.get():
        raise Candidates(known, argv)
    if any(word in HELP or word == HELP_ALL for word in argv):
        print(manual(kind, known, prog, whole=HELP_ALL in argv), end="")
        raise SystemExit(0)
    parser = _parser(prog, kind, known)
    words = [_spelled(word) for word in _joined(argv)]
    found, rest = parser.parse_known_intermixed_args(words)
    if rest:
        raise _not_known(rest[0], known, prog)
    return build(kind, default, _values(known, vars(found), prog))


def dispatch(
    verb: str,
    argv: Sequence[str],
    does: Verbs,
    manual: str,
) -> int:
    """Do one of a verb's own verbs; gives the exit code.

    Args:
        verb: as in "campaign".
        argv: what follows it; nothing, or a call for help, prints the manual and exits.
        does: its verbs: what their arguments are, and what they do with them.
        manual: of the verb.

    Raises:
        UnknownNameError: no such verb.
    """
    if not argv or argv[0] in (*HELP, HELP_ALL):
        print(manual)
        raise SystemExit(0)
    if argv[0] not in does:
        raise UnknownNameError(f"verb of `bns {verb}`", argv[0], does)
    kind, do = does[argv[0]]
    return do(parse(kind, argv[1:], prog=f"bns {verb} {argv[0]}"))


def manual(
    kind: type, known: Sequence[Setting], prog: str, *, whole: bool = False
) -> str:
    """The manual of a verb, as wide as the terminal or as `COLUMNS` says.

    Args:
        kind: the verb's dataclass.
        known: its settings.
        prog: how it is called.
        whole: with every option; otherwise one line for a group of them, where they
            are many.
    """
    brief = not whole and len(known) > SHORT
    shown = [s for s in known if not (brief and ("." in s.name or s.rare))]
    if brief:
        shown = [replace(s, doc=s.doc if s.choices else _clause(s.doc)) for s in shown]
    parser = _parser(prog, kind, shown, help=True)
    if brief:
        _groups(parser, known)
    return parser.format_help()


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say in one line what is wrong; the exit code is 2."""
        said = message.removeprefix("argument ").rstrip(".")
        required = "the following arguments are required: "
        if said.startswith(required):
            said = f"Missing: {said.removeprefix(required)}"
        raise BnsError(f"{said}. See `{self.prog} --help`.")


class _Switch(argparse.Action):
    """`--name` and `--no-name`."""

    def __call__(self, parser: Any, names: Any, values: Any, word: Any = None) -> None:
        setattr(names, self.dest, ["no" if word == self.option_strings[1] else "yes"])


def _parser(
    prog: str, kind: type, known: Sequence[Setting], *, help: bool = False
) -> _Parser:
    places = [s for s in known if s.positional]
    shown = " ".join(_place(s) for s in places)
    parser = _Parser(
        prog=prog,
        usage=f"{prog} [options] {shown}".strip(),
        description=" ".join((kind.__doc__ or "").split()),
        add_help=False,
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
        formatter_class=_formatter,
    )
    groups: dict[str, Any] = {"": parser.add_argument_group("options")}
    if help:
        said = "print this and exit; --help-all: with every option"
        groups[""].add_argument(*HELP, action="store_true", help=said)
    for setting in known:
        if setting.group not in groups:
            groups[setting.group] = parser.add_argument_group(
                setting.group, setting.title
            )
        _add(parser if setting.positional else groups[setting.group], setting)
    return parser


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.HelpFormatter(prog, max_help_position=26)


def _place(setting: Setting) -> str:
    name = setting.name.upper()
    if setting.several:
        return f"[{name} ...]" if setting.default is not MISSING else f"{name} ..."
    return name if setting.default is MISSING else f"[{name}]"


def _add(group: Any, setting: Setting) -> None:
    told: dict[str, Any] = {"help": _escaped(_help(setting))}
    if setting.kind is bool:
        head, dot, leaf = setting.name.rpartition(".")
        flags = (f"--{setting.name}", f"--{head}{dot}no-{leaf}")
        group.add_argument(*flags, action=_Switch, nargs=0, dest=setting.name, **told)
        return
    told["metavar"] = _metavar(setting)
    if setting.several:
        told["nargs"] = "*"
    elif not setting.positional:
        told["nargs"] = 1
    if setting.positional:
        if not setting.several:
            told["nargs"] = None if setting.default is MISSING else "?"
        group.add_argument(setting.name, **told)
        return
    group.add_argument(f"--{setting.name}", dest=setting.name, **told)


def _metavar(setting: Setting) -> str:
    if setting.positional:
        return setting.name.upper()
    if setting.choices:
        return f"{{{','.join(setting.choices)}}}"
    kind = get_args(setting.kind)[0] if setting.several else setting.kind
    return {int: "N", float: "X"}.get(kind, "TEXT")


def _help(setting: Setting) -> str:
    said, value = " ".join(setting.doc.split()), setting.default
    if value is MISSING and not setting.positional:
        return f"{said} (required)"
    if value in (MISSING, "", (), None):
        return said
    if isinstance(value, bool):
        value = "yes" if value else "no"
    if isinstance(value, tuple):
        value = " ".join(map(str, value))
    return f"{said} (default: {value})".strip()


def _groups(parser: argparse.ArgumentParser, known: Sequence[Setting]) -> None:
    """A line for each group of options that the short manual leaves out."""
    lines: dict[str, list[Setting]] = {}
    for setting in known:
        if "." in setting.name:
            lines.setdefault(setting.group, []).append(setting)
    more = parser.add_argument_group("settings, so many of each")
    for name, members in lines.items():
        said = _escaped(f"{len(members)}: {_clause(members[0].title, TITLE_ENDS)}")
        more.add_argument(f"--{name}.*", help=said, action="store_true")
    rare = [s for s in known if s.rare]
    if rare:
        names = ", ".join(f"--{s.name}" for s in rare)
        parser.epilog = f"{HELP_ALL} also has {names}."


def _clause(text: str, ends: Sequence[str] = (". ", "; ")) -> str:
    """The beginning of a text, up to where it can end."""
    text = " ".join(text.split())
    for end in ends:
        text = text.partition(end)[0]
    return text.rstrip(".")


def _escaped(text: str) -> str:
    """As argparse wants an option's help; descriptions it prints as they are."""
    return text.replace("%", "%%")


def _spelled(word: str) -> str:
    """An option with hyphens, however it was written."""
    if not word.startswith("--"):
        return word
    name, equals, value = word.partition("=")
    return f"{name.replace('_', '-')}{equals}{value}"


def _joined(argv: Sequence[str]) -> Iterable[str]:
    """The words, a negative number tied to the option before it.

    argparse takes `-1e-3` and `-inf` for options.
    """
    words: list[str] = []
    for word in argv:
        last = words[-1] if words else ""
        if _negative(word) and last.startswith("--") and "=" not in last:
            words[-1] = f"{last}={word}"
        else:
            words.append(word)
    return words


def _negative(word: str) -> bool:
    if not word.startswith("-") or word[1:].isdigit():
        return False
    try:
        float(word)
    except ValueError:
        return False
    return True


def _values(
    known: Sequence[Setting], found: Mapping[str, Any], prog: str
) -> dict[tuple[str, ...], Any]:
    values: dict[tuple[str, ...], Any] = {}
    for setting in known:
        words = found.get(setting.name)
        if words is None or (setting.positional and words == []):
            asked = setting.default is MISSING
            if asked and not (setting.several and setting.positional):
                flag = setting.name.upper()
                shown = flag if setting.positional else f"--{setting.name}"
                raise BnsError(f"Missing: {shown}. See `{prog} --help`.")
            if asked:
                values[setting.path] = ()
            continue
        values[setting.path] = convert(
            setting, words if isinstance(words, list) else [words]
        )
    return values


def _not_known(word: str, known: Sequence[Setting], prog: str) -> BnsError:
    name = word.partition("=")[0]
    if not name.startswith("-"):
        return BnsError(f"{word!r} is one argument too many. See `{prog} --help`.")
    options = [s.name for s in known if not s.positional]
    leaf = name.lstrip("-").rpartition(".")[2]
    close = get_close_matches(name.lstrip("-"), options, n=1, cutoff=0.7) or [
        option for option in options if option.rpartition(".")[2] == leaf
    ]
    if close:
        return BnsError(f"Unknown option {name}. Did you mean --{close[0]}?")
    return BnsError(f"Unknown option {name}. See `{prog} --help`.")
