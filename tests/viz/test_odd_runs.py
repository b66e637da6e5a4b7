"""Reports and recordings of runs that were stopped, failed, or lost their data."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from bns.viz import recording, report
from bns.viz.page import Picture


def first(record, replicates, trials):
    """Some replicates and trials of a record."""
    part = np.s_[:replicates, :trials]
    return replace(
        record,
        columns={name: values[part] for name, values in record.columns.items()},
        sent=record.sent[part],
        poses=record.poses[part],
        predicted=record.predicted[part],
        damage_onset=record.damage_onset[:replicates],
    )


def lost(record):
    """Trial 20 was lost in every run."""
    columns = {name: values.copy() for name, values in record.columns.items()}
    for name in ("fitness", "snn_forward", "snn_left", "snn_turn"):
        columns[name][:, 20] = np.nan
    poses, predicted = record.poses.copy(), record.predicted.copy()
    poses[:, 20] = predicted[:, 20] = np.nan
    return replace(record, columns=columns, poses=poses, predicted=predicted)


def never(record):
    """No trial solved anything."""
    columns = dict(record.columns) | {"solved": np.zeros_like(record["solved"])}
    return replace(record, columns=columns)


CASES = {
    "one run": lambda record: first(record, 1, 40),
    "stopped before the damage": lambda record: first(record, 5, 7),
    "one trial": lambda record: first(record, 1, 1),
    "stopped at the damage": lambda record: first(record, 5, 21),
    "never solved": never,
    "lost": lost,
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_drawn_without_a_warning(case, record, tmp_path):
    made = CASES[case](record)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", DeprecationWarning)  # among other packages
        text = report.write(made, tmp_path / "a.html").read_text(encoding="utf-8")
        path = recording.write(made, {}, tmp_path / "a.rrd", replicate=0)
    assert "Key figures" in text and path.stat().st_size > 10_000


def test_none_recovered_is_said(record, tmp_path, monkeypatch):
    monkeypatch.setattr(
        report,
        "picture",
        lambda figure: Picture("data:image/svg+xml,", "data:image/svg+xml,"),
    )
    text = report.write(never(record), tmp_path / "a.html").read_text("utf-8")
    assert "None solved the task before the damage." in text
    assert "None recovered within the 20 trials that were left." in text
