"""Progress fits the terminal, and says what is left."""

import io
import re
import time

import pytest

from bns import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("counted", [True, False])
def test_a_bar_fits_the_terminal(monkeypatch, columns, counted):
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    with progress.Bar("khepera-light-recover", 200, counted=counted) as bar:
        bar.update(150, "damaged, 30 of 30 solve")
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    lines = [line for line in re.split(r"[\r\n]", plain) if line.strip()]
    assert lines and max(map(len, lines)) <= columns
    assert "left" in lines[-1]
    if columns >= 80:
        assert ("150/200" if counted else "75 %") in lines[-1]
        assert "damaged, 30 of 30 solve" in lines[-1]


def test_without_a_terminal_a_line_says_what_is_left(monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    ticks = iter([0.0, 10.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(ticks))
    with progress.Bar("cases", 4) as bar:
        bar.update(1, "case 1")
    assert capsys.readouterr().err == "cases: 1 of 4, about 30 s left, case 1\n"


def test_items_are_gone_through_under_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    ticks = iter([0.0, 10.0, 20.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(ticks))
    assert list(progress.each("cases", ["a", "b"])) == ["a", "b"]
    said = "cases: 1 of 2, about 10 s left\ncases: 2 of 2, about 0 s left\n"
    assert capsys.readouterr().err == said


def drawn(monkeypatch, columns=80):
    """A terminal; gives what reads the lines that were written to it."""
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")

    def lines():
        plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
        return [line for line in re.split(r"[\r\n]", plain) if line.strip()]

    return lines


def test_items_of_several_sequences_are_counted_together(monkeypatch):
    lines = drawn(monkeypatch)
    with progress.counting("figures") as each:
        assert list(each("ab")) == ["a", "b"]
        assert list(each("cde")) == ["c", "d", "e"]
    assert "5/5" in lines()[-1] and max(map(len, lines())) <= 80


def test_counting_is_quiet_where_there_is_no_terminal(capsys, monkeypatch):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    with progress.counting("figures") as each:
        assert list(each([1, 2])) == [1, 2]
    assert capsys.readouterr() == ("", "")


def test_what_is_left_follows_from_what_the_stages_before_took():
    now = 0.0
    left = progress.Estimate({"a": 0.1, "b": 0.8, "c": 0.1}, clock=lambda: now)
    left.enter("a")
    assert str(left) == ""
    now = 10.0
    left.enter("b")
    assert str(left) == "about 2 min left"
    now = 60.0
    left.enter("a trial")  # no stage
    assert str(left) == "about 40 s left"
    now = 130.0
    assert str(left) == "a little longer"
    now = 180.0
    left.enter("c")
    assert str(left) == "about 20 s left"


def test_what_is_usual_counts_until_a_stage_tells_more():
    now = 0.0
    left = progress.Estimate({"a": 0.5, "b": 0.5}, usual=30.0, clock=lambda: now)
    now = 10.0
    assert str(left) == "about 20 s left"
    left.enter("b")
    assert str(left) == "about 10 s left"


@pytest.mark.parametrize("columns", [60, 80])
def test_work_without_an_end_fits_the_terminal(monkeypatch, columns):
    lines = drawn(monkeypatch, columns)
    with progress.working("diagnosing 12 trials", usual=5000.0) as tell:
        tell("a stage whose name is far too long for any terminal, and goes on")
    assert max(map(len, lines())) <= columns
    assert "about 1 h 23 min left" in lines()[-1]


def test_short_work_is_quiet_where_there_is_no_terminal(capsys):
    with progress.working("diagnosing") as tell:
        tell("trial 3")
    assert capsys.readouterr() == ("", "")


def test_work_without_an_end_tells_lines_where_there_is_no_terminal(
    monkeypatch, capsys
):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.01)
    with progress.working("diagnosing", usual=5000.0) as tell:
        tell("rivals")
        time.sleep(0.2)
    said = capsys.readouterr().err.splitlines()
    assert said
    assert said[-1].startswith("diagnosing: rivals, 0 s, about 1 h 23 min left")
