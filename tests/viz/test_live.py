"""A live view that fails is said once and does not stop the run."""

import logging
import time

import numpy as np
import pytest

from bns.experiment.step import ARRAYS, Step
from bns.viz import live, picture

pytest.importorskip("rerun")


def step(record, trial):
    return Step(
        {name: values[:, trial] for name, values in record.columns.items()},
        {name: getattr(record, name)[:, trial] for name in ARRAYS},
    )


def test_without_a_display_it_warns_once_and_goes_on(record, monkeypatch, caplog):
    monkeypatch.setattr(live, "_no_display", lambda: True)
    with (
        caplog.at_level(logging.WARNING),
        live.stream(record.config) as on_trial,
    ):
        for trial in range(3):
            on_trial(trial, step(record, trial), [])
    assert len(caplog.records) == 1
    assert "no display" in caplog.text


def test_unexpected_data_do_not_stop_the_run(record, monkeypatch, caplog):
    monkeypatch.setattr(live.Stream, "_open", lambda self, url: None)
    shown = live.Stream(record.config)
    shown.on_trial(0, Step({}, {"poses": np.zeros((1, 1, 3))}))
    assert shown.failed


def test_the_live_view_listens_on_this_machine_alone(monkeypatch):
    begun = []
    monkeypatch.setattr(live, "_no_display", lambda: False)
    monkeypatch.setattr(live, "executable", lambda: "viewer")
    monkeypatch.setattr(live, "wait", lambda process, port: None)
    monkeypatch.setattr(
        live.subprocess, "Popen", lambda words, **_: begun.append(words)
    )
    assert live._spawn().startswith("rerun+http://127.0.0.1:")
    ((_, flag, address, *_),) = begun
    assert (flag, address) == ("--bind", "127.0.0.1")


def test_trials_reach_a_viewer(record):
    problem = picture.missing()
    if problem:
        pytest.skip(str(problem))
    with (
        picture.viewer() as viewer,
        live.stream(record.config, url=viewer.url) as on_trial,
    ):
        for trial in range(3):
            on_trial(trial, step(record, trial), [])
        names, tries = set(), 0
        while not names and (tries := tries + 1) < 40:
            time.sleep(0.25)
            names = {view.name for view in viewer.get_state().views}
    assert names >= {"World", "Fitness"}
