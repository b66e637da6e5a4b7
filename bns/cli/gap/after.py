"""`bns gap plan`, `edit` and `apply`: what follows from a diagnosis."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bns.cli.fields import Positional, Seed
from bns.cli.parse import parse
from bns.errors import BnsError, UnknownNameError
from bns.progress import counting, working


@dataclass(frozen=True, kw_only=True)
class Planned:
    """Say which command would best separate the explanations that a diagnosis left
    tied, and write it to a file. Record it, then diagnose both recordings together.
    """

    directory: Positional[str]
    """a directory that `bns gap diagnose` wrote"""
    to: str = ""
    """file for the commands, CSV (default: DIRECTORY/next_command.csv)"""
    arena: tuple[float, float] = (2.7, 1.8)
    """size of the board along x and y [m]; drives start at its centre"""
    seed: Seed = 0
    """of the random commands among those considered"""


@dataclass(frozen=True, kw_only=True)
class Edit:
    """Take an effect away from the corrected model and predict a recording in which it
    was not there: a model with the right physics stays right.
    """

    directory: Positional[str]
    """a directory that `bns gap diagnose` wrote"""
    remove: str
    """name of the effect, wheel_gain[left] or wheel_gain; * = all"""
    predict: tuple[str, ...]
    """recordings without it: dataset directories, or logs with --columns"""
    effect: str = ""
    """fitted effects to edit, joined by +; default: those that the verdict names"""
    columns: str = ""
    """TOML file that maps the log's columns to channels"""


