"""One self-contained HTML page about one batch of runs, or about several."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from bns.errors import BnsError
from bns.experiment import loading
from bns.experiment.record import RunRecord
from bns.storage import files
from bns.viz import comparison, facts, figures, scene
from bns.viz.captions import CAPTIONS, LIGHT, TITLES, WALK
from bns.viz.page import picture, render

ALL_RUNS = ("fitness", "solved", "waits", "snn_error", "diversity")
"""Figures that lay several batches over one another."""

ONE_RUN = (
    "path",
    "fitness",
    "solved",
    "waits",
    "snn_error",
    "displacement",
    "diversity",
)
"""Figures of the report of a single batch, in order."""


def write(
    sources: Sequence[str | Path | RunRecord] | Mapping[str, RunRecord] | str | Path,
    out_html: str | Path,
) -> Path:
    """Write the report of one batch, or the comparison of several.

    Args:
        sources: run directories or records, one or more; a mapping gives the labels
            that a comparison shows.
        out_html: file to write; no other file is needed to read it.

    Returns:
        The path written.

    Raises:
        BnsError: there is nothing to report on.
        FormatError: a directory is not a finished run.
    """
    runs = _runs(sources)
    if not runs:
        raise BnsError("A report needs at least one run: give its directory.")
    files.write_bytes(Path(out_html), render("report.html", _context(runs)))
    return Path(out_html)


def _runs(sources) -> dict[str, RunRecord]:
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
        Path(record.directory).name or record.config.preset or scene.task(record.config)
        for record in records
    ]
    return [
        name if names.count(name) == 1 else f"{name} ({at + 1})"
        for at, name in enumerate(names)
    ]


def _context(runs: Mapping[str, RunRecord]) -> dict:
    """What the template fills in."""
    batches = [_batch(label, record) for label, record in runs.items()]
    several = len(runs) > 1
    context = {
        "several": several,
        "batches": batches,
        "title": _title(list(runs)) if several else batches[0]["name"],
        "figures": _shared_figures(runs) if several else _own_figures(runs),
    }
    if several:
        context["comparison"] = comparison.table(runs)
        context["differences"] = comparison.differences(runs)
        context["paths"] = [
            (label, picture(figures.path(record))) for label, record in runs.items()
        ]
        context["path_caption"] = _caption("path", next(iter(runs.values())))
    return context


def _title(labels: Sequence[str]) -> str:
    if len(labels) <= 3:
        return " against ".join(labels)
    return f"{len(labels)} batches, against {labels[0]}"


def _batch(label: str, record: RunRecord) -> dict:
    found = facts.Facts.of(record, label)
    return {
        "label": label,
        "name": record.config.preset or f"{scene.task(record.config)} task",
        "sentences": facts.sentences(record, found),
        "rows": facts.rows(record, found),
        "toml": loading.to_toml(record.config),
        "versions": sorted(record.versions.items()),
        "conditions": sorted(
            (key, comparison.text(value)) for key, value in record.conditions.items()
        ),
        "directory": Path(record.directory).name,
        "seed": record.config.seed,
    }


def _own_figures(runs: Mapping[str, RunRecord]) -> list[dict]:
    record = next(iter(runs.values()))
    alone = {
        "path": figures.path,
        "displacement": figures.displacement,
        "readings": figures.readings,
        "starts": figures.starts,
    }
    return [
        _entry(
            name,
            record,
            alone[name](record) if name in alone else getattr(figures, name)(runs),
        )
        for name in _names(record)
    ]


def _names(record: RunRecord) -> tuple[str, ...]:
    """Figures of one batch, in order."""
    if not scene.follows_light(record.config):
        return ONE_RUN
    at = ONE_RUN.index("snn_error")
    own = ("path", "starts", "readings", *ONE_RUN[1 : at + 1], "sensor_error")
    return (*own, *ONE_RUN[at + 1 :])


def _shared_figures(runs: Mapping[str, RunRecord]) -> list[dict]:
    first = next(iter(runs.values()))
    return [_entry(name, first, getattr(figures, name)(runs)) for name in ALL_RUNS]


def _entry(name: str, record: RunRecord, figure) -> dict:
    walks = scene.walks(record.config)
    return {
        "name": name,
        "title": "Adequate gaits" if name == "solved" and walks else TITLES[name],
        "caption": _caption(name, record),
        "image": picture(figure),
    }


def _caption(name: str, record: RunRecord) -> str:
    goals = scene.order(record.config)
    own = LIGHT if scene.follows_light(record.config) else {}
    own = WALK if scene.walks(record.config) else own
    return (CAPTIONS | own)[name].format(
        order=", ".join(goals),
        goals=len(goals),
        penalty=record.config.task.penalty,
        adequate=record.config.walk.adequate,
    )
