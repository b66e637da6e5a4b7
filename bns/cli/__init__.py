"""The command line: one module per family of verbs, imported when it is called."""

from collections.abc import Iterator, Sequence
from importlib import import_module

from bns import __version__
from bns.errors import UnknownNameError

VERBS = {
    "run": ("run", "train a preset or a TOML file"),
    "report": ("results", "write one self-contained HTML report on runs"),
    "compare": ("results", "medians, intervals, p values and effect sizes of runs"),
    "view": ("view", "open a run's recording, or make a picture of it"),
    "export": ("results", "write trials as a LeRobotDataset or a Parquet table"),
    "campaign": ("campaign", "many configurations: run them, tables, pictures"),
    "claims": ("claims", "the dissertation's claims: list, run, judge"),
    "standings": ("standings", "all learners on the same damages: who recovers"),
    "repertoire": ("repertoire", "gaits and drives made beforehand: make, list, show"),
    "presets": ("lists", "list the presets"),
    "learners": ("lists", "list the learners"),
    "tasks": ("lists", "list the tasks"),
    "worlds": ("lists", "list the worlds"),
    "robots": ("lists", "list the robot models"),
    "models": ("models", "make, check, open or draw a robot model"),
    "effects": ("lists", "list the effects with parameters, units and ranges"),
    "examples": ("lists", "list, print or copy the examples"),
    "schema": ("schema", "JSON Schema of the TOML files, for editors"),
    "gap": ("gap", "diagnose the gap between recordings and a model (experimental)"),
    "hardware": ("hardware", "real robots: rehearse, check, calibrate, record"),
    "doctor": ("lists", "check this machine and say what to install"),
    "completion": ("completion", "print the completion script of bash, zsh or fish"),
}
"""verb -> module of this package, and what it does in one line"""

GROUPS = {
    "Learn": ("run", "report", "compare", "view", "export"),
    "Many runs": ("campaign", "claims", "standings", "repertoire"),
    "What there is": (
        "presets",
        "learners",
        "tasks",
        "worlds",
        "robots",
        "effects",
        "models",
        "examples",
    ),
    "Real robots": ("gap", "hardware"),
    "This machine": ("doctor", "completion", "schema"),
}
"""title in the manual -> verbs"""

GOODBYE = "`bns VERB --help` is the manual of a verb."


def dispatch(argv: Sequence[str]) -> int:
    """Run the verb in `argv`; gives the exit code.

    Raises:
        BnsError: what the user gave cannot be used.
    """
    verb, rest = (argv[0], list(argv[1:])) if argv else ("--help", [])
    if verb in ("-h", "--help", "help"):
        print(_manual())
        return 0
    if verb in ("-V", "--version"):
        print(f"bns {__version__}")
        return 0
    if verb == "--complete":
        from bns.cli.completion import candidates

        print("\n".join(candidates(rest)))
        return 0
    if verb not in VERBS:
        raise UnknownNameError("command", verb, VERBS)
    return import_module(f"bns.cli.{VERBS[verb][0]}").main(verb, rest)


def _groups() -> Iterator[str]:
    for title, verbs in GROUPS.items():
        yield f"{title}:"
        yield from (f"  {verb:<10} {VERBS[verb][1]}" for verb in verbs)
        yield ""


def _manual() -> str:
    lines = [
        "usage: bns VERB [...]",
        "",
        "Robots that learn their own simulator, in a physics world.",
        "",
        *_groups(),
        "  --version  print the version",
        "",
        GOODBYE,
    ]
    return "\n".join(lines)
