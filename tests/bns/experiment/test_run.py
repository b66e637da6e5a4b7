"""The run loop in memory: several configurations, a world of one's own."""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.experiment.config import AdaptationConfig, RunConfig, SnnConfig, WorldConfig
from bns.experiment.run import train, train_many
from bns.experiment.world_factory import make_world
from bns.worlds.trial import WHEEL_CHANNELS

LEFT = "wheel_gain:wheel=left,factor=0.5@1"
RIGHT = "wheel_gain:wheel=right,factor=0.5@2"
TINY = RunConfig(
    snn=SnnConfig(epochs=2), trials=3, replicates=2, evolve_from=9,
    compiled="no", threads=1,
)  # fmt: skip


def test_several_configurations_keep_their_own_damage_and_window():
    configs = [
        replace(
            TINY,
            adaptation=AdaptationConfig(window=window),
            world=WorldConfig(damage=(damage,)),
        )
        for window, damage in ((0, LEFT), (8, RIGHT))
    ]
    records = train_many(configs)
    assert [record.config for record in records] == configs
    left, right = records
    np.testing.assert_array_equal(left.damage_onset, [1, 1])
    np.testing.assert_array_equal(left["damaged"], [[0, 1, 1]] * 2)
    np.testing.assert_array_equal(right["damaged"], [[0, 0, 1]] * 2)
    assert right["patterns"].max() <= 8 < left["patterns"].max()
    # the damaged world executes what was sent with half a wheel
    for record, trial, sign in ((left, 1, 1), (right, 2, -1)):
        turned = record.poses[:, trial, 1, 2]
        speeds = record.sent[:, trial, 0]
        halved = speeds[:, :2] * ([0.5, 1.0] if sign > 0 else [1.0, 0.5])
        ideal = (halved[:, 1] - halved[:, 0]) * speeds[:, 2] / 0.0884
        np.testing.assert_allclose(turned, ideal, atol=0.25)


def test_configurations_that_cannot_share_a_batch():
    with pytest.raises(BnsError, match="differ"):
        train_many([TINY, replace(TINY, snn=SnnConfig(epochs=3))])


def test_a_world_of_ones_own_is_all_the_learner_needs():
    asked = []

    class Recorder:
        name, robot = "mine", "khepera3"
        inner = make_world(TINY)

        def run(self, commands, *, trial=0, seeds=()):
            asked.append((trial, len(commands), tuple(seeds)))
            assert commands[0].channels == WHEEL_CHANNELS
            return self.inner.run(commands, trial=trial, seeds=seeds)

    record = train(TINY, world=Recorder())
    np.testing.assert_array_equal(record.poses, train(TINY).poses)
    assert {trial for trial, _, _ in asked} == {0, 1, 2}
    assert len({seeds for _, _, seeds in asked}) == len(asked), "a seed used twice"
    assert {count for _, count, _ in asked} == {2}
