"""What effects are tried on: signals and models of a robot that can have them."""

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from bns import models
from bns.worlds.effects import registry
from bns.worlds.effects.base import ControlSignal
from bns.worlds.effects.command import TWIST
from bns.worlds.effects.parts import Part
from bns.worlds.light import sensors
from bns.worlds.light.law import Lamp, LightField

ROVER = (Path(__file__).parent / "rover.xml").read_text()
ARM = (Path(__file__).parent / "arm.xml").read_text()
STEPS, DT = 600, 0.005
LEGGED = ("legged",)  # robots of effects that need legs
OF_TWIST = {"turning_loss"}  # effects on a forward speed and a turning rate


def at_example(effect):
    """An effect with the example value of every parameter of its class."""
    return effect({item.name: item.example for item in effect.parameters})


def frozen(array) -> np.ndarray:
    array = np.array(array)
    array.setflags(write=False)
    return array


def told(channels: tuple[str, ...]) -> ControlSignal:
    """Twelve random commands of 40 to 49 steps, then rest; read-only."""
    rng = np.random.default_rng(1)
    command = np.repeat(np.arange(12), rng.integers(40, 50, 12))
    command = np.concatenate([command, -np.ones(STEPS - len(command), dtype=int)])
    size = len(channels)
    speeds = np.concatenate([rng.uniform(-0.12, 0.12, (12, size)), np.zeros((1, size))])
    return ControlSignal(
        times=frozen(np.arange(STEPS) * DT),
        values=frozen(speeds[command]),
        command=frozen(command),
        channels=channels,
        dt=DT,
    )


class Readings(NamedTuple):
    """What sensor effects act on."""

    times: np.ndarray
    values: np.ndarray
    channels: tuple[str, ...]


def read() -> Readings:
    """Forty random readings of each light sensor of a Khepera; read-only."""
    names = sensors.of("khepera3").names
    values = np.random.default_rng(4).integers(200, 4000, (40, len(names)))
    return Readings(
        times=frozen(np.arange(40) * 0.4), values=frozen(values * 1.0), channels=names
    )


def light() -> dict[str, np.ndarray]:
    """The law of light in an arena with two lamps, read-only."""
    field = LightField((Lamp(), Lamp(x=0.5, y=0.3, power=4.0)))
    law = sensors.of("khepera3").law(field)
    return {name: frozen(values) for name, values in law.items()}


def signal_of(signals, effect):
    """The signal of an effect's stage, for a robot that can have the effect."""
    if effect.name in OF_TWIST:
        return told(TWIST)
    found = signals[effect.stage]
    return found[effect.robots == LEGGED] if isinstance(found, dict) else found


def bare(kind) -> mujoco.MjModel:
    """The model that effects of a kind are tried on, unchanged."""
    return _spec(kind).compile()


def _spec(kind):
    if kind.robots == LEGGED:
        return models.spec("phantomx")
    return mujoco.MjSpec.from_string(ARM if on_part(kind) else ROVER)


def on_part(kind) -> bool:
    """Whether an effect acts on a part that it names, of any model."""
    return any(isinstance(item, Part) for item in kind.choices)


def edited(spec, *effects) -> mujoco.MjModel:
    """A model compiled after effects, given as text or as objects."""
    for effect in effects:
        (registry.parse(effect) if isinstance(effect, str) else effect).edit(spec)
    return spec.compile()


def compiled(effect) -> mujoco.MjModel:
    return edited(_spec(effect), effect)


def as_bytes(model) -> bytes:
    """Every field of a model."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def wheel_fields(model) -> dict[str, dict[str, bytes]]:
    """Per wheel, every given (not derived) field of its elements."""
    derived = ("invweight0", "M0", "acc0", "subtreemass")
    fields = {}
    for side in ("left", "right"):
        body = model.body(f"{side}_wheel").id
        joint = model.joint(f"{side}_wheel_joint")
        index = {
            "body": body,
            "geom": model.body_geomadr[body],
            "jnt": joint.id,
            "dof": joint.dofadr[0],
            "actuator": model.actuator(f"{side}_wheel").id,
        }
        fields[side] = {
            key: getattr(model, key)[index[key.partition("_")[0]]].tobytes()
            for key in dir(model)
            if key.partition("_")[0] in index
            and isinstance(getattr(model, key), np.ndarray)
            and not key.endswith(derived)
        }
    return fields


def built(*texts, xml=ARM, gravity=True) -> mujoco.MjModel:
    """The arm, or another model, with effects given as text."""
    spec = mujoco.MjSpec.from_string(xml)
    if not gravity:
        spec.option.gravity = [0, 0, 0]
    return edited(spec, *texts)


def at_rest(model, ctrl=(0.5, 0.3), seconds=4.0) -> mujoco.MjData:
    """After servos have been told angles [rad] for a while."""
    data = mujoco.MjData(model)
    data.ctrl[: len(ctrl)] = ctrl[: model.nu]
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    return data
