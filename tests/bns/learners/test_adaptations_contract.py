"""What every adaptation of the learner bns keeps to; a new one brings no new test."""

from dataclasses import replace

import pytest

from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.learners.bns import adaptation
from bns.learners.bns.adaptation import Adaptations
from bns.learners.bns.config import AdaptationConfig


@pytest.mark.parametrize("name", adaptation.names())
class TestEveryAdaptation:
    def test_says_what_it_is(self, name):
        assert len(adaptation.describe(name)) > 20

    def test_resets_known_parts_and_is_deterministic(self, name):
        extra = adaptation.parse(name)
        seen = [extra.resets(t, onset) for t in range(60) for onset in (-1, 30)]
        again = [extra.resets(t, onset) for t in range(60) for onset in (-1, 30)]
        assert seen == again
        assert any(seen)
        assert all(part in adaptation.PARTS for parts in seen for part in parts)

    def test_acts_on_its_own_run_only(self, name):
        config = RunConfig()
        mine = replace(config, adaptation=AdaptationConfig(extra=(name,)))
        made = Adaptations([mine, config], [30, 30])
        resets = [made.resets(trial) for trial in range(60)]
        parts = [(r.population, r.simulator, r.data) for r in resets]
        assert any(part[0] for three in parts for part in three)
        assert not any(part[1] for three in parts for part in three)

    def test_unknown_parameter_is_refused(self, name):
        with pytest.raises(UnknownNameError, match=f"parameter of {name}"):
            adaptation.parse(f"{name}:nonsense=1")


def test_population_reset_every():
    extra = adaptation.parse("population_reset_every:trials=7")
    assert [t for t in range(22) if extra.resets(t, -1)] == [7, 14, 21]


def test_bad_text_is_refused():
    with pytest.raises(UnknownNameError, match="Unknown adaptation"):
        adaptation.parse("population_reset_evry")
    with pytest.raises(BnsError, match="positive number"):
        adaptation.parse("population_reset_every:trials=nan")
