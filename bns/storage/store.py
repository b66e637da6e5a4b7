"""The directory of a run: what is in it, and how it survives being killed.

    run.json        schema, configuration, mode, versions, machine, commit
    config.toml     the resolved configuration, ready for `bns run`
    steps/00000.npz one file per trial while the run is going on
    state.npz       the learner after the last trial
    static_snn.npz  the nets of the world, where the world is a static SNN
    timing.jsonl    wall times
    dataset/        all samples of the first `record_replicates` replicates
    arrays.npz      commands sent, poses seen, poses foreseen, damage onsets
    record.parquet  a row per replicate and trial; there when the run is finished
                    (NPZ where pyarrow is missing, see `tables`; so in dataset/)

Every file is written beside, synchronised and renamed, so it is whole or absent; a
step is written before the state that follows it. So a run killed at any moment and
resumed gives, in every file but timing.jsonl, the bytes of an undisturbed one (same
machine, versions and mode). When the run is finished `steps/` is removed: record,
arrays and dataset hold all that was in it. Every file that is read again carries a
checksum (`seal`, `parquet`; NPZ has its own); what an older version wrote has none.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from bns.errors import BnsError, FormatError
from bns.experiment import loading
from bns.experiment.config import RunConfig
from bns.experiment.record import ARRAYS, RunRecord, Step, assemble
from bns.storage import arrays as npz
from bns.storage import files, reading, seal, tables
from bns.storage.lock import Lock

FORMAT = "bns-run"
SCHEMA = 1


def check_free(directory: Path) -> None:
    """Refuse a directory that holds anything.

    Raises:
        BnsError: it holds a run (go on with --resume) or something else.
    """
    if not directory.exists():
        return
    if not directory.is_dir():
        raise BnsError(f"{directory} is a file: give another --out.")
    held = [p.name for p in directory.iterdir() if not _harmless(p.name)]
    if "run.json" in held:
        raise BnsError(
            f"{directory} holds a run already: add --resume to go on with it, "
            "or give another --out."
        )
    if held:
        raise FormatError(
            f"{directory} is not empty and holds no run ({min(held)}, ...): "
            "give another --out. Nothing was changed."
        )


def _harmless(name: str) -> bool:
    """What a run killed before its first whole file leaves behind."""
    return name.startswith(files.TEMPORARY) or name in ("config.toml", "faults.jsonl")


def read_head(
    path: Path, *, kind: str = "run", format: str = FORMAT, schema: int = SCHEMA
) -> dict[str, Any]:
    """The content of the file that says what a directory holds.

    Args:
        path: of the file.
        kind: of directory, "run" or "campaign".
        format: name that the file must state.
        schema: newest that can be read.

    Raises:
        FormatError: no such directory, damaged, or written by a newer version.
    """
    made = {"run": "bns run", "campaign": "bns campaign run"}[kind]
    if not path.exists():
        raise FormatError(
            f"{path.parent} is not a {kind} directory (it has no {path.name}): "
            f"give one that `{made}` made. Nothing was changed."
        )
    head = seal.opened(reading.read_json(path), path)
    if head.get("format") != format or type(head.get("schema")) is not int:
        raise FormatError(f"{path} is not a {kind} of bns. Nothing was changed.")
    if head["schema"] > schema:
        raise FormatError(
            f"{path} has schema {head['schema']}, this version reads up to {schema}: "
            "install a newer bns. Nothing was changed."
        )
    return head


_DONE = "trials_done"


class Head(msgspec.Struct):
    """What run.json says, beside its format and schema."""

    mode: Literal["compiled", "eager"]
    config: dict[str, Any]
    conditions: dict[str, Any]
    damage_onset: list[Annotated[int, msgspec.Meta(ge=-1, le=1_000_000_000)]]
    versions: dict[str, str]


@dataclass(eq=False)
class RunStore:
    """A run directory that is being written.

    Attributes:
        directory: where.
        config: the resolved configuration.
        mode: "compiled" or "eager", kept when the run is resumed.
        versions: what made it.
        conditions: what was true of the world, by name.
        damage_onset: first damaged trial per replicate, ``(R,)``; -1 = none.
        lock: held while it is written.
    """

    directory: Path
    config: RunConfig
    mode: str
    versions: Mapping[str, str]
    conditions: Mapping[str, object]
    damage_onset: Sequence[int]
    lock: Lock | None = field(default=None, repr=False)

    def create(self) -> "RunStore":
        """Begin to fill the directory, which is locked.

        Raises:
            BnsError: there is something in it already, or it cannot be written.
        """
        check_free(self.directory)
        files.make_directory(self.directory)
        files.remove_temporary(self.directory)
        files.write_text(self.directory / "config.toml", loading.to_toml(self.config))
        head = {
            "format": FORMAT,
            "schema": SCHEMA,
            "mode": self.mode,
            "config": loading.to_mapping(self.config),
            "conditions": dict(self.conditions),
            "damage_onset": [int(onset) for onset in self.damage_onset],
            "versions": dict(self.versions),
        }
        files.write_json(self.directory / "run.json", head)
        return self

    @classmethod
    def open(cls, directory: Path | str) -> "RunStore":
        """An existing run directory; nothing in it is changed.

        Raises:
            FormatError: it is none, it is damaged, or a newer version wrote it.
        """
        directory = Path(directory)
        path = directory / "run.json"
        head = reading.typed(read_head(path), Head, path)
        try:
            config = loading.from_mapping(head.config)
        except BnsError as error:
            raise FormatError(
                f"{path} cannot be used: {error} Nothing was changed."
            ) from error
        if len(head.damage_onset) != config.replicates:
            raise FormatError(
                f"{path}: damage_onset has {len(head.damage_onset)} entries for "
                f"{config.replicates} replicates."
            )
        known = head.mode, head.versions, head.conditions, head.damage_onset
        return cls(directory, config, *known)

    def close(self) -> None:
        """Let others write here."""
        if self.lock is not None:
            self.lock.release()

    @property
    def exists(self) -> bool:
        """Whether the directory has been made."""
        return (self.directory / "run.json").exists()

    @property
    def finished(self) -> bool:
        """Whether all trials are done and stored."""
        return tables.exists(self.directory / "record.parquet")

    def write_step(self, trial: int, step: Step) -> None:
        """Store trial number `trial`."""
        files.make_directory(self.directory / "steps")
        npz.write_npz(self._step_path(trial), step.to_arrays())

    def write_state(self, done: int, state: Mapping[str, np.ndarray]) -> None:
        """Store the learner's state after `done` trials."""
        arrays = {_DONE: np.array(done, dtype=np.int64), **state}
        npz.write_npz(self.directory / "state.npz", arrays)

    def read_state(self) -> tuple[int, dict[str, np.ndarray]]:
        """Trials done and the learner's state after them (0, empty at the start).

        Raises:
            FormatError: the file is damaged, or no state of a run.
        """
        path = self.directory / "state.npz"
        if not path.exists():
            return 0, {}
        arrays = npz.read_npz(path)
        done = arrays.pop(_DONE, None)
        if done is None or done.shape != () or done.dtype.kind not in "iu":
            raise FormatError(f"{path} is no state of a run. Nothing was changed.")
        return int(done), arrays

    def steps(self) -> list[Step]:
        """All trials stored so far.

        Raises:
            FormatError: one is missing or cannot be read.
        """
        count = len(list((self.directory / "steps").glob("[0-9]*.npz")))
        paths = [self._step_path(trial) for trial in range(count)]
        for path in paths:
            if not path.exists():
                raise FormatError(f"{path} is missing. Nothing was changed.")
        steps = [self._step(path) for path in paths]
        for path, step in zip(paths, steps, strict=True):
            if _form(step) != _form(steps[0]):
                raise FormatError(f"{path} has other arrays than {paths[0].name}.")
        return steps

    def _step(self, path: Path) -> Step:
        """A stored step; it is of this run."""
        step = Step.from_arrays(npz.read_npz(path), str(path))
        missing = set(ARRAYS) - set(step.arrays)
        shapes = {value.shape[:1] for value in step.arrays.values()}
        shapes |= {value.shape for value in step.columns.values()}
        if missing or shapes != {(self.config.replicates,)}:
            raise FormatError(
                f"{path} is no step of {self.config.replicates} replicates with "
                f"{', '.join(ARRAYS)}. Nothing was changed."
            )
        return step

    def record(self) -> RunRecord:
        """What was done so far."""
        if self.finished:
            return _finished_record(self)
        return self._assemble(self.steps())

    def finish(self) -> RunRecord:
        """Turn the steps into the record, its arrays and the dataset."""
        steps = self.steps()
        record = self._assemble(steps)
        arrays = {name: getattr(record, name) for name in ARRAYS}
        arrays |= {f"extra.{name}": value for name, value in record.extra.items()}
        arrays["damage_onset"] = record.damage_onset
        npz.write_npz(self.directory / "arrays.npz", arrays, compressed=True)
        self._write_dataset(steps)
        write_table(self.directory / "record.parquet", record.columns)
        self.clean()
        return record

    def clean(self) -> None:
        """Remove what a finished run does not need."""
        files.remove_tree(self.directory / "steps")
        files.remove_temporary(self.directory)

    def note(self, **entry: Any) -> None:
        """Append a line to timing.jsonl."""
        files.append_entry(self.directory / "timing.jsonl", **entry)

    def _step_path(self, trial: int) -> Path:
        return self.directory / "steps" / f"{trial:05d}.npz"

    def _assemble(self, steps: Sequence[Step]) -> RunRecord:
        return assemble(
            self.config,
            steps,
            versions=self.versions,
            conditions=self.conditions,
            damage_onset=np.array(self.damage_onset),
            directory=str(self.directory),
        )

    def _write_dataset(self, steps: Sequence[Step]) -> None:
        trials = [trial for step in steps for trial in step.trials]
        if not trials:
            return
        from bns.worlds.data import dataset

        path = self.directory / "dataset"
        files.remove_tree(path)  # a killed process finished it, but not the run
        dataset.write(
            path,
            trials,
            replicates=[r for step in steps for r in range(len(step.trials))],
            provenance={"preset": self.config.preset, "seed": self.config.seed}
            | dict(self.versions),
        )


