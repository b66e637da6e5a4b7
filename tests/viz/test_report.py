"""Reports: one file, true in words, complete."""

import base64
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.stats import Interval
from bns.stats.compare import compare
from bns.viz import facts, figures, recording, report, style
from bns.viz.page import Picture


@pytest.fixture(scope="module")
def page(record, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    return report.write(record, path).read_text(encoding="utf-8")


@pytest.fixture
def unpictured(monkeypatch):
    """Reports without drawing, for tests of their text."""
    monkeypatch.setattr(
        report,
        "picture",
        lambda figure: Picture("data:image/svg+xml,", "data:image/svg+xml,"),
    )


def test_it_needs_nothing_else(page):
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', page)
    assert sources and all(source.startswith("data:image/") for source in sources)
    assert "<script" not in page and "@import" not in page


def test_a_telephone_gets_panels_below_each_other(record):
    drawn = report.picture(figures.solved({"a": record}))
    wide, narrow = (size(address) for address in drawn)
    assert wide[0] > wide[1], "two panels beside each other"
    assert narrow[0] < 300 < 1.5 * narrow[0] < narrow[1], "below each other [pt]"


def size(address):
    """Width and height of an SVG [pt]."""
    svg = base64.b64decode(address.partition(",")[2]).decode()
    return tuple(
        float(x) for x in re.findall(r'(?:width|height)="([\d.]+)pt"', svg)[:2]
    )


def test_it_says_what_happened(page, record):
    solved = np.isfinite(facts.to_solve(record)).sum()
    assert f"{solved} of 5 solved the task before the damage" in page
    assert "From trial 20 on" in page
    assert "a wheel turns at a share of the speed it is told" in page
    assert "5 of 5 recovered; the median run needed" in page


def test_every_figure_has_a_caption_and_a_text_for_who_cannot_see_it(page):
    assert page.count("<figcaption>") == page.count("<picture>") == 7
    assert page.count('alt="') == page.count("<img") == 1 + 7, "the robot, and figures"
    assert "data:image/png;base64," in page and 'alt="The robot khepera3."' in page


def test_it_can_be_reproduced(page):
    assert "bns run config.toml" in page
    assert "replicates = 5" in page and "3.17.0" in page


def test_a_figure_gives_the_same_bytes_every_time(record):
    one, two = (report.picture(figures.solved({"a": record})) for _ in range(2))
    assert one == two


def test_text_is_escaped(record, tmp_path, unpictured):
    config = replace(record.config, preset="<b>x</b>")
    made = report.write(replace(record, config=config), tmp_path / "a.html")
    text = made.read_text(encoding="utf-8")
    assert "<b>x</b>" not in text and "&lt;b&gt;x" in text


def test_several_runs_are_compared(record, tmp_path, unpictured):
    config = replace(record.config, seed=7)
    other = replace(record, config=config, columns=record.columns)
    made = report.write({"one": record, "two": other}, tmp_path / "a.html")
    text = made.read_text(encoding="utf-8")
    assert "one against two" in text and "Side by side" in text
    cells = '<td data-label="one">0</td><td data-label="two">7</td>'
    assert f'<th scope="row">seed</th>{cells}' in text
    assert "0.50 (" in text  # A12 of equal samples


def test_a12_is_that_of_bns_compare(record):
    """Of a pair both say how often the first, a, takes longer than the other, b."""
    slow = never(record)
    (row,) = report.comparison({"a": slow, "b": record})["rows"][1:]
    pairs = compare([slow, record], ["a", "b"]).pairs
    (pair,) = [pair for pair in pairs if pair.measure == "recover"]
    assert pair.a12.value == 1.0
    assert row[-1].startswith("1.00 (")


def test_runs_of_the_same_name_are_told_apart(record, tmp_path, unpictured):
    made = report.write([record, record], tmp_path / "a.html").read_text("utf-8")
    assert "khepera-simple (1)" in made and "khepera-simple (2)" in made
    assert "The settings are the same" in made


def test_nothing_to_report_on(tmp_path):
    with pytest.raises(BnsError, match="at least one run"):
        report.write([], tmp_path / "a.html")


def test_a_directory_that_is_no_run(tmp_path):
    with pytest.raises(FormatError, match="not a run directory"):
        report.write([tmp_path], tmp_path / "a.html")
    assert not (tmp_path / "a.html").exists()


def test_a_solution_after_the_damage_is_not_a_solution_before_it(record):
    solved = np.zeros((2, 6))
    solved[0, 1] = solved[0, 5] = solved[1, 4] = 1
    made = replace(
        record,
        columns={name: value[:2, :6] for name, value in record.columns.items()}
        | {"solved": solved},
        sent=record.sent[:2, :6],
        damage_onset=np.array([3, 3]),
    )
    found = facts.Facts.of(made)
    assert (found.solved, found.recovered, found.onset) == (1, 2, 3)
    assert facts.to_solve(made).tolist() == [2.0, np.inf]
    assert found.to_recover.value == 2.5


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Interval(12, 9, 15), "12 (95 % interval 9 to 15)"),
        (Interval(12, 9, np.inf), "12 (95 % interval 9 to never)"),
        (Interval(12, -np.inf, np.inf), "12"),
        (Interval(np.inf, 3, np.inf), "never"),
        (None, "-"),
    ],
)
def test_intervals_in_words(value, text):
    assert facts.interval(value) == text


def test_an_undamaged_run_is_compared_on_trials_to_solve(record):
    never = np.full(record.replicates, -1)
    healthy = replace(record, damage_onset=never)
    rows = report.comparison({"a": healthy, "b": healthy})["rows"]
    assert rows[1][4:8] == ["-", "-", "1.0000", "1.0000"]


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


def test_none_recovered_is_said(record, tmp_path, unpictured):
    text = report.write(never(record), tmp_path / "a.html").read_text("utf-8")
    assert "None solved the task before the damage." in text
    assert "None recovered within the 20 trials that were left." in text


def test_all_that_is_written_in_figures_can_be_read(record, tmp_path, illegible):
    report.write(record, tmp_path / "one.html")
    long = "window 150, mutation magnitude 0.05, tournament of three"
    report.write({"a": record, long: record}, tmp_path / "two.html")
    assert illegible == [], "\n".join(illegible)


def test_what_cannot_be_read_is_found(flaws):
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(2.0, 2.0))
        figure.text(0.9, 0.5, "beyond the edge")
        figure.text(0.1, 0.2, "one"), figure.text(0.12, 0.22, "two")
        assert flaws(figure) == [
            "beyond the edge: 'beyond the edge'",
            "on one another: 'one' and 'two'",
        ]
