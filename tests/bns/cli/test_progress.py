"""Progress fits the terminal, and says what is left."""

import io
import re

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


def test_work_without_an_end_is_quiet_where_there_is_no_terminal(capsys):
    with progress.working("diagnosing") as tell:
        tell("trial 3")
    assert capsys.readouterr() == ("", "")
