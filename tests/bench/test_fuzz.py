"""Files of every kind made wrong: one line each, or content that makes sense."""

import warnings

import pytest

from bench.storage import reading
from bench.storage.readers import make, readers

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
    found = reading.Found()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(INPUTS):
            reading.attempt(reader, home, seed, found)
    assert found.cases == []
    assert found.counts["inputs"] == INPUTS
    skips = reader.name == "timing.jsonl"  # lines that are torn are left out
    assert skips or found.counts["refused"] > 0
