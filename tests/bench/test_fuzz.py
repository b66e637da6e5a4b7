"""Files of every kind made wrong: one line each, or content that makes sense."""

import time
import warnings

import pytest

from bench.storage import fuzz
from bench.storage.readers import Reader, readers
from bench.storage.sample_files import make

INPUTS = 30
"""of each reader; `python -m bench fuzz` tries more"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A directory with a file of every kind."""
    place = tmp_path_factory.mktemp("files")
    make(place)
    return place


@pytest.mark.parametrize("reader", readers(), ids=lambda reader: reader.name)
def test_wrong_files_are_refused_by_one_line(reader, home):
    assert reader.sane(reader.read(home)) == ""
    found = fuzz.Found()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(INPUTS):
            fuzz.attempt(reader, home, seed, found)
    assert found.cases == []
    assert found.counts["inputs"] == INPUTS
    skips = reader.name == "timing.jsonl"  # lines that are torn are left out
    assert skips or found.counts["refused"] > 0


def busy(home):
    while True:
        pass


@pytest.mark.parametrize(
    ("read", "hangs"),
    [(busy, 1), (lambda home: time.sleep(60), 1), (lambda home: time.sleep(0.1), 0)],
    ids=["busy", "waits for ever", "waits its turn"],
)
def test_what_hangs_is_ended_and_a_busy_machine_is_no_hang(
    read, hangs, monkeypatch, tmp_path
):
    monkeypatch.setattr(fuzz, "SLOW", 0.05)
    monkeypatch.setattr(fuzz, "ASLEEP", 1.0)
    found = fuzz.Found()
    fuzz.judge(Reader("one", "file", read), tmp_path, 0, found)
    assert found.counts["hangs"] == hangs and len(found.cases) == hangs
