"""CSV tables that people have: cut off, with rows twice, with moments as text."""

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.importers import tables

ROWS = ["0.0,1.5,1.4", "0.1,1.6,1.5", "0.2,1.7,1.6"]


def table(path, rows, names="time,goal,q", end="\n"):
    (path / "a.csv").write_text("\n".join([names, *rows]) + end)
    return tables.read(path / "a.csv")


@pytest.mark.parametrize("last", ["0.3,1.", "0.3,1.8,-", "# stopped\n"])
def test_a_last_line_that_was_cut_off_is_left_out(tmp_path, last):
    found = table(tmp_path, [*ROWS, last], end="")
    np.testing.assert_array_equal(found["goal"], [1.5, 1.6, 1.7])
    (note,) = found.notes
    assert "last line" in note
    assert last.strip() in note


def test_a_line_that_was_cut_off_in_the_middle_is_said(tmp_path):
    with pytest.raises(FormatError, match="Expected 3 columns, got 2"):
        table(tmp_path, [ROWS[0], "0.1,1.", ROWS[2]])


def test_rows_that_are_there_again_are_left_out(tmp_path):
    found = table(tmp_path, [*ROWS[:2], *ROWS])
    np.testing.assert_array_equal(found["time"], [0, 0.1, 0.2])
    assert found.notes == ("2 rows are there again as they were, left out",)


def test_equal_rows_without_stamps_stay(tmp_path):
    found = table(tmp_path, ["1,1,1", "1,1,1", "2,1,1", "1,1,1", "1,1,1"])
    assert len(found["q"]) == 5
    assert found.notes == ()


@pytest.mark.parametrize(
    "stamps",
    [
        ("2025-11-28T03:20:00", "2025-11-28T03:20:00.01"),
        ("2025-11-28 03:20:00.5Z", "2025-11-28 03:20:00.51Z"),
        ("2025-11-28T23:59:59.995+01:00", "2025-11-29T00:00:00.005+01:00"),
    ],
)
def test_moments_as_text_are_seconds(tmp_path, stamps):
    rows = [f"{stamp},1,{stamp}" for stamp in (*stamps, "")]
    found = table(tmp_path, rows, names="time,q,command_time")
    np.testing.assert_allclose(found["time"], [0, 0.01, np.nan], atol=1e-9)
    np.testing.assert_allclose(found["command_time"], found["time"])


def test_moments_of_two_columns_have_one_zero(tmp_path):
    rows = ["2025-11-28T03:20:00.5,2025-11-28T03:20:00,1"]
    found = table(tmp_path, rows, names="time,command_time,q")
    assert (found["time"][0], found["command_time"][0]) == (0.5, 0.0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\n", "is empty"),
        ("time,q\n0,1\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
    ],
)
def test_what_is_no_text_of_a_table_is_said(tmp_path, content, said):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(FormatError, match=said):
        tables.read(tmp_path / "a.csv")


def test_time_that_goes_backwards_is_said_with_its_row():
    said = r"a\.csv: time goes backwards, from 12.5 in row 1 to 9 in row 2\. Sort the"
    with pytest.raises(FormatError, match=said):
        tables.forward(np.array([0, 12.5, 9]), "a.csv")
    tables.forward(np.array([0, 1, 1]), "a.csv")
