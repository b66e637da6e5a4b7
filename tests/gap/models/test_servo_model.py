"""The servo as a model of the general diagnosis."""

import numpy as np
import pytest

from bns.errors import BnsError, UnknownNameError
from bns.gap import diagnose
from bns.gap.models import base
from bns.gap.models.servo.model import ServoModel, angles_only
from bns.gap.recordings import load_recordings
from bns.worlds.effects import registry
from bns.worlds.trial import Channel, Commands, Trial

CHANNELS = (Channel("angle", "rad"), Channel("voltage", "V"))


def trial(seed: int = 0, *, seconds: float = 2.0) -> Trial:
    """A servo at rest that is told to sweep; nothing seen of it yet."""
    times = np.arange(round(seconds / 0.01) + 1) * 0.01
    rng = np.random.default_rng(seed)
    rate, size = rng.uniform(0.4, 0.8), rng.uniform(0.5, 1.0)
    goals = size * np.sin(2 * np.pi * rate * times)
    told = np.stack([goals, np.ones_like(goals)], axis=1)[:-1]
    channels = (Channel("goal", "rad"), Channel("torque_on", "1"))
    return Trial(
        Commands(told, np.full(len(told), 0.01), channels),
        times,
        np.stack([0 * times, 12.0 + 0 * times], axis=1),
        np.arange(len(times)),
        channels=CHANNELS,
        robot="servo_pendulum",
        conditions={"mass": 0.6 + 0.1 * seed, "lever": 0.12, "gain": 12.0},
    )


def recorded(effect: str, count: int = 4) -> list[Trial]:
    """What the model itself does under an effect, with a little noise."""
    blank = [trial(seed) for seed in range(count)]
    (seen,) = ServoModel().simulate(blank, [[registry.parse(effect)]])
    rng = np.random.default_rng(9)
    return [
        angles_only(t.replace(observed=s + [[1, 0]] * rng.normal(0, 1e-3, (len(s), 1))))
        for t, s in zip(blank, seen, strict=True)
    ]


def test_it_is_such_a_model():
    made: base.GapModel = ServoModel()
    names = [row.name for row in made.rows(())]
    assert len(names) == len(set(names)) >= 13
    assert all(row.excite and row.unit for row in made.rows(()))
    assert len(made.process) == len(made.features) == 1
    assert len(made.resolution) == len(made.channels)


def test_predictions_keep_the_samples_and_the_other_channels():
    made, trials = ServoModel(), [trial(0), trial(1, seconds=1.5)]
    effect = registry.parse("servo_payload:mass=0.5")
    nominal, again, heavier = made.simulate(trials, [(), (), [effect]])
    for told, one, same, other in zip(trials, nominal, again, heavier, strict=True):
        assert one.shape == told.observed.shape
        assert one.tobytes() == same.tobytes()
        assert (one[:, 1] == 12.0).all() and one[0, 0] == 0.0
        assert np.abs(one[:, 0] - other[:, 0]).max() > 0.01
    batched = made.simulate(trials[:1], [()])[0][0]
    np.testing.assert_array_equal(batched, nominal[0])


def test_commands_are_those_of_their_time_however_few_samples_are_kept():
    made, whole = ServoModel(), trial(0)
    few = load_recordings.thinned(whole, most=20)
    assert len(few.times) < len(few.commands)
    ((all_of_it,),) = made.simulate([whole], [()])
    ((some,),) = made.simulate([few], [()])
    at = np.searchsorted(whole.times, few.times)
    np.testing.assert_array_equal(some[:, 0], all_of_it[at, 0])


def test_the_law_is_that_of_the_servo_that_was_recorded():
    made, sts = ServoModel(), trial(0)
    other = sts.replace(conditions={**sts.conditions, "servo": "xl330"})
    ((one,),), ((two,),) = (made.simulate([t], [()]) for t in (sts, other))
    assert np.abs(one[:, 0] - two[:, 0]).max() > 0.1
    unknown = sts.replace(conditions={**sts.conditions, "servo": "mx1"})
    with pytest.raises(UnknownNameError, match="mx1"):
        made.simulate([unknown], [()])
    with pytest.raises(BnsError, match="several servos"):
        made.simulate([other, unknown], [()])


def test_windows_tile_what_was_seen_and_compare_angles():
    told = trial()
    observed = told.observed.copy()
    observed[50:53, 0] = np.nan
    lossy = told.replace(observed=observed)
    found = ServoModel().windows(lossy)
    assert (found.first[1:] == found.last[:-1]).all()
    assert np.isfinite(lossy.channel("angle")[found.last]).all()
    assert np.median(found.durations) == pytest.approx(0.1)
    both = np.stack([lossy.observed, lossy.observed + 1])
    values = ServoModel().compare(lossy, both, found)
    assert values.shape == (2, len(found), 1)
    assert (values[0, :, 0] == lossy.channel("angle")[found.last]).all()
    for words, row in ServoModel().regime(told, found).items():
        assert row.shape == (len(found),) and np.isfinite(row).all(), words
    (predicted,) = ServoModel().simulate([lossy], [()])
    assert np.isfinite(predicted[0]).all()


@pytest.mark.parametrize(
    "effect, name", [("servo_payload:mass=0.3", "servo_payload"), ("servo_delay", "")]
)
def test_the_general_diagnosis_runs_on_it(effect, name):
    some = ("servo_payload", "servo_delay", "servo_coulomb")
    servo = ServoModel(process=(0.002,))
    found = diagnose.diagnose(recorded(effect), servo, rows=some, full=False)
    if not name:
        assert found.verdict.kind == "no gap"
        return
    assert found.verdict.kind == "effect" and found.verdict.named == ((name,),)
    assert found.best.magnitudes[0] == pytest.approx(0.3, rel=0.05)


def test_a_trial_that_is_too_short_is_refused():
    short = trial(seconds=0.01)
    with pytest.raises(BnsError, match="shorter than two hundredths"):
        ServoModel().simulate([short], [()])
