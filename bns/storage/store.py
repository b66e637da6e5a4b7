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

Every file is written beside, synchronised and renamed, so it is whole or absent; a
step is written before the state that follows it. So a run killed at any moment and
resumed gives, in every file but timing.jsonl, the bytes of an undisturbed one (same
machine, versions and mode). When the run is finished `steps/` is removed: record,
arrays and dataset hold all that was in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError
from bns.experiment import loading
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.experiment.step import ARRAYS, Step, assemble
from bns.storage import files, journal
from bns.storage.directory import FORMAT, SCHEMA, Lock, check_free, read_head

_DONE = "trials_done"


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
    """

    directory: Path
    config: RunConfig
    mode: str
    versions: Mapping[str, str]
    conditions: Mapping[str, object]
    damage_onset: Sequence[int]
    _lock: Lock | None = field(default=None, repr=False)

    def create(self) -> "RunStore":
        """Make the directory.

        Raises:
            BnsError: there is something in it already, or it cannot be written.
        """
        check_free(self.directory)
        files.make_directory(self.directory)
        self.lock()
        files.remove_temporary(self.directory)
        text = loading.to_toml(self.config)
        files.write_bytes(self.directory / "config.toml", text.encode())
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
        head = read_head(directory / "run.json")
        try:
            return cls(
                directory,
                loading.from_mapping(head["config"]),
                head["mode"],
                head["versions"],
                head["conditions"],
                head["damage_onset"],
            )
        except (KeyError, BnsError) as error:
            raise FormatError(
                f"{directory}/run.json cannot be used: {error} Nothing was changed."
            ) from error

    def lock(self) -> None:
        """Keep other processes from writing here until this one ends.

        Raises:
            BnsError: another process is writing here.
        """
        self._lock = Lock(self.directory)
        self._lock.take()

    def close(self) -> None:
        """Let others write here."""
        if self._lock is not None:
            self._lock.release()

    @property
    def exists(self) -> bool:
        """Whether the directory has been made."""
        return (self.directory / "run.json").exists()

    @property
    def finished(self) -> bool:
        """Whether all trials are done and stored."""
        return (self.directory / "record.parquet").exists()

    def write_step(self, trial: int, step: Step) -> None:
        """Store trial number `trial`."""
        files.make_directory(self.directory / "steps")
        files.write_npz(self._step_path(trial), step.to_arrays())

    def write_state(self, done: int, state: Mapping[str, np.ndarray]) -> None:
        """Store the learner's state after `done` trials."""
        arrays = {_DONE: np.array(done, dtype=np.int64), **state}
        files.write_npz(self.directory / "state.npz", arrays)

    def read_state(self) -> tuple[int, dict[str, np.ndarray]]:
        """Trials done and the learner's state after them (0, empty at the start)."""
        path = self.directory / "state.npz"
        if not path.exists():
            return 0, {}
        arrays = files.read_npz(path)
        if _DONE not in arrays:
            raise FormatError(f"{path} is no state of a run. Nothing was changed.")
        return int(arrays.pop(_DONE)), arrays

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
        return [Step.from_arrays(files.read_npz(path)) for path in paths]

    def record(self) -> RunRecord:
        """What was done so far."""
        if self.finished:
            return _finished_record(self)
        return self._assemble(self.steps())

    def finish(self) -> RunRecord:
        """Turn the steps into the record, its arrays and the dataset."""
        from bns.storage.table import write_table

        steps = self.steps()
        record = self._assemble(steps)
        arrays = {name: getattr(record, name) for name in ARRAYS}
        arrays |= {f"extra.{name}": value for name, value in record.extra.items()}
        arrays["damage_onset"] = record.damage_onset
        files.write_npz(self.directory / "arrays.npz", arrays, compressed=True)
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
        journal.note(self.directory / "timing.jsonl", **entry)

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


def _finished_record(store: RunStore) -> RunRecord:
    from bns.storage.table import read_table

    arrays = files.read_npz(store.directory / "arrays.npz")
    missing = {*ARRAYS, "damage_onset"} - set(arrays)
    if missing:
        raise FormatError(f"{store.directory}/arrays.npz lacks {min(missing)}.")
    return RunRecord(
        config=store.config,
        versions=store.versions,
        columns=read_table(store.directory / "record.parquet"),
        damage_onset=arrays["damage_onset"],
        directory=str(store.directory),
        conditions=store.conditions,
        extra={
            name.removeprefix("extra."): value
            for name, value in arrays.items()
            if name.startswith("extra.")
        },
        **{name: arrays[name] for name in ARRAYS},
    )
