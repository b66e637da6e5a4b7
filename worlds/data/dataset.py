"""Datasets: trials in a directory that any tool can read.

A dataset is a directory with three files.

`dataset.json` (UTF-8, keys sorted):

    schema            "bns-dataset"
    version           1
    robot             name of the robot model
    channels          observed channels, [{"name": "x", "unit": "m"}, ...]
    command_channels  what the robot is told, likewise
    rows              {"trials": samples, "commands": commands}
    trials            one object per trial, in the order of the tables: "replicate",
                      "trial", "world", "outcome" (flags and counters), "conditions",
                      "handled" (indices of commands in which somebody moved it)
    provenance        anything that says where the data come from
    sha256            of all this (`bns.storage.seal`); may be left out

`trials.parquet`, one row per sample, grouped by trial, in order of time:

    replicate   int64    which run or robot
    trial       int64    number of the trial in its replicate
    time        float64  since the start of the trial [s], never decreasing
    (channels)  float64  one column per observed channel

`commands.parquet`, one row per command, grouped by trial likewise, in order:

    replicate, trial      int64    as above
    first, last           int64    sample of the trial at the command's start and end
    duration              float64  [s]
    (command channels)    float64  one column per channel

All units are SI. Poses are (x, y, yaw) in the world frame, yaw continuous. A sample
that the tracker lost has NaN in all of x, y and yaw; no other NaN is allowed. A robot
on a stand has no pose, but other channels: there a lost sample is NaN in all. Hidden
states (`Trial.truth`) are not kept. The same trials give the same bytes.

The tables carry checksums of their pages and, as the key `sha256` of their metadata,
one of all columns. What has none is read, with a warning. Poses are within 1,000 km and
1e6 rad, commands within 1e6, and durations agree with the times of the samples.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bns.errors import BnsError, FormatError
from bns.storage import files, reading, seal
from bns.worlds.data import dataset_checks as checks
from bns.worlds.data import tables
from bns.worlds.trial import Channel, Outcome, Trial

HEAD = 256 << 20  # [bytes] of the header, which lists every trial
SCHEMA, VERSION = "bns-dataset", 1
HEADER, SAMPLES, COMMANDS = "dataset.json", "trials.parquet", "commands.parquet"


@dataclass(frozen=True, eq=False)
class Dataset:
    """Trials of one robot, with the same channels.

    Attributes:
        trials: in the order in which they were written.
        replicates: which run or robot each trial belongs to.
        numbers: number of each trial in its replicate.
        robot: name of the robot model.
        channels: observed channels.
        provenance: where the data come from.
    """

    trials: tuple[Trial, ...]
    replicates: tuple[int, ...]
    numbers: tuple[int, ...]
    robot: str
    channels: tuple[Channel, ...]
    provenance: Mapping[str, object] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.trials)


def write(
    directory: str | Path,
    trials: Sequence[Trial],
    *,
    provenance: Mapping[str, object] | None = None,
    replicates: Sequence[int] | None = None,
) -> Path:
    """Write trials as a dataset; it appears complete or not at all.

    Args:
        directory: to create; its parent has to exist.
        trials: of one robot, with the same channels.
        provenance: where they come from; JSON types only.
        replicates: which run or robot each trial belongs to; None = all to 0. Trials
            are numbered in order within each.

    Returns:
        The directory.

    Raises:
        BnsError: the directory exists or cannot be written, there is no trial, trials
            do not fit together.
        FormatError: a trial is not valid (see the module's docstring).
    """
    directory = Path(directory)
    if directory.exists():
        raise BnsError(f"{directory} exists and is not overwritten; take another name.")
    replicates = [0] * len(trials) if replicates is None else list(replicates)
    checks.fit_together(trials, replicates)
    numbers = tables.numbers(replicates)
    header = _header(trials, replicates, numbers, provenance or {})
    samples = tables.of_samples(trials, replicates, numbers)
    commands = tables.of_commands(trials, replicates, numbers)

    def fill(temporary: Path) -> None:
        temporary.mkdir()
        tables.write(temporary / SAMPLES, samples)
        tables.write(temporary / COMMANDS, commands)
        files.write_text(temporary / HEADER, header)

    files.replace(directory, fill)
    return directory


def _header(
    trials: Sequence[Trial],
    replicates: Sequence[int],
    numbers: Sequence[int],
    provenance: Mapping[str, object],
) -> str:
    def listed(channels: Sequence[Channel]) -> list[dict[str, str]]:
        return [channel._asdict() for channel in channels]

    header = {
        "schema": SCHEMA,
        "version": VERSION,
        "robot": trials[0].robot,
        "channels": listed(trials[0].channels),
        "command_channels": listed(trials[0].commands.channels),
        "rows": {
            "trials": sum(len(trial.times) for trial in trials),
            "commands": sum(len(trial.commands) for trial in trials),
        },
        "trials": [
            {
                "replicate": int(replicate),
                "trial": number,
                "world": trial.world,
                "outcome": trial.outcome._asdict(),
                "conditions": dict(trial.conditions),
                **_handled(trial),
            }
            for trial, replicate, number in zip(
                trials, replicates, numbers, strict=True
            )
        ],
        "provenance": dict(provenance),
    }
    try:
        text = json.dumps(header, sort_keys=True, allow_nan=False)
        sealed = seal.sealed(json.loads(text))
        return json.dumps(sealed, indent=1, sort_keys=True) + "\n"
    except (TypeError, ValueError) as error:
        raise BnsError(
            f"Conditions or provenance cannot be written as JSON ({error}); give "
            "text, finite numbers, lists and dictionaries."
        ) from None


def _handled(trial: Trial) -> dict[str, list[int]]:
    indices = [index for index, hit in enumerate(trial.handled) if hit]
    return {"handled": indices} if indices else {}


def read(directory: str | Path) -> Dataset:
    """Read a dataset; floats come back exactly as they were.

    Raises:
        FormatError: it is no dataset, is half-written or of a newer version, or its
            tables are not as the module's docstring says.
    """
    directory = Path(directory)
    header = _read_header(directory)
    channels = checks.channels(header, "channels", directory)
    told = checks.channels(header, "command_channels", directory)
    samples = tables.read(directory / SAMPLES, tables.SAMPLE_KEYS, channels)
    commands = tables.read(directory / COMMANDS, tables.COMMAND_KEYS, told)
    checks.rows(header, len(samples["time"]), len(commands["duration"]), directory)
    listed = checks.listed_trials(header, directory)
    keys = [(item["replicate"], item["trial"]) for item in listed]
    trials = []
    pieces = zip(
        tables.split(samples, keys, directory / SAMPLES),
        tables.split(commands, keys, directory / COMMANDS, allow_empty=True),
        listed,
        strict=True,
    )
    for sample, command, about in pieces:
        trial = tables.trial(
            sample, command, channels, told, f"{directory}: trial {about['trial']}"
        )
        trial = trial.replace(
            robot=str(header["robot"]),
            world=str(about.get("world", "")),
            outcome=Outcome(**checks.flags(about, directory)),
            conditions=about.get("conditions", {}),
            handled=checks.handled(about, len(trial.commands), directory),
        )
        checks.valid(
            trial,
            f"{directory}: replicate, trial {about['replicate']}, {about['trial']}",
        )
        trials.append(trial)
    return Dataset(
        trials=tuple(trials),
        replicates=tuple(key[0] for key in keys),
        numbers=tuple(key[1] for key in keys),
        robot=str(header["robot"]),
        channels=channels,
        provenance=header.get("provenance", {}),
    )


def _read_header(directory: Path) -> dict:
    path = directory / HEADER
    if not path.exists():
        raise FormatError(
            f"{directory} holds no {HEADER}: it is no dataset, a half-written one, or "
            "of a run to be finished (`bns run DIR --resume`)."
        )
    given = reading.read_json(path, most=HEAD)
    if given.get("schema") != SCHEMA:
        raise FormatError(
            f"{path} has schema {given.get('schema')!r}, a dataset {SCHEMA!r}; bring "
            "other logs in with bns.worlds.data.importing."
        )
    version = given.get("version")
    if version != VERSION:
        raise FormatError(
            f"{path} has version {version!r}; this release reads {VERSION}: "
            "read it with the release that wrote it."
        )
    if not isinstance(given.get("robot"), str):
        raise FormatError(f"{path} names no robot.")
    if not isinstance(given.get("provenance", {}), dict):
        raise FormatError(f"{path}: provenance is no object.")
    return seal.opened(given, path)
