"""What every effect must keep to; a new effect is tested by being there."""

import re

import mujoco
import numpy as np
import pytest

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.models.legs import JOINTS
from bns.worlds.effects import registry
from bns.worlds.effects.base import (
    STAGES,
    ControlSignal,
    OpticsEffect,
    PoseSignal,
    SensorEffect,
    ServoEffect,
)
from bns.worlds.effects.parts import Part
from bns.worlds.physics import servo_law
from tests.worlds.effects.subjects import (
    DT,
    STEPS,
    as_bytes,
    at_example,
    bare,
    compiled,
    frozen,
    light,
    on_part,
    read,
    signal_of,
    told,
    wheel_fields,
)

NAMES = registry.names()
SERVO = [name for name in NAMES if issubclass(registry.get(name), ServoEffect)]
OPTICS = [name for name in NAMES if issubclass(registry.get(name), OpticsEffect)]
ON_SIGNALS = [name for name in NAMES if name not in (*SERVO, *OPTICS)]
IN_TIME = [name for name in ON_SIGNALS if registry.get(name).stage != "body"]
OF_WHEELS = [
    name
    for name in NAMES
    if any(choice.name == "wheel" for choice in registry.get(name).choices)
]
LASTING = {"clock_drift"}  # what a clock has gained stays when the drift ends
SAMPLES = 31
FILES = {  # in which the effects of a stage stand
    "command": ("command", "channels", "legs", "servo"),
    "actuator": ("wheels", "servo"),
    "body": (
        "joints",
        "actuators",
        "tendons",
        "links",
        "surfaces",
        "wheels",
        "legs",
        "servo",
        "clock",
        "fluid",
    ),
    "sensor": ("sensors", "channels", "light", "servo"),
    "tracking": ("tracking",),
}


@pytest.fixture
def control() -> dict[bool, ControlSignal]:
    """By whether the robot has legs."""
    return {False: told(("left_speed", "right_speed")), True: told(JOINTS)}


@pytest.fixture
def track() -> PoseSignal:
    """A smooth random path, sampled every 0.1 s; read-only."""
    rng = np.random.default_rng(2)
    fine_times = np.arange(STEPS + 1) * DT
    fine_poses = np.cumsum(rng.normal(0.001, 0.001, (STEPS + 1, 3)), axis=0)
    every = STEPS // (SAMPLES - 1)
    return PoseSignal(
        times=frozen(fine_times[::every]),
        poses=frozen(fine_poses[::every]),
        fine_times=frozen(fine_times),
        fine_poses=frozen(fine_poses),
    )


@pytest.fixture
def signals(control, track) -> dict:
    return {
        "command": control,
        "actuator": control,
        "sensor": read(),
        "tracking": track,
    }


def length(signals, effect) -> int:
    return len(signal_of(signals, effect).times)


def after(effect, signals, *, active=None, seed=0) -> tuple[np.ndarray, ...]:
    """The arrays that the effect makes of the signal of its stage."""
    signal = signal_of(signals, effect)
    active = np.ones(len(signal.times), bool) if active is None else active
    given = tuple(signal) if isinstance(effect, SensorEffect) else (signal,)
    result = effect.apply(*given, active, np.random.default_rng(seed))
    return result if isinstance(result, tuple) else (result,)


def before(effect, signals) -> tuple[np.ndarray, ...]:
    signal = signal_of(signals, effect)
    tracking = effect.stage == "tracking"
    return (signal.times, signal.poses) if tracking else (signal.values,)


def same(some, others) -> bool:
    return all(a.tobytes() == b.tobytes() for a, b in zip(some, others, strict=True))


def servo_numbers() -> dict[str, np.ndarray]:
    """A law of three runs and two candidates, every number well inside its bounds."""
    return servo_law.law(
        {
            name: np.full((3, 2), (item.low + 3 * item.high) / 4)
            for name, item in servo_law.NUMBERS.items()
        }
    )


def lawful(effect) -> tuple[dict, dict] | None:
    """The law that an effect changes, before and after; None = it changes no law."""
    if isinstance(effect, ServoEffect):
        return servo_numbers(), effect.change(servo_numbers())
    if isinstance(effect, OpticsEffect):
        return light(), effect.change(light(), read().channels)
    return None


def unchanged(effect, signals) -> bool:
    if laws := lawful(effect):
        return same(laws[0].values(), laws[1].values())
    if effect.stage == "body":
        return as_bytes(compiled(effect)) == as_bytes(bare(effect))
    return same(after(effect, signals), before(effect, signals))


