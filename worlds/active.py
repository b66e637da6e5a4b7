"""Which effects hold for one robot in one trial, sorted by stage."""

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.worlds.damage import ActiveEffect, Damage, Event
from bns.worlds.effects import registry
from bns.worlds.effects.base import (
    CommandEffect,
    Effect,
    ModelEdit,
    OpticsEffect,
    SensorEffect,
    ServoEffect,
    TrackingEffect,
)

WorldT = TypeVar("WorldT", bound=Any)
EffectT = TypeVar("EffectT", bound=Effect, covariant=True)


@dataclass(frozen=True)
class Placed(Generic[EffectT]):
    """An effect with its span in the trial and the name of its random stream.

    Attributes:
        effect: scaled to its severity in this trial.
        start, stop: when it is on [s]; on at `start`, off at `stop`.
        stream: identity of its random stream, beside seed and trial.
    """

    effect: EffectT
    start: float
    stop: float
    stream: tuple[str | int, ...]

    def active(self, times: np.ndarray) -> np.ndarray:
        """Where in time it is on, same shape as `times` [s]."""
        return (times >= self.start) & (times < self.stop)

    def generator(self, seed: int, trial: int) -> np.random.Generator:
        """Its generator: the same for the same seed, trial and stream."""
        return seeding.generator(seed, "world", trial, *self.stream)

    def __str__(self) -> str:
        text = str(self.effect)
        if self.start > 0:
            text += f" from {self.start:g} s"
        if np.isfinite(self.stop):
            text += f" to {self.stop:g} s"
        return text


@dataclass(frozen=True)
class Stages:
    """Effects of one robot in one trial, in the order in which they act.

    Attributes:
        control: those of the command stage, then those of the actuator stage.
        body: edits of the model, those of servos among them.
        sensor: what becomes of what the sensors read.
        tracking: what the tracker does to the poses.
        texts: all of them as text, by origin ("reality", "damage"), for the record.
    """

    control: tuple[Placed[CommandEffect], ...]
    body: tuple[Placed[ModelEdit], ...]
    sensor: tuple[Placed[SensorEffect | OpticsEffect], ...]
    tracking: tuple[Placed[TrackingEffect], ...]
    texts: dict[str, list[str]]

    @classmethod
    def of(
        cls, reality: Damage, damage: Damage, trial: int, duration: float
    ) -> "Stages":
        """What holds in a trial, sorted by stage, reality before damage within each.

        Args:
            reality, damage: with their schedules.
            trial: counted from 0.
            duration: of the trial [s]; what sets in later is left out.
        """
        origins = {"reality": reality, "damage": damage}
        placed = {
            origin: _placed(origin, given.at(trial, duration))
            for origin, given in origins.items()
        }
        both = placed["reality"] + placed["damage"]
        stage: dict[str, tuple[Placed[Any], ...]] = {
            name: tuple(item for item in both if _stage(item.effect) == name)
            for name in ("command", "actuator", "body", "sensor", "tracking")
        }
        return cls(
            control=stage["command"] + stage["actuator"],
            body=stage["body"],
            sensor=stage["sensor"],
            tracking=stage["tracking"],
            texts={key: [str(item) for item in items] for key, items in placed.items()},
        )

    def conditions(self, trial: int, seed: int) -> dict[str, object]:
        """What is true of the world in a trial, for its record."""
        return {**self.texts, "trial": trial, "seed": seed}


def _stage(effect: Effect) -> str:
    """Where it acts in a world: those on a servo law are edits of the model."""
    return "body" if isinstance(effect, ServoEffect) else effect.stage


def _placed(origin: str, effects: Iterable[ActiveEffect]) -> tuple[Placed, ...]:
    """Streams are counted per name, so that adding another effect moves none."""
    seen: dict[str, int] = {}
    placed = []
    for item in effects:
        number = seen.get(item.effect.name, 0)
        seen[item.effect.name] = number + 1
        stream = (origin, item.effect.name, number)
        placed.append(Placed(item.effect, item.start, item.stop, stream))
    return tuple(placed)


def as_damage(given: Damage | str | Effect | Iterable[str | Effect]) -> Damage:
    """A damage from what a user may give.

    Args:
        given: a `Damage`, or effects as text (with a schedule) or as objects
            (permanent).

    Raises:
        BnsError: it is none of these, or a text cannot be read.
    """
    if isinstance(given, Damage):
        return given
    if isinstance(given, str | Effect) or not isinstance(given, Iterable):
        return _one(given)
    return sum((_one(item) for item in given), Damage.none())


def _one(item: object) -> Damage:
    if isinstance(item, Damage):
        return item
    if isinstance(item, Effect):
        return Damage((Event(item),))
    if isinstance(item, str):
        return Damage.parse((item,))
    raise BnsError(
        f"{item!r} is no effect: give a Damage, an Effect or a text such as "
        f"{registry.EXAMPLE!r}."
    )


def per_robot(given: object) -> Damage | tuple[Damage, ...]:
    """One damage for all robots, or one for each.

    Args:
        given: a `Damage` or effects (texts, objects) for all; or a sequence holding
            one such thing (a `Damage` or a sequence of effects) per robot.
    """
    if isinstance(given, Damage | str | Effect) or not isinstance(given, Iterable):
        return as_damage(given)  # type: ignore[arg-type]
    items = tuple(given)
    if all(isinstance(item, str | Effect) for item in items):
        return as_damage(items)
    return tuple(as_damage(item) for item in items)


def refuse(damage: Damage, *, stages: Iterable[str], kind: str, world: str) -> None:
    """Stop if a world cannot represent an effect.

    Args:
        damage: what is wanted.
        stages: the stages that the world has.
        kind: the robot's kind ("wheeled").
        world: name of the world, for the message.

    Raises:
        BnsError: an effect acts at another stage, or suits another kind of robot.
    """
    allowed = tuple(stages)
    for event in damage.events:
        effect = event.effect
        if effect.stage not in allowed:
            other = "light" if effect.stage == "sensor" else "mujoco"
            raise BnsError(
                f"World {world!r} cannot represent {effect.name!r}, an effect on the "
                f"{effect.stage}: it has the stages {', '.join(allowed)}; "
                f"take another effect or the world {other!r}."
            )
        if kind not in effect.robots:
            able = " and ".join(item for item in effect.robots if item != "own")
            able = f"{able} robots" if able else "models without a world (`bns gap`)"
            raise BnsError(
                f"Effect {effect.name!r} is for {able}; this robot is {kind}."
            )


def having(
    world: WorldT, damages: Sequence[Damage], stages: Iterable[str], kind: str
) -> WorldT:
    """A world like another, but for its damage.

    Whether the robots can stand is not asked: it is for those who try out what may be
    wrong with a robot.

    Args:
        world: whose damage is its attribute `damage`.
        damages: one for each robot.
        stages, kind: see `refuse`.

    Raises:
        BnsError: an effect that the world cannot have.
    """
    stages = tuple(stages)
    for damage in damages:
        refuse(damage, stages=stages, kind=kind, world=world.name)
    other = copy(world)
    other.damage = tuple(damages)
    return other
