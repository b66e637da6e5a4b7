"""Random samples of settings: ranges and choices, drawn from a seed."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bns import seeding
from bns.campaign.settings import known
from bns.errors import BnsError, UnknownNameError

KEYS = ("low", "high", "scale")
SCALES = ("linear", "log")


def draw(
    ranges: Mapping[str, Any], count: int, seed: int, where: str
) -> list[dict[str, Any]]:
    """`count` independent samples of the settings.

    Args:
        ranges: setting -> list of values, or a table with `low`, `high` and `scale`
            ("linear", "log"); whole-numbered settings give whole numbers.
        count: samples.
        seed: each setting has a stream of its own, so that adding one moves no other,
            and more samples keep the first ones.
        where: the table's name, for messages.

    Raises:
        BnsError: a range that is none.
    """
    if type(count) is not int or count < 1:
        raise BnsError(f"{where}: count = {count!r} is not allowed: give 1 or more.")
    if not ranges:
        raise BnsError(f"{where} varies nothing: give at least one setting.")
    columns = {}
    for name, spec in ranges.items():
        rng = seeding.generator(seed, "sample", name)
        columns[name] = [_one(name, spec, rng, where) for _ in range(count)]
    rows = zip(*columns.values(), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _one(name: str, spec: Any, rng: np.random.Generator, where: str) -> Any:
    if isinstance(spec, list):
        if not spec:
            raise BnsError(f"{where}: {name} has no values: give at least one.")
        return spec[int(rng.integers(len(spec)))]
    if not isinstance(spec, Mapping) or not {"low", "high"} <= set(spec):
        raise BnsError(
            f"{where}: {name} = {spec!r} is no range: give a list of values or "
            "{ low = 0.05, high = 0.3, scale = 'log' }."
        )
    for key in spec:
        if key not in KEYS:
            raise UnknownNameError(f"key of {where}.{name}", key, KEYS)
    return _between(name, spec, rng, where)


def _between(
    name: str, spec: Mapping[str, Any], rng: np.random.Generator, where: str
) -> Any:
    low, high, scale = spec["low"], spec["high"], spec.get("scale", "linear")
    if scale not in SCALES:
        raise UnknownNameError(f"scale of {name}", str(scale), SCALES)
    numbers = all(type(x) in (int, float) and math.isfinite(x) for x in (low, high))
    if not numbers or low > high or (scale == "log" and low <= 0):
        raise BnsError(
            f"{where}: {name} from {low!r} to {high!r} is no range: low must be a "
            "number below high, and above 0 on a log scale."
        )
    default = known()[name]
    if type(default) not in (int, float):
        raise BnsError(f"{where}: {name} is no number: give a list of values.")
    if scale == "log":
        value = math.exp(rng.uniform(math.log(low), math.log(high)))
    else:
        value = rng.uniform(low, high)
    return round(value) if type(default) is int else float(f"{value:.6g}")
