"""`bns gap check` and `diagnose`: from recordings to a diagnosis."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bns.cli.fields import Positional, Seed, Threads
from bns.cli.outputs import attempt
from bns.cli.parse import parse
from bns.errors import BnsError, FormatError, install
from bns.progress import Each, Tell, counting, working

LISTED = 8  # faults that are printed at most
NONE = "none"
"""in place of a directory: print only"""
RESULTS = Path("runs/gap")


@dataclass(frozen=True, kw_only=True)
class Check:
    """Check recordings against a model: time stamps, lost and doubled samples, wraps,
    spikes, stuck and quantised channels. Repairs are listed; a fault that cannot be
    repaired stops it.
    """

    data: Positional[tuple[str, ...]]
    """dataset directories, or those of runs; or CSV or MCAP logs, with --columns"""
    model: str = ""
    """nominal robot (see `bns robots`), or the TOML file of a model of your own
    (docs/gap_your_robot.md); default: khepera3, or what the importer reads"""
    columns: str = ""
    """TOML file that maps the log's columns to channels (docs/formats.md)"""
    importer: str = ""
    """reader of a known recording: khepera3_odometry, kscale_sts3215, mrclam6, xl330"""
    only: tuple[str, ...] = ()
    """NAME=VALUE: keep trials whose conditions say so (gain=8 mass=0.741)"""
    trials: str = ""
    """numbers of the trials to use, as 15-19, 15- or 0,3,5-7, counted in each recording
    from 0; empty = all"""