def load(directory: Path | str) -> RunRecord:
    """The record of a run, finished or not.

    Raises:
        FormatError: not a run directory, damaged, or written by a newer version.
    """
    return RunStore.open(directory).record()


def _form(step: Step) -> dict[str, tuple]:
    """Names, types and shapes of what a step holds."""
    held = {**step.columns, **step.arrays}
    return {name: (value.dtype, value.shape) for name, value in held.items()}


def _finished_record(store: RunStore) -> RunRecord:
    path, config = store.directory / "arrays.npz", store.config
    arrays = npz.read_npz(path)
    missing = {*ARRAYS, "damage_onset"} - set(arrays)
    if missing:
        raise FormatError(f"{path} lacks {min(missing)}.")
    columns = read_table(store.directory / "record.parquet")
    shape = (config.replicates, config.trials)
    onset = arrays.pop("damage_onset")
    for name, array in {**columns, **arrays}.items():
        if array.shape[:2] != shape or array.dtype.kind not in "biuf":
            raise FormatError(
                f"{store.directory}: {name} is {array.dtype} of shape {array.shape}; "
                f"it has to begin with {shape}, as run.json says."
            )
    if onset.shape != shape[:1] or onset.dtype.kind != "i":
        raise FormatError(f"{path}: damage_onset is not of {shape[0]} replicates.")
    for name, axes in {"sent": 4, "poses": 4, "predicted": 4}.items():
        if arrays[name].ndim != axes:
            raise FormatError(
                f"{path}: {name} has {arrays[name].ndim} axes, not {axes}."
            )
    return RunRecord(
        config=config,
        versions=store.versions,
        columns=columns,
        damage_onset=onset,
        directory=str(store.directory),
        conditions=store.conditions,
        extra={
            name.removeprefix("extra."): value
            for name, value in arrays.items()
            if name.startswith("extra.")
        },
        **{name: arrays[name] for name in ARRAYS},
    )


KEYS = ("replicate", "trial")


def write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of shape ``(R, T)``; the same columns give the same bytes.

    Raises:
        StorageError: no space, or no permission.
    """
    runs, trials = np.indices(next(iter(columns.values())).shape)
    table = {"replicate": runs, "trial": trials} | dict(columns)
    tables.write(path, {name: array.ravel() for name, array in table.items()})


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Read what `write_table` wrote, each column ``(R, T)``.

    Raises:
        FormatError: absent, torn, damaged, or not such a table.
    """
    columns = tables.read(path, dict.fromkeys(KEYS, "int64"))
    shape = tuple(int(columns[key].max(initial=-1)) + 1 for key in KEYS)
    rows = len(columns[KEYS[0]])
    if math.prod(shape) != rows:  # nothing is made for numbers so large
        raise FormatError(
            f"{path}: {' x '.join(map(str, shape))} replicates and trials in "
            f"{rows} rows."
        )
    for key, index in zip(KEYS, np.indices(shape), strict=True):
        if not np.array_equal(columns.pop(key), index.ravel()):
            raise FormatError(f"{path}: {key} does not count up over the {rows} rows.")
    return {name: array.reshape(shape) for name, array in columns.items()}
