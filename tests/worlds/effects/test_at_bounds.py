"""An effect at its bound does what one just inside the bound does."""

import mujoco
import numpy as np
import pytest

from bns.worlds.effects import listing, registry
from bns.worlds.effects.base import ServoEffect
from tests.worlds.effects.subjects import compiled, on_part

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
    others = listing.example(kind).values
    for item in (item for item in kind.parameters if not item.integer):
        inwards = 1e-6 * (item.high - item.low)
        for bound, beside in ((item.low, inwards), (item.high, -inwards)):
            ends = [
                stepped(registry.make(name, **{**others, item.name: value}))
                for value in (bound, bound + beside)
            ]
            assert ends[0] == pytest.approx(ends[1], abs=5e-3), (item.name, bound)
