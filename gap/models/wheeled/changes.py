"""What numbers of a wheeled robot change of its drives: body, commands, tracker."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bns import models
from bns.gap.candidates.wheeled_rows import LEAD, PLANES, STICKS, parameter, term
from bns.worlds.effects import registry
from bns.worlds.effects.base import CommandEffect, Effect, ModelEdit
from bns.worlds.effects.mass import Inertial
from bns.worlds.effects.parts import base

TRACKING = ("marker_mount", "tracker_latency", "tracker_scale", "clock_drift", LEAD)
LATENCY = "command_latency"  # comes before all others, at any fraction of a step
ORDER = (
    "wheel_intermittent",
    "wheel_stuck_max",
    "wheel_stuck_min",
    "wheel_gain",
    "reverse_gain",
    "dead_band",
    "dead_zone",
    "speed_saturation",
    "battery_sag",
    "motor_lag",
    "wheel_backlash",
)
"""in which effects on commands follow each other, from what is told to the wheel"""
LIGHT = 0.03  # [kg] below which a payload's moments do not tell its place


@dataclass(frozen=True)
class Changes:
    """Rows of a drive that are not nominal, by what they change.

    Attributes:
        body: edits of the model.
        command: effects on what is told, in order.
        late: seconds by which commands come late.
        lost: share of every speed that a falling battery takes.
        seen: values of what the tracker does, by row.
    """

    body: tuple[ModelEdit, ...]
    command: tuple[CommandEffect, ...]
    late: float
    lost: float
    seen: Mapping[str, float]

    @classmethod
    def of(cls, values: Mapping[str, float], robot: str) -> "Changes":
        """Sort the rows of a drive of a robot."""
        terms: dict[str, dict[str, float]] = {}
        seen = {}
        for name, value in values.items():
            if name.partition("[")[0].partition(".")[0] in TRACKING:
                seen[name] = value
            else:
                terms.setdefault(term(name), {})[name] = value
        lost = terms.pop("battery_fade", {}).get("battery_fade", 0.0)
        late = terms.pop(LATENCY, {}).get(LATENCY, 0.0)
        made = load(terms.pop("payload"), robot) if "payload" in terms else []
        for name, rows in terms.items():
            whole = name.startswith((*PLANES, *STICKS.values()))
            parts = [rows] if whole else [{row: rows[row]} for row in rows]
            made += [effect(name, part) for part in parts]
        body = _edits(made)
        told = [item for item in made if isinstance(item, CommandEffect)]
        told.sort(key=lambda item: _place(item.name))
        return cls(body, tuple(told), late, lost, seen)

    @classmethod
    def by_effects(cls, effects: Sequence[Effect], number: int) -> "Changes":
        """Sort the effects on a drive.

        Args:
            effects: of the library; those that only add noise change nothing.
            number: of the trial, for what grows with it.
        """
        held = [item.in_trial(number) for item in effects if not item.is_nominal]
        told = [item for item in held if isinstance(item, CommandEffect)]
        late = sum(item["delay"] for item in told if item.name == LATENCY)
        told = [item for item in told if item.name != LATENCY]
        told.sort(key=lambda item: _place(item.name))
        seen = {}
        for item in held:
            strengths = [p.name for p in item.parameters if p.scales]
            for name in strengths if item.name in TRACKING else ():
                full = f"{item.name}.{name}" if len(strengths) > 1 else item.name
                seen[full] = item[name]
        return cls(_edits(held), tuple(told), late, 0.0, seen)


def _edits(effects: Sequence[Effect]) -> tuple[ModelEdit, ...]:
    """Those on the body."""
    edits = (item for item in effects if isinstance(item, ModelEdit))
    return tuple(item for item in edits if item.stage == "body")


def _place(name: str) -> int:
    """Where in the order of effects on commands one acts; last what is not listed."""
    return ORDER.index(name) if name in ORDER else len(ORDER)


def effect(name: str, values: Mapping[str, float]) -> Effect:
    """The effect of an explanation.

    Args:
        name: of the explanation.
        values: of its rows that are not nominal, by name.
    """
    stem, _, side = name.partition("[")
    given: dict[str, float | str] = {"wheel": side.rstrip("]")} if side else {}
    if stem in PLANES:
        x, y = (values.get(f"{name}.{axis}", 0.0) for axis in "xy")
        size, way = [p.name for p in registry.get(stem).parameters]
        length = min(float(np.hypot(x, y)), registry.get(stem).parameters[0].high)
        return registry.make(stem, **given, **{size: length, way: np.arctan2(y, x)})
    if stem == "payload":
        return carried(values)
    every = [*values.items()]
    moved = [item for item in every if item[1] != parameter(item[0]).nominal] or every
    for row, value in moved if stem in STICKS.values() else moved[:1]:
        if "@" in row:
            way = row.partition("@")[2]
            choices = registry.get(stem).choices
            given |= {item.name: way for item in choices if way in item.options}
        about = parameter(row)
        value = min(max(float(value), about.low), about.high)
        given[about.name] = round(value) if about.integer else value
    return registry.make(stem.partition(".")[0], **given)


def carried(values: Mapping[str, float]) -> Effect:
    """A payload from its mass and its moments.

    Args:
        values: of its rows: mass [kg]; mx and my about the middle of the axle and mz
            about the top plate [kg m]; inertia about its own centre [kg m2].
    """
    about = registry.get("payload").parameters
    mass = float(np.clip(values.get("payload.mass", 0.0), 0.0, about[0].high))
    own = float(np.clip(values.get("payload.inertia", 0.0), 0.0, about[-1].high))
    if any(value for name, value in values.items() if name != "payload.mass"):
        mass = max(mass, LIGHT)
    place = {}
    for edge in about[1:-1]:
        away = values.get(f"payload.m{edge.name}", 0.0) / max(mass, LIGHT)
        place[edge.name] = float(np.clip(edge.nominal + away, edge.low, edge.high))
    return registry.make("payload", mass=mass, inertia=own, **place)


def load(values: Mapping[str, float], robot: str) -> list[Effect]:
    """The edits that a payload is simulated by.

    A light one, whose place would be far off for its moments, is a mass above the axle
    and a shift of the common centre of mass: so its moments have a slope at no mass.

    Args:
        values: of its rows that are not nominal.
        robot: by name.
    """
    mass = max(float(values.get("payload.mass", 0.0)), 0.0)
    if mass > LIGHT:
        return [carried(values)]
    own = max(float(values.get("payload.inertia", 0.0)), 0.0)
    made = [registry.make("payload", mass=mass, inertia=own)] if mass or own else []
    moved = {}
    for edge in registry.get("centre_of_mass").parameters:
        moment = values.get(f"payload.m{edge.name[1:]}", 0.0)
        away = moment / (base_mass(robot) + mass)
        moved[edge.name] = float(np.clip(away, edge.low, edge.high))
    return [*made, registry.make("centre_of_mass", **moved)]


@lru_cache
def base_mass(robot: str) -> float:
    """Mass of the body that carries the wheels [kg]."""
    spec = models.spec(robot, visuals=False)
    return Inertial.of(spec, base(spec)).mass
