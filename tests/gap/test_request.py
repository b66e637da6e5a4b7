"""A killed diagnosis: the same command again is possible, another is not."""

import pytest

from bns.errors import BnsError
from bns.gap import request
from bns.storage.files import TEMPORARY

ASKED = {"data": ["drives"], "seed": 0}


def test_a_killed_one_may_be_repeated(tmp_path):
    request.begin(tmp_path, ASKED)
    (tmp_path / "diagnosis.json").write_text("{}")
    (tmp_path / f"{TEMPORARY}1-report.html").write_text("half")
    request.begin(tmp_path, ASKED)
    held = {path.name for path in tmp_path.iterdir()}
    assert held == {"request.json", "diagnosis.json"}


def test_another_one_is_refused_and_changes_nothing(tmp_path):
    request.begin(tmp_path, ASKED)
    with pytest.raises(BnsError, match="unfinished diagnosis of something else"):
        request.begin(tmp_path, ASKED | {"seed": 1})
    request.begin(tmp_path, ASKED)


@pytest.mark.parametrize("name", ["diagnosis.json", "notes.txt"])
def test_what_is_there_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("{}")
    with pytest.raises(BnsError, match="not overwritten"):
        request.begin(tmp_path, ASKED)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_one_that_could_not_be_finished_may_be_asked_otherwise(tmp_path):
    request.begin(tmp_path, ASKED)
    (tmp_path / "partial.json").write_text("{}")
    request.drop(tmp_path)
    request.begin(tmp_path, ASKED | {"seed": 1})
    request.end(tmp_path)
    assert not any(tmp_path.iterdir())
