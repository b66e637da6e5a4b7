"""Worlds kept by name: found, listed, run; their effects act."""

import numpy as np
import pytest

from bns.cli.run import expanded
from bns.errors import BnsError, FormatError, UnknownNameError
from bns.experiment.config import RunConfig, WorldConfig
from bns.worlds import corrected, registry
from bns.worlds.corrected import Corrected
from bns.worlds.trial import Commands

GAIN = "wheel_gain:wheel=left,factor=0.5"


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """One world, kept in a file of its own."""
    monkeypatch.setenv(corrected.VARIABLE, str(tmp_path / "worlds.toml"))
    world = Corrected("kitchen", "mujoco", "khepera3", (GAIN,), "a test")
    corrected.keep(world)
    return world


def test_it_is_found_listed_and_its_effect_acts(kept):
    assert "kitchen" in registry.names()
    assert registry.describe()["kitchen"] == f"mujoco with {GAIN} (a test)"
    told = [Commands(np.full((1, 2), 0.1), [1.0])]
    (here,) = registry.make("kitchen", threads=1).run(told)
    (same,) = registry.make("mujoco", reality=[GAIN], threads=1).run(told)
    np.testing.assert_array_equal(here.observed, same.observed)
    assert here.world == "kitchen"
    more = registry.make("kitchen", reality=["payload:mass=0.5"], threads=1)
    assert len(more.reality.events) == 2


def test_a_run_writes_it_out(kept):
    given = RunConfig(world=WorldConfig(name="kitchen", reality=("payload:mass=0.2",)))
    world = expanded(given).world
    assert (world.name, world.reality) == ("mujoco", (GAIN, "payload:mass=0.2"))
    assert expanded(RunConfig()) == RunConfig()


def test_wrong_use_is_refused(kept, tmp_path):
    with pytest.raises(BnsError, match="give another or --replace"):
        corrected.keep(kept)
    corrected.keep(kept, replace=True)
    with pytest.raises(BnsError, match="can not name a world"):
        corrected.keep(Corrected("my world", "mujoco", "khepera3", ()))
    with pytest.raises(BnsError, match="not 'servo_pendulum'"):
        registry.make("kitchen", robot="servo_pendulum")
    (tmp_path / "worlds.toml").write_text("[worlds.a]\nreality = 3\n")
    with pytest.raises(FormatError, match="a list of effects"):
        registry.names()


def test_one_that_is_kept_elsewhere_is_pointed_to(tmp_path, monkeypatch):
    monkeypatch.delenv(corrected.VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    near = tmp_path / "above" / "near"
    there, here = near / "there", near / "here"
    for place in (there, here):
        place.mkdir(parents=True)
    monkeypatch.chdir(there)
    corrected.keep(Corrected("kitchen", "mujoco", "khepera3", (GAIN,)))
    monkeypatch.chdir(here)
    with pytest.raises(BnsError, match="--user") as caught:
        registry.make("kitchen")
    assert str(there / "worlds.toml") in str(caught.value)
    with pytest.raises(UnknownNameError, match="--user: everywhere"):
        registry.make("cellar")
    (there / "worlds.toml").write_text("broken")
    with pytest.raises(UnknownNameError):
        registry.make("kitchen")


def test_the_nearer_file_wins(tmp_path, monkeypatch):
    monkeypatch.delenv(corrected.VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    for user in (True, False):
        robot = "khepera3" if user else "servo_pendulum"
        corrected.keep(Corrected("a", "mujoco", robot, ()), user=user)
    assert corrected.known()["a"].robot == "servo_pendulum"
    assert (tmp_path / "home" / "bns" / "worlds.toml").is_file()


def test_worlds_that_nobody_keeps_do_not_read_what_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv(corrected.VARIABLE, str(tmp_path / corrected.FILE))
    corrected.keep(corrected.Corrected("den", "light", "khepera3", ()))
    assert registry.lacking("den", ["lights", "nets"]) == ["nets"]
    (tmp_path / corrected.FILE).write_text("not TOML")
    assert registry.lacking("mujoco", ["lights"]) == ["lights"]
    assert registry.make("mujoco").name == "mujoco"
