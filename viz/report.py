"""One self-contained HTML page about one batch of runs, or about several."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns import stats
from bns.errors import BnsError
from bns.experiment import loading
from bns.experiment.record import RunRecord
from bns.learners import registry as learners
from bns.learners.base import Curves
from bns.progress import Each, uncounted
from bns.storage import files
from bns.tasks import registry as tasks
from bns.viz import captions, facts, figures, scene
from bns.viz.facts import Facts, interval
from bns.viz.page import picture, portrait, render

SHARED = ("fitness", "solved", "waits")
"""Figures of all tasks and learners; several batches can be laid over one another."""


def write(
    sources: Sequence[str | Path | RunRecord] | Mapping[str, RunRecord] | str | Path,
    out_html: str | Path,
    *,
    each: Each = uncounted,
) -> Path:
    """Write the report of one batch, or the comparison of several.

    Args:
        sources: run directories or records, one or more; a mapping gives the labels
            that a comparison shows.
        out_html: file to write; no other file is needed to read it.
        each: goes through the figures, and may count them.

    Returns:
        The path written.

    Raises:
        BnsError: there is nothing to report on.
        FormatError: a directory is not a finished run.
    """
    runs = _runs(sources)
    if not runs:
        raise BnsError("A report needs at least one run: give its directory.")
    files.write_bytes(Path(out_html), render("report.html", _context(runs, each)))
    return Path(out_html)


def _runs(sources: Any) -> dict[str, RunRecord]:
    if isinstance(sources, Mapping):
        return dict(sources)
    if isinstance(sources, str | Path | RunRecord):
        sources = [sources]
    records = [
        source if isinstance(source, RunRecord) else _load(source) for source in sources
    ]
    return dict(zip(_labels(records), records, strict=True))


def _load(directory: str | Path) -> RunRecord:
    from bns.storage.store import load

    return load(directory)


def _labels(records: Sequence[RunRecord]) -> list[str]:
    """Directory names, else presets; numbered where they are the same."""
    names = [
        Path(record.directory).name
        or record.config.preset
        or scene.picture(record.config).name
        for record in records
    ]
    return [
        name if names.count(name) == 1 else f"{name} ({at + 1})"
        for at, name in enumerate(names)
    ]


def _context(runs: Mapping[str, RunRecord], each: Each = uncounted) -> dict:
    """What the template fills in."""
    batches = [_batch(label, record) for label, record in runs.items()]
    several = len(runs) > 1
    context = {
        "several": several,
        "batches": batches,
        "title": _title(list(runs)) if several else batches[0]["name"],
        "figures": _drawn(runs, each),
        "notes": captions.notes(runs),
    }
    if several:
        context["comparison"] = comparison(runs)
        context["differences"] = differences(runs)
        context["paths"] = [
            (
                label,
                picture(figures.path(record)),
                captions.caption("path", {label: record}),
            )
            for label, record in each(list(runs.items()))
        ]
    return context


def _title(labels: Sequence[str]) -> str:
    if len(labels) <= 3:
        return " against ".join(labels)
    return f"{len(labels)} batches, against {labels[0]}"


def _batch(label: str, record: RunRecord) -> dict:
    found = facts.Facts.of(record, label)
    return {
        "label": label,
        "name": record.config.preset or f"{scene.picture(record.config).name} task",
        "sentences": facts.sentences(record, found),
        "rows": facts.rows(record, found),
        "toml": loading.to_toml(record.config),
        "versions": sorted(record.versions.items()),
        "conditions": sorted(
            (key, setting(value)) for key, value in record.conditions.items()
        ),
        "directory": Path(record.directory).name,
        "robot": record.config.world.robot,
        "portrait": portrait(record.config.world.robot),
        "seed": record.config.seed,
    }


def _drawn(runs: Mapping[str, RunRecord], each: Each) -> list[dict]:
    chosen = _shared_figures(runs) if len(runs) > 1 else _own_figures(runs)
    return [_entry(figure, runs) for figure in each(chosen)]


def _own_figures(runs: Mapping[str, RunRecord]) -> list[Curves | str]:
    record = next(iter(runs.values()))
    shown = scene.picture(record.config)
    ours = [*shown.figures, *SHARED, *_of_learner(record)]
    return [figure for figure in ours if _drawable(figure, record)]


def _of_learner(record: RunRecord) -> list[Curves | str]:
    """Figures that the learner of a batch declares, and BNS its problem."""
    learner, task = learners.get(record.config.learner), tasks.of(record.config)
    return learner.figures_of(task)


def _drawable(figure: Curves | str, record: RunRecord) -> bool:
    """Whether a record has what a figure shows."""
    if isinstance(figure, Curves):
        return all(panel.column in record.columns for panel in figure.panels)
    return figure != "displacement" or facts.foresees(record)


def _shared_figures(runs: Mapping[str, RunRecord]) -> list[Curves | str]:
    """Figures that all batches have."""
    first = next(iter(runs.values()))
    own = [
        figure
        for figure in _of_learner(first)
        if isinstance(figure, Curves)
        and figure.compared
        and all(_drawable(figure, record) for record in runs.values())
    ]
    return [*SHARED, *own]


def _entry(figure: Curves | str, runs: Mapping[str, RunRecord]) -> dict:
    record = next(iter(runs.values()))
    if isinstance(figure, Curves):
        name, title = figure.name, figure.title
        drawn = figures.curves(runs, figure)
    else:
        name, title = figure, captions.title(figure, record)
        drawn = getattr(figures, figure)(runs if figure in SHARED else record)
    return {
        "name": name,
        "title": title,
        "caption": captions.caption(figure, runs),
        "image": picture(drawn),
    }


def comparison(runs: Mapping[str, RunRecord]) -> dict:
    """Header and rows of the comparison.

    Every batch is tested against the first on trials to recover (on trials to solve
    where nothing was damaged): two-sided Mann-Whitney p, Holm's adjustment over the
    rows, and A12, the probability that a run of the first batch takes longer than one
    of the row: that of `bns compare`, the first batch being a and the row b.
    """
    facts = [Facts.of(record, label) for label, record in runs.items()]
    waits = [_waits(record) for record in runs.values()]
    raw = [_p(waits[0], other) for other in waits[1:]]
    known = [value for value in raw if value is not None]
    adjusted = iter(stats.holm(known) if known else ())
    rows = [[*_figures(facts[0]), "first", "", ""]]
    for fact, other, p in zip(facts[1:], waits[1:], raw, strict=True):
        tests = ["-", "-", "-"]
        if p is not None:
            effect = stats.a12(waits[0], other)
            tests = [
                _show_p(p),
                _show_p(float(next(adjusted))),
                f"{effect.value:.2f} ({effect.low:.2f} to {effect.high:.2f})",
            ]
        rows.append([*_figures(fact), *tests])
    header = (
        "batch, runs, solved, trials to solve, recovered, trials to recover, p, "
        "p (Holm), A12 of the first against it"
    )
    return {"header": header.split(", "), "rows": rows}


def differences(runs: Mapping[str, RunRecord]) -> dict:
    """Settings that are not the same in all batches, one row each."""
    flat = [loading.flat(loading.to_mapping(record.config)) for record in runs.values()]
    keys = sorted({key for settings in flat for key in settings})
    rows = []
    for key in keys:
        values = [settings.get(key, "-") for settings in flat]
        if any(value != values[0] for value in values):
            rows.append([key, *(setting(value) for value in values)])
    return {"header": ["setting", *runs], "rows": rows}


def _figures(fact: Facts) -> list[str]:
    damaged = fact.onset is not None
    return [
        fact.label,
        str(fact.runs),
        str(fact.solved),
        _short(interval(fact.to_solve)),
        str(fact.recovered) if damaged else "-",
        _short(interval(fact.to_recover)) if damaged else "-",
    ]


def _short(text: str) -> str:
    return text.replace("95 % interval ", "")


def _waits(record: RunRecord) -> np.ndarray:
    back = stats.trials_to_recover(record)
    back = back[~np.isnan(back)]
    return back if len(back) else stats.trials_to_solve(record)


def _p(first: np.ndarray, other: np.ndarray) -> float | None:
    if len(first) == 0 or len(other) == 0:
        return None
    return stats.mann_whitney(first, other)


def _show_p(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}"


def setting(value: object) -> str:
    """A setting's value as a reader would write it."""
    if isinstance(value, list | tuple):
        return " + ".join(map(str, value)) or "none"
    return str(value)