@dataclass(frozen=True, kw_only=True)
class Diagnose(Check):
    """Diagnose the sim-to-real gap of recordings: no gap, one effect, several that
    these data cannot tell apart, two together, or none of the library. Prints the
    verdict; writes OUT/diagnosis.json, report.html and recording.rrd.
    """

    out: str = ""
    """directory for the results (default: runs/gap/DATA, or the first of DATA-2, ...
    that is free); none: print only"""
    report: bool = True
    """write report.html"""
    rerun: bool = True
    """write recording.rrd"""
    reference: tuple[str, ...] = ()
    """recordings of the same robot in which nothing was changed: they tell how far the
    nominal model is off anyway"""
    seed: Seed = 0
    """of what is drawn (bootstraps)"""
    threads: Threads = 2
    """threads of the physics"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    if verb == "check":
        return _check(parse(Check, argv, prog="bns gap check"))
    return _diagnose(parse(Diagnose, argv, prog="bns gap diagnose"))


def nominal(given: Check, threads: int = 1) -> Any:
    """The model that was asked for."""
    from bns.gap.recordings import load_recordings

    usual = load_recordings.MODELS.get(given.importer, "khepera3")
    return load_recordings.model(given.model or usual, threads=threads)


def recorded(given: Check, model: Any) -> list[Any]:
    """The trials that were asked for; none if nothing was given."""
    from bns.gap.recordings import load_recordings

    if not given.data:
        return []
    return load_recordings.trials(
        given.data,
        model,
        columns=given.columns,
        importer=given.importer,
        only=given.only,
        numbers=given.trials,
    )


def _some(trials: list[Any]) -> list[Any]:
    if not trials:
        raise BnsError("Give recordings: dataset directories, or logs with --columns.")
    return trials


def _check(given: Check) -> int:
    from bns.gap import diagnose
    from bns.gap.recordings import check, load_recordings

    model = nominal(given)
    trials = _some(recorded(given, model))
    load_recordings.tellable(trials, model)
    moving = _motion(trials, model)
    usable, notes = check.check(moving, model)
    for note in notes:
        print(note)
    print(f"{len(usable)} of {len(moving)} trials can be used.")
    if lacking := diagnose.too_few(usable):
        print(lacking)
    return 0


def _motion(trials: list[Any], model: Any) -> list[Any]:
    """What of recordings is motion: without light, and where nobody held the robot."""
    from bns.gap.models.light import diagnosis
    from bns.gap.models.light import model as light_model

    if light_model.told_by(model, trials):
        return diagnosis.unhandled(trials, model)
    return trials


def _diagnose(given: Diagnose) -> int:
    if given.out == NONE:
        return _diagnosed(given, None)
    from bns.gap import request
    from bns.storage.files import StorageError
    from bns.storage.lock import Lock

    asked = _asked(given)
    if given.out:
        out = Path(given.out)
    else:
        out = request.place(RESULTS / _called(given.data), asked)
    with Lock(out):
        request.begin(out, asked)
        try:
            code = _diagnosed(given, out)
        except BnsError as error:
            if not isinstance(error, StorageError):
                request.drop(out)  # the same again would only fail again
            raise
        request.end(out)
    return code


def _called(data: Sequence[str]) -> str:
    """A name for the results of recordings: that of the first."""
    path = Path(data[0] if data else "diagnosis").resolve()
    return path.stem if path.is_file() else path.name


def _asked(given: Diagnose) -> dict[str, Any]:
    """What a diagnosis is asked for, as it is kept until it is done."""
    asked = asdict(given)
    for name in ("out", "report", "rerun", "threads"):  # change nothing of the result
        del asked[name]
    return json.loads(json.dumps(asked))


def _diagnosed(given: Diagnose, out: Path | None) -> int:
    """Diagnose, or go on where the same command was killed after it had."""
    from bns.gap import stages, store

    if given.importer == "khepera3_odometry" and not given.model:
        found, model, trials = _odometry(given), None, []
    else:
        model = nominal(given, given.threads)
        trials = _some(recorded(given, model))
        shares = stages.shares(model, trials)
        with working(f"diagnosing {len(trials)} trials", shares) as tell:
            found = _before(out) or _general(given, model, trials, out, tell)
    found = replace(
        found, provenance={**found.provenance, **_provenance(given, model, trials)}
    )
    if out:
        store.save(found, out)
    _say(found)
    if out:
        _draw(given, found, trials, model, out)
    return 0


def _before(out: Path | None) -> Any:
    """The diagnosis that a killed process of the same request had finished, if any."""
    from bns.gap import store

    if out is None or not (out / store.FILE).exists():
        return None
    try:
        return store.load(out)
    except FormatError:  # torn or flipped: it is made again
        return None


def _general(
    given: Diagnose, model: Any, trials: list[Any], out: Path | None, tell: Tell
) -> Any:
    from bns.gap import request, warnings
    from bns.gap.diagnose import diagnose
    from bns.gap.recordings import check, load_recordings
    from bns.storage.files import StorageError

    load_recordings.tellable(trials, model)
    try:
        usable, _ = check.check(_motion(trials, model), model)
        if given.reference and model.name == load_recordings.SERVO:
            return _servo(given, model, usable)
        warnings.reproducible(usable, model)
        unchanged = recorded(replace(given, data=given.reference, trials=""), model)
        found = diagnose(trials, model, seed=given.seed, reference=unchanged, tell=tell)
        rows, untried = model.rows(usable), model.untried()
        more = warnings.warnings(found, rows, untried)
        return replace(found, warnings=(*found.warnings, *more))
    except BnsError as error:
        if out and not isinstance(error, StorageError):
            kept = request.write_partial(trials, model, error, out)
            raise BnsError(f"{error} What was found until then: {kept}") from error
        raise


def _servo(given: Diagnose, model: Any, trials: Any) -> Any:
    """Beside unchanged runs of the same servo, all of them."""
    from bns.gap.models.servo import diagnosis

    all_of = replace(given, data=given.reference, only=(), trials="")
    unchanged = recorded(all_of, model)
    return diagnosis.record(trials, unchanged, seed=given.seed)


def _odometry(given: Diagnose) -> Any:
    from bns.gap.importers import khepera3_odometry
    from bns.gap.models.odometry import record

    trials = [khepera3_odometry.read(path) for path in given.data]
    return record.record(trials, axle=khepera3_odometry.AXLE)


def _provenance(given: Diagnose, model: Any, trials: list[Any]) -> dict[str, Any]:
    from bns.experiment import versions

    named = given.model or (model.name if model else "odometry")
    return {
        "data": list(given.data),
        "model": str(Path(named).resolve()) if named.endswith(".toml") else named,
        "importer": given.importer,
        "columns": given.columns,
        "only": list(given.only),
        "trials": given.trials,
        "reference": list(given.reference),
        "told": shared(trials),
        "versions": dict(versions.collect()),
    }


def shared(trials: list[Any]) -> dict[str, float | str]:
    """Conditions that all trials share: settings of the robot in numbers, and which
    servo it has."""
    from bns.gap.recordings.trial_conditions import SERVO

    if not trials:
        return {}
    first, *others = (trial.conditions for trial in trials)
    return {
        name: value
        for name, value in first.items()
        if (isinstance(value, int | float) or name == SERVO)
        and all(other.get(name) == value for other in others)
    }


def _say(found: Any) -> None:
    """The verdict in words, then the best fits."""
    for line in found.decomposition.get("statements") or (found.verdict.sentence,):
        print(line)
    if found.verdict.change:
        print(found.verdict.change)
    for line in _shares(found) if found.decomposition else _ranked(found):
        print(line)
    faults = list(found.faults)
    if len(faults) > LISTED:
        more = len(faults) - LISTED
        faults = [*faults[:LISTED], f"{more} more faults of the data (`bns gap check`)"]
    for line in (*found.warnings, *faults):
        print(f"note: {line}")


def _shares(found: Any) -> Sequence[str]:
    """What each explanation closes, one line each."""
    parts = found.decomposition["parts"]
    width = max((len(part["name"]) for part in parts), default=0)
    return [
        f"  {part['name']:<{width}}  {100 * part['alone']:5.1f} % of the gap alone, "
        f"{100 * part['last']:5.1f} % added last"
        for part in parts
    ]


def _ranked(found: Any) -> Sequence[str]:
    """The share closed, then the fits with the least held-out loss."""
    nothing = [fit for fit in found.fits if not fit.names]
    ranked = sorted(found.fits, key=lambda fit: fit.held_out)
    best = [*[fit for fit in ranked if fit.names][:5], *nothing]
    return [
        *_closed(found),
        *(
            f"  held-out loss {fit.held_out:.5g}  {' + '.join(fit.names) or 'nothing'}"
            for fit in best
        ),
    ]


def _closed(found: Any) -> Sequence[str]:
    closed = found.closed
    if not closed or not found.verdict.named:
        return ()
    low, high = closed["closed_interval"]
    return (
        f"Gap closed on held-out trials: {100 * closed['closed']:.0f} % "
        f"[{100 * low:.0f}, {100 * high:.0f}].",
    )


def _draw(given: Diagnose, found: Any, trials: Any, model: Any, out: Path) -> None:
    with counting("drawing") as each:
        made = _drawn(given, found, trials, model, out, each)
    for name, path in made.items():
        print(f"{name + ':':<11}{path}")


def _drawn(
    given: Diagnose, found: Any, trials: Any, model: Any, out: Path, each: Each
) -> dict[str, Path | str]:
    def report() -> Path:
        from bns.viz.gap import report as gap_report

        return gap_report.write(found, trials, model, out / "report.html", each=each)

    def recording() -> Path:
        from bns.viz.gap import recording as gap_recording

        return gap_recording.write(found, trials, model, out / "recording.rrd")

    made: dict[str, Path | str] = {"data": out / "diagnosis.json"}
    if given.report:
        made |= attempt("report", report)
    if given.rerun and model is not None and find_spec("rerun") is None:
        made["in 3D"] = f"{install('view')}, then repeat this command"
    elif given.rerun and model is not None:
        for write in each([recording]):
            made |= attempt("recording", write)
    return made
