"""Parts of a robot that move apart, as legs on a stand or two arms on a table do.

What is off on one of them changes nothing of the others. So one simulation tells of a
number on each, and what was simulated of one goes with whatever the others do.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco

from bns.gap.models.mjcf import effects as own_effects
from bns.gap.models.mjcf import prepared, start, view
from bns.gap.models.mjcf.config import OwnConfig
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial


class Piece(NamedTuple):
    """What one tree needs of a simulation.

    Attributes:
        columns: observed channels that it moves.
        local: effects on it, before each of those on all trees and after the last.
        state: of the trial's start, by joint of it, see `start.STATE`.
    """

    columns: tuple[int, ...]
    local: tuple[tuple[Effect, ...], ...]
    state: Mapping[str, list[float]]

    def key(self) -> tuple:
        """What tells it from others of the same trial and effects on all."""
        told = tuple(tuple(map(str, items)) for items in self.local)
        return self.columns, told, str(self.state)


@dataclass(frozen=True, eq=False)
class Trees:
    """The kinematic trees of a model.

    Attributes:
        columns: observed channels that each tree moves; the first has those that
            nothing moves, too.
        parts: number of the tree by kind and name of a part, channels included.
    """

    columns: tuple[tuple[int, ...], ...]
    parts: Mapping[tuple[str, str], int]

    @classmethod
    def one(cls, config: OwnConfig) -> "Trees":
        """All in one tree: nothing is known to move apart."""
        return cls((tuple(range(len(config.seen))),), {})

    @classmethod
    def of(cls, config: OwnConfig, model: mujoco.MjModel) -> "Trees":
        """The trees of a model whose trees do not touch each other; all as one, where
        tendons or equalities may tie them.

        Args:
            config: the description.
            model: the nominal model.
        """
        if model.ntree < 2 or model.neq or model.ntendon:
            return cls.one(config)
        parts = _parts(model)
        for told in config.told:
            parts["channel", told.channel.name] = parts["actuator", told.actuator]
        columns: list[list[int]] = [[] for _ in range(model.ntree)]
        for column, seen in enumerate(config.seen):
            kind = "joint" if seen.quantity == "speed" else seen.quantity
            on = parts.get((kind, seen.part), -1)
            columns[max(on, 0)].append(column)
            parts["channel", seen.channel.name] = on
        known = {part: on for part, on in parts.items() if on >= 0}
        return cls(tuple(map(tuple, columns)), known)

    def split(
        self, trial: Trial, effects: Sequence[Effect]
    ) -> tuple[tuple[Effect, ...], list[Piece]]:
        """The effects on all trees, and what each tree needs of a simulation of a trial
        under effects."""
        on = [self._tree(effect) for effect in effects]
        cuts = [k for k, tree in enumerate(on) if tree < 0]
        spans = list(zip([-1, *cuts], [*cuts, len(on)], strict=True))
        state = trial.conditions.get(start.STATE)
        state = state if isinstance(state, dict) else {}
        joints = {name: self._of_state(name) for name in state}
        pieces = [
            Piece(
                columns,
                tuple(
                    tuple(effects[k] for k in range(first + 1, last) if on[k] == tree)
                    for first, last in spans
                ),
                {joint: state[joint] for joint, at in joints.items() if at == tree},
            )
            for tree, columns in enumerate(self.columns)
        ]
        return tuple(effects[k] for k in cuts), pieces

    def _of_state(self, name: str) -> int:
        """Number of the tree that a number of a start is of: a joint's, or a way of a
        free body (`Seen.state`)."""
        body, _, _ = name.rpartition(".")
        of_body = self.parts.get(("body", body), 0)
        return self.parts.get(("joint", name), of_body)

    def _tree(self, effect: Effect) -> int:
        """Number of the tree that an effect is on, -1 = all."""
        kind = own_effects.OWNERS.get(effect.name, "channel")
        tree = self.parts.get((kind, str(effect.values.get("part", ""))), -1)
        return 0 if len(self.columns) == 1 else tree


def _parts(model: mujoco.MjModel) -> dict[tuple[str, str], int]:
    """Number of the tree of each joint, body, site, gyro, geom and actuator; -1 =
    none."""
    made: dict[tuple[str, str], int] = {}
    for kind, bodies in (
        ("body", range(model.nbody)),
        ("joint", model.jnt_bodyid),
        ("site", model.site_bodyid),
        ("geom", model.geom_bodyid),
    ):
        for number, body in enumerate(bodies):
            made[kind, getattr(model, kind)(number).name] = int(model.body_treeid[body])
    for name in view.gyros(model):
        body = model.site_bodyid[view.gyro(model, name)]
        made["gyro", name] = int(model.body_treeid[body])
    for number in range(model.nu):
        joint = prepared.driven(model, number)
        body = model.jnt_bodyid[joint] if joint >= 0 else 0
        made["actuator", model.actuator(number).name] = int(model.body_treeid[body])
    return made


def joined(
    trial: Trial, common: Sequence[Effect], pieces: Collection[Piece]
) -> tuple[Trial, tuple[Effect, ...]]:
    """One simulation that holds pieces of several trees: the trial, and its effects.

    Args:
        trial: that the pieces are of.
        common: effects on all trees.
        pieces: one of each tree at most.
    """
    effects: list[Effect] = []
    for span in range(len(common) + 1):
        for piece in pieces:
            effects += piece.local[span]
        effects += common[span : span + 1]
    state = trial.conditions.get(start.STATE)
    if isinstance(state, dict):
        state = dict(state)
        for piece in pieces:
            state.update(piece.state)
        trial = trial.replace(conditions={**trial.conditions, start.STATE: state})
    return trial, tuple(effects)
