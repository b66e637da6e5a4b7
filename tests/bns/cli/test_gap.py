"""`bns gap`: what it says of a recording, and of wrong input."""

import numpy as np
import pytest

from bns.__main__ import main
from bns.worlds import registry
from bns.worlds.data import dataset
from bns.worlds.trial import Commands


@pytest.fixture
def recording(tmp_path):
    """Three short drives of an undamaged robot as a dataset."""
    world = registry.make("mujoco", robot="khepera3", threads=1)
    commands = [Commands(np.full((2, 2), 0.1), [0.4, 0.3 + 0.1 * i]) for i in range(3)]
    path = tmp_path / "drives"
    dataset.write(path, world.run(commands), provenance={"made by": "test"})
    return path


def test_check_says_how_many_trials_can_be_used(recording, capsys):
    assert main(["gap", "check", str(recording)]) == 0
    assert "3 trials can be used" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["gap", "chek", "x"], "Did you mean 'check'"),
        (["gap", "check", "nowhere"], "nowhere"),
        (["gap", "diagnose", "x", "--model", "khepera4"], "khepera"),
        (["gap", "check", "x", "--model", "robot.xml"], "TOML file that maps"),
        (["gap", "check", "x", "--importer", "xl33"], "Did you mean 'xl330'"),
        (["gap", "plan", "nowhere"], "bns gap diagnose DATA --out nowhere"),
        (["gap", "edit", "nowhere", "--remove", "a", "--predict", "b"], "nowhere"),
        (["gap", "apply", "nowhere", "--world", "kitchen"], "nowhere"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(words, said, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_an_existing_output_is_not_overwritten(recording, tmp_path, capsys):
    words = ["gap", "diagnose", str(recording), "--out", str(tmp_path)]
    assert main(words) == 2
    assert "not overwritten" in capsys.readouterr().err


def test_help_without_a_verb(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["gap"])
    assert "diagnose" in capsys.readouterr().out
