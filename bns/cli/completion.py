"""`bns completion SHELL`, and what a shell is told when it asks what comes next."""

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass
from typing import Literal

from bns.cli.fields import Positional, Setting
from bns.cli.parse import HELP, HELP_ALL, Candidates, completing, parse
from bns.errors import BnsError, UnknownNameError

UNWRITTEN = "\0"
"""stands for the word that is being written"""

SCRIPTS = {
    "bash": """_bns() {
    local IFS=$'\\n'
    COMPREPLY=($("$1" --complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
complete -o default -o nosort -F _bns bns
""",
    "zsh": """#compdef bns
_bns() {
    local -a found
    found=("${(@f)$("${words[1]}" --complete "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    if [[ -n "${found[1]}" ]]; then compadd -a found; else _files; fi
}
compdef _bns bns
""",
    "fish": """function __bns_complete
    set -l words (commandline -opc)
    set -l current (commandline -ct)
    set -l found ($words[1] --complete $words[2..] "$current" 2>/dev/null)
    if set -q found[1]
        printf '%s\\n' $found
    else
        __fish_complete_path "$current"
    end
end
complete -c bns -f -a '(__bns_complete)'
""",
}


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Print the completion script of a shell. For bash: put `eval "$(bns completion
    bash)"` into ~/.bashrc; zsh: `eval "$(bns completion zsh)"` into ~/.zshrc, after
    compinit; fish: `bns completion fish | source` into ~/.config/fish/config.fish.
    """

    shell: Positional[Literal["bash", "zsh", "fish"]]
    """bash, zsh or fish"""


def main(verb: str, argv: list[str]) -> int:
    """Print the script; gives the exit code."""
    del verb
    print(SCRIPTS[parse(Arguments, argv, prog="bns completion").shell], end="")
    return 0


def candidates(words: Sequence[str]) -> list[str]:
    """What could stand where the last of `words` is being written.

    Args:
        words: of the command line, without `bns`; the last may be empty.
    """
    from bns.cli import VERBS

    *before, current = words or [""]
    known = list(VERBS) if not before else _known([*before, UNWRITTEN], current)
    return [name for name in known if name.startswith(current)]


def _known(words: list[str], current: str) -> list[str]:
    from bns.cli import dispatch

    token = completing.set(True)
    try:
        dispatch(words)
    except Candidates as found:
        return _next(found.known, list(found.words[:-1]), current)
    except UnknownNameError as error:
        return list(error.known) if error.given == UNWRITTEN else []
    except (BnsError, SystemExit):
        pass
    finally:
        completing.reset(token)
    return []


def _next(known: Sequence[Setting], words: list[str], current: str) -> list[str]:
    """Values of the option that was begun, else options, else what a place can hold."""
    begun = next((w for w in reversed(words) if w.startswith("--")), "")
    for setting in known:
        waits = words[-1:] == [begun] or setting.several
        if f"--{setting.name}" == begun and setting.kind is not bool and waits:
            return _values(setting)
    if current.startswith("-"):
        return [flag for setting in known for flag in _flags(setting)] + [
            *HELP,
            HELP_ALL,
        ]
    places = [setting for setting in known if setting.positional]
    return _values(places[0]) if places and not _filled(places[0], words) else []


def _filled(place: Setting, words: list[str]) -> bool:
    return not place.several and bool(words) and not words[0].startswith("-")


def _flags(setting: Setting) -> list[str]:
    if setting.positional:
        return []
    head, dot, leaf = setting.name.rpartition(".")
    both = [f"--{setting.name}"]
    if setting.kind is bool and setting.default is not MISSING:
        both.append(f"--{head}{dot}no-{leaf}")
    return both


def _values(setting: Setting) -> list[str]:
    leaf = setting.name.rpartition(".")[2]
    names = NAMES.get(setting.name) or NAMES.get(leaf)
    return list(setting.choices) or (names() if names else [])


def _effects() -> list[str]:
    from bns.worlds.effects import registry

    return list(registry.names())


def _robots() -> list[str]:
    from bns import models

    return list(models.names())


def _worlds() -> list[str]:
    from bns.worlds import registry

    return list(registry.names())


def _presets() -> list[str]:
    from bns import presets

    return list(presets.names())


NAMES: dict[str, Callable[[], list[str]]] = {
    "damage": _effects,
    "effects": _effects,
    "filter": _effects,
    "model": _robots,
    "reality": _effects,
    "robot": _robots,
    "source": _presets,
    "world": _worlds,
    "world.name": _worlds,
}
"""settings that take a name -> the names there are"""
