"""Robots told speed and turning rate, against answers that are known beforehand."""

import numpy as np
import pytest

from bns.gap import diagnose, store
from bns.gap.candidates import unicycle_rows
from bns.gap.models.unicycle import UnicycleModel
from bns.worlds.effects import registry
from bns.worlds.effects.command import TWIST
from bns.worlds.trial import Channel, Commands, Trial

UNITS = ("m/s", "rad/s")
CHANNELS = tuple(Channel(*item) for item in zip(TWIST, UNITS, strict=True))


def blank(told, seconds: float = 2.0) -> Trial:
    """A robot told pairs of speed and rate for so long each; nothing seen of it yet."""
    told = np.asarray(told, dtype=float)
    every = round(seconds / 0.1)
    times = np.arange(every * len(told) + 1) * 0.1
    return Trial(
        Commands(told, np.full(len(told), seconds), CHANNELS),
        times,
        np.zeros((len(times), 3)),
        np.arange(0, len(times), every),
        robot="irobot_create",
    )


def recorded(*texts: str, count: int = 6) -> list[Trial]:
    """What the model itself does under effects, with noise."""
    rng = np.random.default_rng(5)
    model, made = UnicycleModel(), []
    for _ in range(count):
        speeds, rates = rng.uniform(0, 0.3, 10), rng.uniform(-0.8, 0.8, 10)
        trial = blank(np.column_stack([speeds, rates]))
        ((seen,),) = model.simulate([trial], [[registry.parse(t) for t in texts]])
        noise = rng.normal(0, [1e-3, 1e-3, 5e-3], seen.shape)
        made.append(trial.replace(observed=seen + noise))
    return made


def test_every_row_is_an_explanation_and_makes_its_effect():
    model = UnicycleModel()
    rows = {row.name: row for row in model.rows([])}
    assert list(rows) == [row.name for row in unicycle_rows.rows()]
    for name, row in rows.items():
        value = row.levels[0] if row.levels else row.nominal + row.difference
        made = model.effect(row.term, {name: value})
        assert not made.is_nominal and row.excite and row.unit
        assert store.parse(str(made), model) == made


def test_rows_act_in_one_order_whichever_comes_first():
    values = {"turning_loss": 0.1, "command_gain[forward_speed]": 0.9}
    made = unicycle_rows.effects(values)
    assert [item.name for item in made] == ["command_gain", "turning_loss"]
    trial = blank([[0.2, 0.5]])
    ((path,),) = UnicycleModel().paths([trial], [[values]])
    ((same,),) = UnicycleModel().simulate([trial], [made])
    np.testing.assert_array_equal(path, same)


def test_a_loss_in_turns_makes_a_smaller_circle_of_the_same_turn():
    trial = blank([[0.2, 0.5]], seconds=2 * np.pi)  # half a turn of radius 0.4 m
    values = [[{}], [{"turning_loss": 0.1}]]
    (full,), (small,) = UnicycleModel().paths([trial], values)
    assert np.ptp(full[:, 1]) == pytest.approx(0.4 * (1 - np.cos(3.1)), abs=0.02)
    np.testing.assert_allclose(small[:, :2], 0.75 * full[:, :2], atol=1e-6)
    np.testing.assert_array_equal(small[:, 2], full[:, 2])


def test_a_marker_ahead_of_the_middle_goes_sideways_in_turns():
    trial = blank([[0.0, 0.5]])
    ((path,),) = UnicycleModel().paths([trial], [[{"marker_mount.dx": 0.1}]])
    turned = path[:, 2]
    np.testing.assert_allclose(path[:, 0], 0.1 * np.cos(turned), atol=1e-6)
    np.testing.assert_allclose(path[:, 1], 0.1 * np.sin(turned), atol=1e-6)


def test_a_loss_a_gain_and_a_delay_come_apart_with_their_shares():
    texts = (
        "command_gain:part=forward_speed,factor=1.06",
        "command_delay:part=all,delay=0.15",
        "turning_loss:loss=0.1",
    )
    found = diagnose.diagnose(recorded(*texts), UnicycleModel(), full=False)
    parts = {part["name"]: part for part in found.decomposition["parts"]}
    assert found.verdict.kind == "together"
    assert set(parts) == {
        "command_gain[forward_speed]",
        "command_delay[all]",
        "turning_loss",
    }
    values = {name: part["values"][name] for name, part in parts.items()}
    assert values["command_gain[forward_speed]"] == pytest.approx(1.06, abs=0.01)
    assert values["command_delay[all]"] == pytest.approx(0.15, abs=0.02)
    assert values["turning_loss"] == pytest.approx(0.1, abs=0.01)
    assert all(part["last"] > 0 for part in parts.values())


def test_a_robot_that_does_as_it_is_told_has_no_gap():
    found = diagnose.diagnose(recorded(), UnicycleModel(), full=False)
    assert found.verdict.kind == "no gap"
