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
