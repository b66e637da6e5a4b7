"""`bns gap`: where a recording and a nominal model part, and which effect it is."""

from importlib import import_module

from bns.cli.parse import HELP, HELP_ALL
from bns.errors import UnknownNameError

VERBS = {
    "describe": ("describe", "write the description of a robot of your own"),
    "check": ("diagnose", "is the recording sound? repairs and faults, one a line"),
    "diagnose": ("diagnose", "is there a gap, where, which effect, how far closed"),
    "plan": ("after", "the next command, which separates what is still tied"),
    "edit": ("after", "does the model stay right when an effect is taken away?"),
    "apply": ("after", "keep the corrected world: bns run PRESET --world NAME"),
    "bench": ("bench", "the withheld-effect test: make, run, score"),
}
"""verb -> module beside this, and what it does in one line"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of the gap diagnosis; gives the exit code.

    Raises:
        UnknownNameError: no such verb of the gap diagnosis.
        SystemExit: help was asked for, or nothing was given; with code 0.
    """
    del verb
    if not argv or argv[0] in (*HELP, HELP_ALL):
        print(_manual())
        raise SystemExit(0)
    if argv[0] not in VERBS:
        raise UnknownNameError("verb of `bns gap`", argv[0], VERBS)
    module = import_module(f"bns.cli.gap.{VERBS[argv[0]][0]}")
    return module.main(argv[0], argv[1:])


def _manual() -> str:
    lines = [
        f"usage: bns gap {{{','.join(VERBS)}}} [...]",
        "",
        *(f"  {verb:<9} {doc}" for verb, (_, doc) in VERBS.items()),
        "",
        "Recordings are dataset directories (several are pooled), CSV or MCAP logs",
        "with --columns FILE.toml, or what --importer NAME reads.",
        "",
        "`bns gap VERB --help` is the manual of a verb.",
    ]
    return "\n".join(lines)
