"""`bns run`: train a preset, a TOML file, or go on with a run directory."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from bns.cli.fields import Flat, Positional, Rare
from bns.cli.parse import HELP, HELP_ALL, parse
from bns.errors import BnsError, FormatError, UnknownNameError
from bns.experiment.config import RunConfig

if TYPE_CHECKING:
    from bns.storage.lock import Lock

_SHORT = {"world": "world.name", "damage": "world.damage"}
"""settings that have a short name on the command line"""

STOPPED = 130
"""exit code of a run that Ctrl-C stopped after a whole trial"""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Train a learner: `bns run PRESET`, `bns run FILE.toml`, or go on with a run:
    `bns run DIRECTORY --resume`. Every setting below can be given; what is not given
    comes from the preset or file. Ctrl-C stops after the trial that is going on;
    --resume goes on from there.
    """

    source: Positional[str]
    """a preset (see `bns presets`), a TOML file, or a run directory"""
    out: str = ""
    """directory for the results (default: runs/NAME)"""
    resume: bool = False
    """go on with the run in the directory"""
    rerun: Literal["save", "live", "off"] = "save"
    """save: write recording.rrd; live: stream to a viewer as well; off: neither"""
    report: bool = True
    """write report.html at the end"""
    setup: Rare[str] = ""
    """file that `bns hardware setup` wrote, for --world hardware; what is given here
    goes before it"""
    port: Rare[str] = ""
    """device of a real or emulated robot, for --world hardware"""
    camera: Rare[str] = "emulated"
    """number of the camera above it, or emulated; for --world hardware"""
    calibration: Rare[str] = ""
    """of that camera, see `bns hardware calibrate`"""
    wheels: Rare[str] = ""
    """a Khepera's file of wheels, see `bns hardware calibrate`"""
    servos: Rare[str] = ""
    """a hexapod's file of servos, see `bns hardware calibrate`"""
    config: Flat[RunConfig] = field(default_factory=RunConfig)


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code.

    Args:
        verb: "run".
        argv: words after it: preset, TOML file or run directory, then options.

    Raises:
        BnsError: nothing to run is given, an option comes before it, or there is none
            of that name.
    """
    if not argv:
        from bns import presets

        raise BnsError(
            f"Nothing to run: give a preset ({', '.join(presets.names())}), a TOML "
            "file or a run directory. See bns run --help."
        )
    if argv[0] in (*HELP, HELP_ALL):
        parse(Arguments, argv, prog="bns run")
    if argv[0].startswith("-"):
        raise BnsError(
            f"{argv[0]} comes too early: give a preset or TOML file first, as in "
            f"`bns run demo {argv[0]} ...`. See bns run --help."
        )
    config, out = source(argv[0])
    config = _for_learner(config, argv[1:])
    start = Arguments(source=argv[0], config=config, out=out)
    given = parse(Arguments, list(map(_long, argv)), prog="bns run", default=start)
    return execute(replace(given, config=expanded(given.config)))


def _for_learner(config: RunConfig, words: list[str]) -> RunConfig:
    """The experiment for the learner that the words name, with its own settings."""
    from bns.experiment.loading import OLD_LEARNERS, with_learner

    named = [
        value or after
        for word, after in pairwise([*words, ""])
        for flag, _, value in [word.partition("=")]
        if flag == "--learner"
    ]
    if not named or named[-1] in (config.learner, *OLD_LEARNERS):
        return config
    return with_learner(config, named[-1])


def _long(word: str) -> str:
    """A word of the command line, the short name of a setting written out."""
    name, equals, value = word.partition("=")
    full = _SHORT.get(name.removeprefix("--")) if name.startswith("--") else None
    return f"--{full}{equals}{value}" if full else word


def expanded(config: RunConfig) -> RunConfig:
    """With a kept world (`worlds.toml`) written out, so that the record has it all."""
    from bns.worlds import corrected

    kept = corrected.known().get(config.world.name)
    if kept is None:
        return config
    reality = (*kept.reality, *config.world.reality)
    world = replace(config.world, name=kept.base, robot=kept.robot, reality=reality)
    return replace(config, world=world)


def source(text: str) -> tuple[RunConfig, str]:
    """The configuration a preset, file or run directory gives, and where it goes.

    Raises:
        BnsError: there is none of that name.
    """
    from bns import presets
    from bns.experiment import loading

    path = Path(text)
    if path.is_dir() and text not in presets.names():
        from bns.storage.store import RunStore

        return RunStore.open(path).config, text
    if path.suffix == ".toml" or path.is_file():
        if not path.exists():
            raise FormatError(f"There is no file {text}: give a TOML file or a preset.")
        return loading.from_file(path), f"runs/{path.stem}"
    if text not in presets.names():
        raise UnknownNameError("preset", text, presets.names())
    return presets.load(text), f"runs/{text}"


def execute(given: Arguments) -> int:
    """Train, draw, and say what happened."""
    if given.config.world.name == "hardware":
        from bns.cli.hardware import session

        return session.learn(given)
    from bns.storage.lock import Lock

    out = Path(given.out)
    with Lock(out) as lock:
        return _locked(given, out, lock)


def _locked(given: Arguments, out: Path, lock: "Lock") -> int:
    """Train into a directory in which nobody else writes."""
    from bns.cli import outputs
    from bns.experiment.run import train

    with (
        outputs.live(given.rerun, given.config) as on_trial,
        until_interrupted() as stop,
    ):
        record = train(
            given.config,
            out,
            resume=given.resume,
            progress=True,
            on_trial=on_trial,
            stop=stop,
            lock=lock,
        )
    if record.trials < given.config.trials:
        print(
            f"Stopped after {record.trials} of {given.config.trials} trials. "
            f"Go on with: bns run {out} --resume"
        )
        return STOPPED
    outputs.write(record, out, recording=given.rerun != "off", report=given.report)
    return 0


@contextmanager
def until_interrupted() -> Iterator[Callable[[], bool]]:
    """Gives a question: was Ctrl-C pressed? Pressed twice, it stops at once."""
    pressed: list[int] = []

    def note(*_: object) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(1)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)
