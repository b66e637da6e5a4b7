"""Every example is short and runs with `--quick`."""

import pytest

from tests.sources import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 6


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_runs(path, run_python):
    assert len(path.read_text().splitlines()) < 100
    output = run_python(path, "--quick")
    assert output.strip(), "an example says what it found"


def test_examples_come_with_the_package(run_python, tmp_path):
    listed = run_python("-m", "bns", "examples")
    assert all(path.stem in listed for path in EXAMPLES)
    shown = run_python("-m", "bns", "examples", "01_drive_a_robot")
    assert shown == (ROOT / "examples" / "01_drive_a_robot.py").read_text()
    wrong = run_python("-m", "bns", "examples", "01_drive_robot", code=2)
    assert "Did you mean '01_drive_a_robot'?" in wrong
    run_python("-m", "bns", "examples", "--copy", tmp_path / "mine")
    assert (tmp_path / "mine" / "burger" / "robot.toml").is_file()
    again = run_python("-m", "bns", "examples", "--copy", tmp_path / "mine", code=2)
    assert "is not overwritten" in again