@pytest.mark.parametrize("name", NAMES)
class TestEveryEffect:
    def test_says_what_it_is(self, name):
        effect = registry.get(name)
        assert effect.__module__.split(".")[3] in FILES[effect.stage]
        assert effect.stage in STAGES
        assert effect.doc and "\n" not in effect.doc
        assert (effect.__doc__ or "").partition("\n")[0].endswith(".")
        assert effect.source and effect.robots and effect.parameters
        for item in effect.parameters:
            assert item.unit and item.doc
            assert item.low <= item.nominal <= item.high
            assert item.check(name, item.example) == item.example
        assert any(item.scales for item in effect.parameters)

    def test_nominal_changes_nothing_bit_for_bit(self, name, signals):
        assert registry.make(name).is_nominal
        assert unchanged(registry.make(name), signals)

    def test_severity_zero_is_nominal_and_one_is_the_effect(self, name, signals):
        effect = at_example(registry.get(name))
        assert effect.scaled(1) == effect
        assert effect.scaled(0).is_nominal
        assert unchanged(effect.scaled(0), signals)
        with pytest.raises(BnsError, match=r"severity = 1\.5 .* 0 to 1"):
            effect.scaled(1.5)

    def test_example_changes_something(self, name, signals):
        effect = at_example(registry.get(name))
        assert not effect.is_nominal
        assert not unchanged(effect, signals)

    def test_bounds_hold(self, name):
        for item in registry.get(name).parameters:
            reach = item.high - item.low
            for bad in (item.low - reach, item.high + reach, float("nan"), "much"):
                with pytest.raises(OutOfBoundsError) as caught:
                    registry.make(name, **{item.name: bad})
                message = str(caught.value)
                assert f"{name}:{item.name} = {bad}" in message
                low, high = (
                    f"{bound}" if isinstance(bound, int) else f"{bound:g}"
                    for bound in (item.low, item.high)
                )
                assert f"from {low} to {high}" in message
                assert " 1, whole" not in message
                assert item.unit in message or item.unit == "1"

    def test_unknown_parameters_and_options_are_refused(self, name):
        with pytest.raises(UnknownNameError, match=f"parameter of {name} 'strenght'"):
            registry.make(name, strenght=1)
        for choice in registry.get(name).choices:
            if isinstance(choice, Part):
                continue  # known when there is a model
            with pytest.raises(UnknownNameError, match=choice.options[0]):
                registry.make(name, **{choice.name: "nowhere"})

    @pytest.mark.parametrize("part", ["nowhere", "no*"])
    def test_unknown_parts_are_refused_where_they_are_looked_for(
        self, name, part, signals
    ):
        if not on_part(registry.get(name)):
            return
        values = at_example(registry.get(name)).values | {"part": part}
        with pytest.raises(UnknownNameError, match=re.escape(part)):
            unchanged(registry.make(name, **values), signals)

    def test_text_and_table_read_back(self, name):
        rng = np.random.default_rng(3)
        kind = registry.get(name)
        for _ in range(20):
            values = {p.name: rng.uniform(p.low, p.high) for p in kind.parameters}
            for item in kind.parameters:
                if item.integer:
                    values[item.name] = round(values[item.name])
            values |= {c.name: str(rng.choice(c.options)) for c in kind.choices}
            effect = kind(values)
            assert registry.parse(str(effect)) == effect
            assert registry.from_table({"effect": name, **effect.values}) == effect

    def test_same_seed_same_bytes(self, name, signals):
        effect = at_example(registry.get(name))
        if laws := lawful(effect):
            assert same(laws[1].values(), lawful(effect)[1].values())
            assert not effect.random
            return
        if effect.stage == "body":
            assert as_bytes(compiled(effect)) == as_bytes(compiled(effect))
            return
        first = after(effect, signals, seed=7)
        assert same(first, after(effect, signals, seed=7))
        assert same(first, after(effect, signals, seed=8)) != effect.random


