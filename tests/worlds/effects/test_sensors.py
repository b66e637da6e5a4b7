"""Effects on light sensors: what each does, one by one and in a loop."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.worlds import registry as worlds
from bns.worlds.effects import registry
from bns.worlds.effects.base import CommandEffect, OpticsEffect, SensorEffect
from bns.worlds.light import law as light_law
from bns.worlds.light import sensors as light_sensors
from bns.worlds.light.law import LightField
from tests.worlds.effects import subjects
from tests.worlds.effects.subjects import DT, at_example, light, read
from tests.worlds.test_closed_loop import Replay

EVERY = [registry.get(name) for name in registry.names()]
EVERY = [kind for kind in EVERY if "wheeled" in kind.robots]
ON_READINGS = [kind.name for kind in EVERY if issubclass(kind, SensorEffect)]
ON_LIGHT = [kind.name for kind in EVERY if issubclass(kind, OpticsEffect)]
MEMORYLESS = [
    kind.name for kind in EVERY if issubclass(kind, CommandEffect) and kind.memoryless
]
OF_SENSORS = [
    kind.name
    for kind in EVERY
    if any(choice.name == "sensor" for choice in kind.choices)
]
NAMES = read().channels
SPIN = np.tile([-0.04, 0.04], (14, 1))  # on the spot
LEFT = [NAMES.index(f"ir_{name}") for name in ("left_90", "left_45", "front_left")]


def example(name, **values):
    """The effect at its example values, some replaced."""
    return registry.make(name, **{**at_example(registry.get(name)).values, **values})


def after(effect, readings=None, active=None):
    """Readings after an effect, shape (T, S)."""
    times, values, channels = read() if readings is None else readings
    active = np.ones(len(times), bool) if active is None else active
    return effect.apply(times, values, channels, active, np.random.default_rng(0))


@pytest.mark.parametrize("name", ON_READINGS)
def test_a_reading_depends_on_those_before_it_alone(name):
    """What makes a closed loop possible: it gets them one by one."""
    times, values, channels = read()
    whole = after(example(name))
    for count in (1, 2, 17):
        part = (times[:count], values[:count], channels)
        assert np.array_equal(after(example(name), part), whole[:count])


@pytest.mark.parametrize("name", MEMORYLESS)
def test_commands_one_at_a_time_are_changed_as_all_at_once(name):
    signal = subjects.told(("left_speed", "right_speed"))
    effect, rng = example(name), np.random.default_rng(0)
    assert not effect.random
    active = signal.times > 1.0
    whole = effect.apply(signal, active, rng)
    for number in (0, 3, 11):
        here = signal.command == number
        part = type(signal)(
            signal.times[here], signal.values[here], signal.command[here],
            signal.channels, DT,
        )  # fmt: skip
        assert np.array_equal(effect.apply(part, active[here], rng), whole[here])


@pytest.mark.parametrize("name", OF_SENSORS)
def test_only_the_named_sensors_are_touched(name):
    effect = example(name, sensor="left")
    if name in ON_LIGHT:
        old, new = light(), effect.change(light(), NAMES)
        moved = [key for key in old if not np.array_equal(old[key], new[key])]
        assert len(moved) == 1
        hit = np.flatnonzero(new[moved[0]] != old[moved[0]])
    else:
        hit = np.flatnonzero((after(effect) != read().values).any(axis=0))
    assert hit.tolist() == sorted(LEFT)


@pytest.mark.parametrize("name", ON_READINGS)
def test_readings_stay_in_the_converters_range(name):
    kind = registry.get(name)
    for end in ("low", "high"):
        values = {item.name: getattr(item, end) for item in kind.parameters}
        readings = after(kind(values))
        assert readings.min() >= 0 and readings.max() <= 4095


KNOWN = {
    "sensor_gain:factor=0.5": lambda x, t: x / 2,
    "sensor_gain:factor=4": lambda x, t: np.minimum(4 * x, 4095),
    "sensor_offset:counts=-500": lambda x, t: np.maximum(x - 500, 0),
    "sensor_stuck_min:blend=1": lambda x, t: 0 * x,
    "sensor_stuck_max:blend=1": lambda x, t: 0 * x + 4095,
    "sensor_saturation:level=1500": lambda x, t: np.maximum(x, 1500),
    "sensor_frozen:blend=1": lambda x, t: 0 * x + x[0],
    "sensor_drift:rate=-50": lambda x, t: np.maximum(x - 50 * t[:, None], 0),
}


@pytest.mark.parametrize("text", KNOWN)
def test_known_readings(text):
    times, values, _ = read()
    assert after(registry.parse(text)) == pytest.approx(KNOWN[text](values, times))


def test_every_third_reading_is_the_minimum():
    hit = (after(registry.parse("sensor_intermittent:every=3")) == 0).all(axis=1)
    assert np.flatnonzero(hit).tolist() == list(range(2, 40, 3))


def test_a_frozen_sensor_keeps_what_it_gave_before():
    active = np.arange(40) >= 10
    readings = after(registry.parse("sensor_frozen:blend=1"), active=active)
    assert (readings[10:] == read().values[9]).all()


def test_swapped_sensors_are_their_twins():
    readings, values = after(registry.parse("sensor_swapped:blend=1")), read().values
    left, right = NAMES.index("ir_front_left"), NAMES.index("ir_front_right")
    assert np.array_equal(readings[:, left], values[:, right])
    assert np.array_equal(readings[:, right], values[:, left])
    back = NAMES.index("ir_back")
    assert np.array_equal(readings[:, back], values[:, back])


def test_crosstalk_takes_a_share_from_the_neighbours():
    values = read().values
    at = NAMES.index("ir_left_45")
    beside = (values[:, at - 1] + values[:, at + 1]) / 2
    readings = after(registry.parse("sensor_crosstalk:share=0.2"))
    assert readings[:, at] == pytest.approx(0.8 * values[:, at] + 0.2 * beside)


def test_a_slow_sensor_covers_63_percent_of_a_step_in_its_time_constant():
    times, channels = np.arange(40) * 0.4, NAMES
    step = np.where(times[:, None] < 4.0, 3000.0, 1000.0) * np.ones(len(channels))
    readings = after(
        registry.parse("sensor_response_time:time_constant=2"), (times, step, channels)
    )
    at = np.flatnonzero(times >= 4.0)[0] - 1 + 5  # five readings of 0.4 s are 2 s
    assert readings[at, 0] == pytest.approx(1000 + 2000 * np.exp(-1), abs=1)


def lit(text=None, pose=(-0.9, 0.0, 0.0), times=0.0):
    """Readings without noise at a pose under an effect on the light."""
    sensors = light_sensors.of("khepera3")
    law = sensors.law(LightField())
    if text:
        law = registry.parse(text).change(law, sensors.names)
    seen = light_law.irradiance(law, np.array([pose]), times)
    return light_law.counts(law, seen)[0]


def test_effects_on_the_light_do_what_they_say():
    plain, side = lit(), NAMES.index("ir_left_45")
    assert (lit("sensor_dead:loss=1") == 4095).all()
    assert lit("light_displaced:x=-0.3")[side] == lit(pose=(-0.6, 0, 0))[side]
    dark, half = lit("light_dimmed:factor=0"), lit("light_dimmed:factor=0.5")
    assert (dark[side] - half[side]) == pytest.approx((dark - plain)[side] / 2, abs=1)
    room = 4095 * 0.1 / 0.86
    assert (plain - lit("light_ambient:added=0.1"))[side] == pytest.approx(room, abs=1)
    turned = lit("sensor_misaligned:angle=0.3,sensor=left_45")
    assert turned[side] == pytest.approx(lit(pose=(-0.9, 0, 0.3))[side], abs=60)
    assert (turned == plain).sum() == len(NAMES) - 1
    flicker = "light_flicker:depth=1,frequency=1"
    assert np.array_equal(lit(flicker, times=0.5), dark)
    assert np.array_equal(lit(flicker, times=1.0), plain)
    shadow = "light_shadow:loss=1,azimuth=3.1416,width=1"
    assert np.array_equal(lit(shadow), dark)
    assert np.array_equal(lit(shadow, pose=(0.9, 0, 0)), lit(pose=(0.9, 0, 0)))


def test_doubled_noise_doubles_the_scatter_and_leaves_saturation():
    sensors, rng = light_sensors.of("khepera3"), np.random.default_rng(1)
    noise = tuple(rng.standard_normal((2, 4000, 9)))
    scatter = {}
    for factor in (1, 2):
        law = sensors.law(LightField())
        law = registry.make("sensor_noise", factor=factor).change(law, NAMES)
        seen = light_law.irradiance(law, np.tile([-0.5, 0.0, 0.0], (4000, 1)))
        scatter[factor] = light_law.counts(law, seen, noise).std(axis=0)
    side, front = NAMES.index("ir_left_45"), NAMES.index("ir_front_left")
    assert scatter[2][side] == pytest.approx(2 * scatter[1][side], rel=0.02)
    assert scatter[1][front] == scatter[2][front] == 0


@pytest.mark.parametrize("name", ON_READINGS + ON_LIGHT)
def test_in_the_loop_it_acts_within_its_time_and_not_before(name):
    text = f"{example(name)}@0:1.9s..0:4.1s"
    starts = np.array([[0.8, 0.1, 0.0]])
    runs = [
        worlds.make("light", damage=damage, singles=True).drive(
            Replay(SPIN), cycles=14, seeds=[3], starts=starts
        )[0]
        for damage in ((), (text,))
    ]
    sound, hit = (trial.observed[trial.boundaries, 5:] for trial in runs)
    same = (sound == hit).all(axis=1)
    assert same[:5].all() and same[11:].all()
    assert not same[5:11].all()
    assert np.array_equal(*(trial.poses_world for trial in runs))
    assert name in runs[1].conditions["damage"][0]


def test_worlds_without_sensors_refuse_them():
    for world in ("mujoco", "static-snn"):
        with pytest.raises(BnsError, match=r"sensor_gain.* world 'light'"):
            worlds.make(world, damage=["sensor_gain:factor=0.5"])
