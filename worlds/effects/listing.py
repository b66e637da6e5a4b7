"""What `bns effects` shows: every effect with its parameters, units and ranges."""

from typing import Any

from bns.worlds.effects import registry
from bns.worlds.effects.base import STAGES, Choice, Effect, Parameter


def rows() -> list[dict[str, Any]]:
    """One plain dictionary per effect, by stage and name (JSON-serialisable).

    Keys: name, stage, robots, doc, source, random, example (text that parses),
    parameters (name, unit, nominal, low, high, example, doc each) and choices
    (name, options, default, doc each).
    """
    classes = [registry.get(name) for name in registry.names()]
    classes.sort(key=lambda item: (STAGES.index(item.stage), item.name))
    return [_row(item) for item in classes]


def _row(effect: type[Effect]) -> dict[str, Any]:
    return {
        "name": effect.name,
        "stage": effect.stage,
        "robots": list(effect.robots),
        "doc": effect.doc,
        "source": effect.source,
        "random": effect.random,
        "example": str(example(effect)),
        "parameters": [_parameter(item) for item in effect.parameters],
        "choices": [_choice(item) for item in effect.choices],
    }


def example(effect: type[Effect]) -> Effect:
    """The effect with the example value of every parameter."""
    return effect({item.name: item.example for item in effect.parameters})


def _parameter(item: Parameter) -> dict[str, Any]:
    fields = ("name", "unit", "nominal", "low", "high", "example", "doc")
    return {field: getattr(item, field) for field in fields}


def _choice(item: Choice) -> dict[str, Any]:
    return {
        "name": item.name,
        "options": list(item.options),
        "default": item.default,
        "doc": item.doc,
    }
