"""Train: the loop of trials, stored after each one and resumable."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError
from bns.experiment import versions
from bns.experiment.batch import Batch, check_device, check_world, resolve
from bns.experiment.config import RunConfig
from bns.experiment.loading import differences
from bns.experiment.record import RunRecord, Step, assemble
from bns.experiment.validate import check
from bns.experiment.world_factory import make_models, make_world, surroundings
from bns.progress import Bar
from bns.storage import files, reading
from bns.storage.arrays import alike
from bns.storage.lock import Lock
from bns.storage.store import RunStore, check_free
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial
from bns.worlds.world import World

RECENT = 8
"""trials whose median time gives the estimate; the first ones compile"""


class Progress:
    """What a run shows of itself on the standard error stream.

    Args:
        config: of the run.
        enabled: False shows nothing.
    """

    def __init__(self, config: RunConfig, *, enabled: bool = True):
        self.total, self.first = config.trials, 0
        self.name = config.preset or config.task.name
        self.enabled = enabled
        self.solved = np.zeros(config.replicates, dtype=bool)
        self.bar: Bar | None = None
        self.before = time.monotonic()
        self.seconds: deque[float] = deque(maxlen=RECENT)

    @contextmanager
    def start(self, done: int = 0) -> Iterator[None]:
        """Show progress inside the block; `done` trials lie behind already."""
        self.first = done
        self.before = time.monotonic()
        if not self.enabled:
            yield
            return
        with Bar(self.name, self.total, done=done) as self.bar:
            yield

    def recall(self, record: RunRecord) -> None:
        """Take note of what a run that is resumed has solved already."""
        self.solved |= (record["solved"] > 0).any(axis=1)

    def update(self, trial: int, step: Step) -> None:
        """Show that a trial is done."""
        if not self.bar:
            return
        now = time.monotonic()
        self.seconds.append(now - self.before)
        self.before = now
        self.solved[: len(step.columns["solved"])] |= (
            step.columns["solved"][: len(self.solved)] > 0
        )
        left = float(np.median(self.seconds)) * (self.total - trial - 1)
        line = f"trial {trial + 1} of {self.total}, about {left:.0f} s left, "
        self.bar.update(
            trial + 1, self.brief(step), line=f"{line}{self.describe(step)}"
        )

    def brief(self, step: Step) -> str:
        """The runs' state in very few words, for a bar."""
        damaged = "damaged, " if step.columns["damaged"].any() else ""
        now = int(np.sum(step.columns["solved"] > 0))
        return f"{damaged}{now} of {len(self.solved)} solve"

    def describe(self, step: Step) -> str:
        """The runs' state in a few words."""
        columns = step.columns
        now = int(np.sum(columns["solved"] > 0))
        fitness = float(np.median(columns["fitness"]))
        damaged = ", damaged" if columns["damaged"].any() else ""
        return (
            f"median cost {fitness:.0f}, solved by {now} of {len(self.solved)} now, "
            f"{int(self.solved.sum())} ever{damaged}"
        )


OnTrial = Callable[[int, Step, list[Trial]], None]


def train(
    config: RunConfig,
    out: Path | str | None = None,
    *,
    world: World | None = None,
    resume: bool = False,
    progress: bool = False,
    on_trial: OnTrial | None = None,
    stop: Callable[[], bool] | None = None,
    background: bool = False,
    lock: Lock | None = None,
) -> RunRecord:
    """Train all replicates of a configuration.

    Args:
        config: the experiment.
        out: directory to store the run in; None keeps it in memory.
        world: where trials happen; None makes the one the configuration names. Its
            damage has to be that of the configuration.
        resume: go on with the run in `out`, if there is one.
        progress: show it on the standard error stream.
        on_trial: called after every trial with its number, what was learned, and
            the trial of every replicate.
        stop: asked before every trial; True ends the run there.
        background: the learner thinks while a trial runs, for a world in real time;
            how much is then what time allowed, and recorded.
        lock: of `out`, held by who calls; None takes it, and lets it go at the end.

    Returns:
        The record: all trials, or those done when `stop` said so.

    Raises:
        BnsError: a setting that is not allowed, a directory that is not free, holds
            another configuration or cannot be written.
    """
    check(config)
    check_device(config.device)
    check_world(config, named=world is None)
    if out is None:
        return _train(config, None, world, progress, on_trial, stop, background)
    with nullcontext(lock) if lock else Lock(out) as held:
        store = _store(config, Path(out), resume=resume)
        store.lock = held
        return _train(config, store, world, progress, on_trial, stop, background)


def _train(
    config: RunConfig,
    store: RunStore | None,
    world: World | None,
    progress: bool,
    on_trial: OnTrial | None,
    stop: Callable[[], bool] | None,
    background: bool,
) -> RunRecord:
    """As `train`, into a store that is locked, or none."""
    if store and store.finished:
        store.clean()
        return store.record()
    settled, mode = resolve(config, store.mode if store else "")
    batch = _batch(settled, store, world, background=background)
    shown = Progress(config, enabled=progress)
    steps = _loop(config, batch, store, shown, on_trial, stop or _never)
    if store is None:
        made = versions.collect()
        return assemble(config, steps, versions=made, **facts(config, mode))
    done, _ = store.read_state()
    return store.finish() if done == config.trials else store.record()