@dataclass(frozen=True, kw_only=True)
class Apply:
    """Keep the corrected world under a name; `bns run PRESET --world NAME` trains in
    it, `bns worlds` lists it. For a model of your own: write the corrected MJCF.
    """

    directory: Positional[str]
    """a directory that `bns gap diagnose` wrote"""
    world: str = ""
    """name for the world"""
    effect: str = ""
    """fitted effects to apply, joined by +; default: those that the verdict names"""
    user: bool = False
    """keep it for all directories (in the user's own file), not ./worlds.toml"""
    replace: bool = False
    """replace a kept world of the same name, or the file of --xml"""
    xml: str = ""
    """for a model of your own: file for the corrected MJCF"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    if verb == "plan":
        return _plan(parse(Planned, argv, prog="bns gap plan"))
    if verb == "edit":
        return _edit(parse(Edit, argv, prog="bns gap edit"))
    return _apply(parse(Apply, argv, prog="bns gap apply"))


def _model(found: Any) -> Any:
    from bns.gap.models.odometry import record
    from bns.gap.recordings import load_recordings

    if found.model == record.MODEL:
        raise BnsError(
            "A diagnosis of odometry has no simulated model to edit or apply; its "
            "magnitudes stand in diagnosis.json."
        )
    return load_recordings.model(
        str(found.provenance.get("model", found.model)), threads=1
    )


def _plan(given: Planned) -> int:
    from bns.gap import store
    from bns.gap.models.odometry import record
    from bns.gap.planning import command_file, plan

    found = store.load(given.directory)
    if found.model == record.MODEL:
        made = record.planned(found)
    else:
        model = _model(found)
        _plannable(found, model)
        with counting("planning") as each:
            made = plan.plan(
                found, model, arena=given.arena, seed=given.seed, each=each
            )
    print(made.sentence)
    if not made.options or not made.repeats:
        return 0
    for option in made.options[max(1, len(made.steps)) :][:3]:
        print(
            f"  or: {option.excitation.name} (once: {100 * option.wrong:.2g} % wrong)"
        )
    path = Path(given.to or Path(given.directory) / "next_command.csv")
    for number, (option, _) in enumerate(made.steps or ((made.options[0], 1),), 1):
        name = path if number == 1 else path.with_stem(f"{path.stem}_{number}")
        command_file.write(option.excitation.commands, name)
        print(f"commands:  {name}")
    print("Record them, then: bns gap diagnose DATA NEW_DATA --out ANOTHER_DIR")
    return 0


def _plannable(found: Any, model: Any) -> None:
    from bns.gap import store
    from bns.gap.planning import plan
    from bns.worlds.effects.base import OpticsEffect, SensorEffect

    light = [
        name
        for fit in plan.tied(found)
        for name, text in zip(fit.names, fit.effects, strict=True)
        if "light" in found.floor
        and isinstance(store.parse(text, model), OpticsEffect | SensorEffect)
    ]
    if light and len(found.verdict.named) > 1:
        raise BnsError(
            f"No safe commands are known that part {', '.join(sorted({*light}))}. "
            f"{found.verdict.change}"
        )


def _edit(given: Edit) -> int:
    from bns.gap import edit, stages, store
    from bns.gap.recordings import load_recordings

    found = store.load(given.directory)
    model = _model(found)
    trials = load_recordings.trials(given.predict, model, columns=given.columns)
    load_recordings.tellable(trials, model)
    with working("predicting", usual=stages.nominal(found, len(trials))):
        made = edit.edit(found, trials, model, remove=given.remove, effect=given.effect)
    print(made.sentence)
    for name, loss in made.losses.items():
        errors = ", ".join(
            f"{channel} {value:.3g} {unit}"
            for (channel, unit), value in zip(
                made.channels, made.plain[name], strict=True
            )
        )
        print(
            f"  {name:<9} {loss:8.3f} of the noise floor; "
            f"over {made.horizon:g} s: {errors}"
        )
    return 0


def _apply(given: Apply) -> int:
    from bns.gap import store
    from bns.worlds import corrected, registry

    found = store.load(given.directory)
    fit = store.chosen(found, given.effect)
    model = _model(found)
    if found.verdict.kind == "either" and not given.effect:
        others = " or ".join(" + ".join(names) for names in found.verdict.named)
        print(f"note: tied are {others}; the first is taken, --effect chooses another.")
    from bns.gap.models.mjcf.model import OwnModel

    own = isinstance(model, OwnModel)
    if own or given.xml:
        if not own:
            raise BnsError(
                f"This diagnosis is of {found.model}: leave --xml out, which is for a "
                "model of your own, and give --world NAME."
            )
        if not given.xml or given.world:
            raise BnsError(
                f"This diagnosis is of {found.model}, a model of your own: give --xml "
                "FILE for the corrected MJCF, and no --world."
            )
        if Path(given.xml).exists() and not given.replace:
            raise BnsError(
                f"{given.xml} is there: give another --xml FILE, or --replace to write "
                "over it."
            )
        left = model.write_corrected(fit.effects, given.xml)
        print(f"model:     {given.xml}")
        for text in left:
            print(f"note: {text} acts on signals, an MJCF file can not hold it.")
        return 0
    if not given.world:
        raise BnsError("Give the world a name: --world NAME.")
    if given.world in registry.names() and given.world not in corrected.known():
        raise BnsError(f"{given.world!r} is a built-in world; take another name.")
    if found.model == "servo_pendulum":
        raise UnknownNameError("robot of a world", found.model, ("khepera3",))
    note = f"diagnosis of {', '.join(found.provenance.get('data', ()))}"
    base, preset = _base(found)
    world = corrected.Corrected(given.world, base, found.model, fit.effects, note=note)
    path = corrected.keep(world, user=given.user, replace=given.replace)
    print(f"World {given.world!r}: {', '.join(fit.effects)}")
    print(f"kept in:   {path}")
    print(f"Train in it: bns run {preset} --world {given.world}")
    return 0


def _base(found: Any) -> tuple[str, str]:
    """The world that a diagnosis corrects, and a preset that runs in it."""
    from bns import models

    if models.robot(found.model).kind == "legged":
        return "hexapod", "hexapod-walk"
    if "light" in found.floor:
        return "light", "khepera-light"
    return "mujoco", "demo"
