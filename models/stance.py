"""How a walking robot's model stands at rest, its servos half-way."""

from typing import Any, NamedTuple

import numpy as np

PATIENCE = 200.0  # [s] in which a robot comes to rest; dry friction lets it creep
LOOK = 1.0  # [s] over which it has to
STILL = 1e-6  # [m, rad] moved over that; slower = rests; assumed
UPRIGHT = 0.999  # cosine of half the angle that a robot that stands has turned; assumed


class Rest(NamedTuple):
    """What becomes of a robot that is put down.

    Attributes:
        qpos: its configuration at the end, as if it had not drifted.
        stands: whether it has come to rest, and upright.
        touching: geoms of its own that touch each other then.
    """

    qpos: np.ndarray
    stands: bool
    touching: tuple[tuple[str, str], ...]

    @property
    def height(self) -> float:
        """Of the base over the floor [m]."""
        return float(self.qpos[2])

    @property
    def bend(self) -> float:
        """By which the joint that yields most does [rad]."""
        return float(np.abs(self.qpos[7:]).max())


def at_rest(xml: str) -> Rest:
    """Put a robot on a floor in its `home` pose, with that pose's goals, and wait.

    Args:
        xml: the robot alone, its free joint first.
    """
    import mujoco

    spec = mujoco.MjSpec.from_string(xml)
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], contype=0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    still = False
    for _ in range(round(PATIENCE / LOOK)):
        before = data.qpos.copy()
        mujoco.mj_step(model, data, round(LOOK / model.opt.timestep))
        still = bool(np.abs(data.qpos - before).max() < STILL)
        if still or any(item.number for item in data.warning):
            break
    stands = still and bool(data.qpos[3] > UPRIGHT)
    return Rest(_straight(data.qpos), stands, _touching(model, data))


def _straight(qpos: np.ndarray) -> np.ndarray:
    """Without drift of place, heading and tilt, to a millionth."""
    made = np.round(qpos, 6) + 0.0  # -0 is 0
    made[[0, 1, 3, 4, 5, 6]] = [0, 0, 1, 0, 0, 0]
    return made


def _touching(model: Any, data: Any) -> tuple[tuple[str, str], ...]:
    floor = model.geom("floor").id
    return tuple(
        (model.geom(a).name, model.geom(b).name)
        for a, b in (contact.geom for contact in data.contact)
        if floor not in (a, b)
    )