def train_many(
    configs: Sequence[RunConfig],
    *,
    worlds: Sequence[World] = (),
    progress: bool = False,
    on_trial: OnTrial | None = None,
) -> list[RunRecord]:
    """Train several configurations as one batch, in memory.

    Args:
        configs: they may differ in `adaptation` and `world` only.
        worlds: one per configuration; none makes those the configurations name.
        progress: show it on the standard error stream.
        on_trial: as for `train`; the runs of all configurations, one after another.

    Raises:
        BnsError: a setting that is not allowed, or configurations too different.
    """
    for config in configs:
        check_device(config.device)
        check_world(check(config))
    settled, mode = _settle(configs)
    batch = Batch(
        settled,
        worlds or [make_world(config) for config in settled],
        models=[model for config in settled for model in make_models(config)],
    )
    steps: list[Step] = []
    bar = Progress(configs[0], enabled=progress)
    with bar.start():
        for trial in range(configs[0].trials):
            step, tried = batch.advance(trial)
            steps.append(step)
            bar.update(trial, step)
            if on_trial:
                on_trial(trial, step, tried)
    made = versions.collect()
    return [
        assemble(
            config,
            [step.part(batch.part(index)) for step in steps],
            versions=made,
            **facts(config, mode),
        )
        for index, config in enumerate(configs)
    ]


def facts(config: RunConfig, mode: str) -> dict[str, Any]:
    """What a record says of the world beside the configuration."""
    damage = Damage.parse(config.world.damage)
    return {
        "conditions": {
            "damage": list(damage.texts()),
            "reality": list(Damage.parse(config.world.reality).texts()),
            "mode": mode,
        },
        "damage_onset": np.full(config.replicates, damage.first_trial, np.int64),
    }


def _settle(configs: Sequence[RunConfig]) -> tuple[list[RunConfig], str]:
    settled = [resolve(config) for config in configs]
    modes = {mode for _, mode in settled}
    return [config for config, _ in settled], modes.pop()


def _store(config: RunConfig, out: Path, *, resume: bool) -> RunStore:
    """The store of a run: a new one, or the one to go on with."""
    if resume and (out / "run.json").exists():
        store = RunStore.open(out)
        differing = differences(config, store.config)
        if differing:
            key, (here, there) = next(iter(differing.items()))
            raise BnsError(
                f"{out} was made with {key} = {there!r}, not {here!r}: resume with the "
                f"configuration it has ({out}/config.toml), or give another --out."
            )
        files.remove_temporary(out)
        files.remove_temporary(out / "steps")
        return store
    check_free(out)
    _, mode = resolve(config)
    known = facts(config, mode)
    return RunStore(out, config, mode, versions.collect(), **known)


def _loop(
    config: RunConfig,
    batch: Batch,
    store: RunStore | None,
    progress: Progress,
    on_trial: OnTrial | None,
    stop: Callable[[], bool],
) -> list[Step]:
    """All trials that are left; without a store their steps are kept and returned."""
    memory: list[Step] = []
    done = _restore(batch, store)
    if store and done:
        progress.recall(store.record())
    with progress.start(done):
        for trial in range(done, config.trials):
            if stop():
                break
            started = time.perf_counter()
            step, tried = batch.advance(trial, recorded=config.record_replicates)
            if store:
                _keep(store, trial, step, batch.learner.state(), started)
            else:
                memory.append(step)
            progress.update(trial, step)
            if on_trial:
                on_trial(trial, step, tried)
    return memory


def _never() -> bool:
    return False


def _batch(
    config: RunConfig, store: RunStore | None, world: World | None, *, background: bool
) -> Batch:
    """Learner and world; a new directory is made once both are known to be possible."""
    from bns.experiment.batch import behind

    learner = behind(config) if background else None
    models = [] if background else make_models(config)
    if store is None:
        made = world or make_world(config)
        return Batch([config], [made], learner=learner, models=models)
    keeps_nets = world is None and config.world.name == "static-snn"
    if keeps_nets and not store.exists:
        surroundings(config)  # stops before there is a directory
        store.create()
    made = world or make_world(config, store.directory)
    batch = Batch([config], [made], learner=learner, models=models)
    if not store.exists:
        store.create()
    return batch


def _restore(batch: Batch, store: RunStore | None) -> int:
    """Put the learner where the run stopped; gives the trials done."""
    done, state = store.read_state() if store else (0, {})
    if store and done:
        path = store.directory / "state.npz"
        restored(batch.learner, batch.learner.state(), state, path)
    if store:
        store.note(event="resume" if done else "start", trials_done=done)
    return done


def restored(
    learner: Any,
    fresh: Mapping[str, np.ndarray],
    state: Mapping[str, np.ndarray],
    path: Path,
) -> None:
    """Put a stored state into a learner.

    Args:
        learner: made for the same configuration.
        fresh: its own state before it did anything.
        state: as read.
        path: of the file, for messages.

    Raises:
        FormatError: it is no state of such a learner.
    """
    alike(state, fresh, path)
    try:
        learner.restore(state)
    except reading.UNREADABLE as error:
        raise FormatError(f"{path} is no state of this learner: {error}.") from error


def _keep(
    store: RunStore,
    trial: int,
    step: Step,
    state: Mapping[str, np.ndarray],
    started: float,
) -> None:
    computed = time.perf_counter()
    store.write_step(trial, step)
    store.write_state(trial + 1, state)
    stored = time.perf_counter()
    store.note(
        trial=trial,
        seconds=round(computed - started, 6),
        storing=round(stored - computed, 6),
    )
