"""What every learner of bns/learners keeps to; a new one brings no new test."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import UnknownNameError
from bns.experiment.config import AdaptationConfig
from bns.experiment.run import train
from bns.learners import registry
from bns.storage import store

PRESETS = {presets.load(name).learner: name for name in presets.names()}


def small(name: str):
    """A preset of a learner, cut down to a second."""
    config = presets.load(PRESETS[name])
    return replace(
        config,
        evolution=replace(config.evolution, population=12, generations=2, tournament=3),
        snn=replace(config.snn, epochs=4),
        trials=2,
        replicates=2,
        record_replicates=1,
        compiled="no",
        threads=1,
    )


@pytest.mark.parametrize("name", registry.names())
class TestEveryLearner:
    def test_says_what_it_is(self, name):
        assert len(registry.describe(name)) > 20

    def test_has_a_preset(self, name):
        assert name in PRESETS

    def test_same_seed_same_figures_and_all_of_it_is_stored(self, name, tmp_path):
        first = train(small(name), tmp_path / "run")
        again = train(small(name))
        assert first.columns
        for column in first.columns:
            np.testing.assert_array_equal(first[column], again[column])
        read = store.load(tmp_path / "run")
        assert set(read.extra) == set(first.extra)
        for array in read.extra:
            np.testing.assert_array_equal(read.extra[array], first.extra[array])

    def test_what_a_run_resets_moves_no_draw_of_the_others(self, name):
        config = replace(small(name), evolve_from=0)
        resets = replace(config, adaptation=AdaptationConfig(restart=True))
        told = {"replicates": [0, 1], "onsets": [0, 0]}
        sound, mine = (
            registry.get(name).make([config, side], **told) for side in (config, resets)
        )
        for trial in range(3):
            sound.propose(trial)
            mine.propose(trial)
        one, other = (made.population.genes.numpy() for made in (sound, mine))
        half = len(one) // 2
        np.testing.assert_array_equal(one[:half], other[:half])
        assert not np.array_equal(one[half:], other[half:])


def test_unknown_learner_is_refused():
    with pytest.raises(UnknownNameError, match="learner"):
        train(replace(small("navigation"), learner="navigaton"))
