"""What the nominal motion of a user's own model takes: forces, contacts, travel."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from bns.gap.models.mjcf import prepared


class Loads(NamedTuple):
    """What the nominal motion takes.

    Attributes:
        forces: of each actuator that has a limit, over that, by name, ``(n,)``.
        touching: names of the geoms that touch something.
        travel: lowest and highest position of each hinge and slide, by name, ``(2,)``.
    """

    forces: Mapping[str, np.ndarray] = {}
    touching: frozenset[str] = frozenset()
    travel: Mapping[str, np.ndarray] = {}

    @classmethod
    def of(cls, model: mujoco.MjModel, moments: Iterable[mujoco.MjData]) -> "Loads":
        """Of moments of the nominal motion, each of which may overwrite the last.

        Args:
            model: the nominal model.
            moments: states with all quantities computed.
        """
        seen, touching = [], set[int]()
        places = []
        for data in moments:
            seen.append(np.abs(data.actuator_force))
            places.append(data.qpos.copy())
            touching |= set(data.contact.geom.ravel().tolist())
        went = np.array(places)
        most = np.abs(model.actuator_forcerange).max(axis=1)
        limited = np.flatnonzero(model.actuator_forcelimited).tolist()
        return cls(
            {
                model.actuator(number).name: np.array(seen)[:, number] / most[number]
                for number in limited
                if seen  # else it diverged at once
            },
            frozenset(model.geom(number).name for number in touching),
            {
                model.joint(number).name: np.array(
                    [went[:, at].min(), went[:, at].max()]
                )
                for number, at in enumerate(model.jnt_qposadr)
                if places and prepared.hinged(model, number)
            },
        )