@pytest.mark.parametrize("name", IN_TIME)
class TestEffectsOnSignals:
    def test_nothing_changes_while_off(self, name, signals):
        effect = at_example(registry.get(name))
        count = length(signals, effect)
        active = np.zeros(count, bool)
        active[count // 3 : 2 * count // 3] = True
        off = ~active
        if name in LASTING:
            off[2 * count // 3 :] = False
        for new, old in zip(
            after(effect, signals, active=active), before(effect, signals), strict=True
        ):
            assert new[off].tobytes() == old[off].tobytes()
        assert not same(after(effect, signals, active=active), before(effect, signals))

    def test_result_is_its_own_memory_and_shape(self, name, signals):
        for effect in (registry.make(name), at_example(registry.get(name))):
            for new, old in zip(
                after(effect, signals), before(effect, signals), strict=True
            ):
                assert not np.shares_memory(new, old)
                assert new.shape == old.shape and new.dtype == np.float64

    def test_time_does_not_go_backwards(self, name, signals):
        effect = at_example(registry.get(name))
        if effect.stage == "tracking":
            times, _ = after(effect, signals)
            assert (np.diff(times) >= 0).all()


@pytest.mark.parametrize("name", OF_WHEELS)
@pytest.mark.parametrize("wheel, other", [("left", "right"), ("right", "left")])
def test_only_the_named_wheel_is_touched(name, wheel, other, signals):
    example = at_example(registry.get(name))
    effect = registry.make(name, **{**example.values, "wheel": wheel})
    if effect.stage == "body":
        old, new = wheel_fields(bare(effect)), wheel_fields(compiled(effect))
        assert old[other] == new[other]
        assert old[wheel] != new[wheel]
        return
    signal = signal_of(signals, effect)
    ((new,), (old,)) = after(effect, signals), before(effect, signals)
    kept, moved = signal.column(f"{other}_speed"), signal.column(f"{wheel}_speed")
    assert new[:, kept].tobytes() == old[:, kept].tobytes()
    assert new[:, moved].tobytes() != old[:, moved].tobytes()


@pytest.mark.parametrize(
    "name", [name for name in ON_SIGNALS if registry.get(name).stage == "body"]
)
def test_body_effects_keep_the_sizes_and_the_physics_sound(name):
    model = compiled(at_example(registry.get(name)))
    kind = registry.get(name)
    if not kind.resizes:
        assert len(as_bytes(model)) == len(as_bytes(bare(kind)))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    data.ctrl[:] = 0.2 if model.nkey else 3.0  # [rad], [rad/s]
    mujoco.mj_step(model, data, nstep=200)
    assert np.isfinite(data.qpos).all()
    assert not any(warning.number for warning in data.warning)


@pytest.mark.parametrize("name", SERVO)
def test_servo_effects_change_one_number_and_keep_it_in_bounds(name):
    law, kind = servo_numbers(), registry.get(name)
    changed = at_example(kind).change(law)
    assert list(changed) == list(law)
    assert sum(not np.array_equal(changed[key], law[key]) for key in law) == 1
    for item in kind.parameters:
        for value in (item.low, item.high):
            servo_law.law(registry.make(name, **{item.name: value}).change(law))


ON_BODY = [
    name
    for name in registry.names()
    if registry.get(name).stage == "body"
    and not issubclass(registry.get(name), ServoEffect)
    and not on_part(registry.get(name))  # their bounds hold for models of any size
]


def stepped(effect) -> np.ndarray:
    """Where a robot with the effect is after 0.4 s of driving [m]."""
    model = compiled(effect)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = 0.2 if model.nkey else 3.0  # [rad], [rad/s]
    mujoco.mj_step(model, data, nstep=round(0.4 / model.opt.timestep))
    return data.qpos[:3].copy()


@pytest.mark.parametrize("name", ON_BODY)
def test_body_effects_do_not_jump_at_their_bounds(name):
    kind = registry.get(name)
    others = at_example(kind).values
    for item in (item for item in kind.parameters if not item.integer):
        inwards = 1e-6 * (item.high - item.low)
        for bound, beside in ((item.low, inwards), (item.high, -inwards)):
            ends = [
                stepped(registry.make(name, **{**others, item.name: value}))
                for value in (bound, bound + beside)
            ]
            assert ends[0] == pytest.approx(ends[1], abs=5e-3), (item.name, bound)


def test_unknown_effect_gets_a_suggestion():
    with pytest.raises(UnknownNameError, match="Did you mean 'wheel_gain'"):
        registry.get("wheel_gian")


def test_a_piece_without_equals_belongs_to_the_value_before_it():
    with pytest.raises(UnknownNameError, match="'left,right'"):
        registry.parse("wheel_gain:wheel=left,right,factor=0.8")


@pytest.mark.parametrize("rest", ["", "0.8", "=1", "factor=1,,", "factor=1,factor=0.5"])
def test_bad_text_is_refused_with_an_example(rest):
    with pytest.raises(BnsError, match=re.escape(registry.EXAMPLE)):
        registry.parse(f"wheel_gain:{rest}")


def test_a_table_without_a_name_is_refused():
    with pytest.raises(BnsError, match="has no name"):
        registry.from_table({"factor": 0.8})
