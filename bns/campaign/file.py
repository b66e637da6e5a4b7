"""Campaign files: what is varied, how often, and from which seed.

    name = "windows"
    preset = "khepera-simple"
    replicates = 30
    seed = 1
    batch_runs = 30

    [settings]
    trials = 100

    [grid]
    adaptation.window = [0, 150, 300]
    world.damage = ["wheel_gain:wheel=left,factor=0.8@30", "..."]

    [[list]]
    label = "both"
    adaptation.window = 150
    adaptation.simulator_reset = true

    [sample]
    count = 20
    evolution.mutation_rate = { low = 0.05, high = 0.3, scale = "log" }

Where several of grid, list and sample are given, each combination is a member.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bns import seeding
from bns.campaign.identity import flatten, identity, known, label, with_settings
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.experiment.validate import BOUNDS
from bns.storage import reading, seal

TOP = ("name", "description", "preset", "replicates", "seed", "batch_runs")
TABLES = ("settings", "grid", "list", "sample")

ASK_ABOVE = 20_000  # runs
NEVER_ABOVE = 1_000_000  # configurations


@dataclass(frozen=True)
class Member:
    """One configuration of a campaign.

    Attributes:
        label: what it is called: the settings that are varied.
        config: all settings; seed, replicates and threads mean nothing here.
        varied: the settings that are varied, by dotted name.
    """

    label: str
    config: RunConfig
    varied: Mapping[str, Any] = field(default_factory=dict)

    @property
    def identity(self) -> str:
        """What the configuration is, whatever its label."""
        return identity(self.config)


@dataclass(frozen=True)
class Campaign:
    """A campaign as its file says.

    Attributes:
        name: of the campaign.
        members: its configurations, each once.
        replicates: runs of each.
        seed: from which, with identities, all seeds follow.
        batch_runs: runs that share a batch, at most.
        sampled: whether the members are a random sample.
        text: of the file, kept in the store; empty where there was none.
    """

    name: str
    members: tuple[Member, ...]
    replicates: int = 30
    seed: int = 0
    batch_runs: int = 30
    sampled: bool = False
    text: str = ""

    @property
    def runs(self) -> int:
        """All runs of all members."""
        return len(self.members) * self.replicates


def read(path: Path | str, *, sure: bool = False) -> Campaign:
    """The campaign in a TOML file.

    Args:
        path: the file.
        sure: take a very large one.

    Raises:
        BnsError: not there, not TOML, an unknown setting, empty, or very large.
    """
    path = Path(path)
    text = seal.opened_text(reading.read_text(path), path, wanted=False)
    made = from_content(reading.toml(text, path), path.stem, sure=sure)
    return replace(made, text=text)


def from_content(
    content: Mapping[str, Any], name: str, *, sure: bool = False
) -> Campaign:
    """The campaign in the content of a TOML file; see `read`.

    Args:
        content: tables and keys, as parsed.
        name: of the campaign, where the content gives none.
        sure: take a very large one.

    Raises:
        UnknownNameError: a key or table that campaign files do not have.
        BnsError: a value that is not allowed, an empty campaign, or a very large one.
    """
    for key in content:
        if key not in TOP + TABLES:
            raise UnknownNameError("key of a campaign file", key, TOP + TABLES)
    numbers: dict[str, Any] = {
        "replicates": _whole(content, "replicates", 30, BOUNDS["replicates"]),
        "seed": _whole(content, "seed", 0, BOUNDS["seed"]),
        "batch_runs": _whole(content, "batch_runs", 30, BOUNDS["replicates"]),
    }
    base = with_settings(
        _base(content),
        flatten(_table(content, "settings"), "[settings]"),
    )
    parts = [_grid(content), _list(content)]
    _check_size(parts, content, numbers["replicates"], sure)
    parts.append(_sample(content))
    members = _members(base, parts)
    return Campaign(
        name=str(content.get("name", name)),
        members=members,
        sampled="sample" in content,
        **numbers,
    )


def _base(content: Mapping[str, Any]) -> RunConfig:
    from bns import presets

    preset = content.get("preset", "")
    if not isinstance(preset, str):
        raise BnsError(f"preset = {preset!r} is not allowed: give a preset's name.")
    base = presets.load(preset) if preset else RunConfig()
    return replace(base, seed=0, replicates=1, record_replicates=0, threads=1)


def _members(base: RunConfig, parts: list[list[dict[str, Any]]]) -> tuple[Member, ...]:
    members: dict[str, Member] = {}
    for pieces in itertools.product(*parts):
        varied: dict[str, Any] = {}
        named = ""
        for piece in pieces:
            named = piece.get("label", named)
            varied |= {k: v for k, v in piece.items() if k != "label"}
        rest = {k: v for k, v in varied.items() if not named or k not in pieces[1]}
        words = [word for word in (named, label(rest)) if word]
        config = with_settings(base, varied)
        member = Member(", ".join(words) or "as given", config, varied)
        members.setdefault(member.identity, member)
    return tuple(members.values())


def _grid(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    axes = flatten(_table(content, "grid"), "[grid]")
    for name, values in axes.items():
        if not isinstance(values, list):
            raise BnsError(f"[grid]: {name} = {values!r}: give a list of values.")
        if not values:
            raise BnsError(f"[grid]: {name} has no values, so there is nothing to run.")
    size = math.prod(len(values) for values in axes.values())
    if size > NEVER_ABOVE:
        raise BnsError(
            f"The grid has {size:,} configurations; {NEVER_ABOVE:,} is the most. "
            "Take fewer values, or a random sample: [sample] with count = 1000."
        )
    rows = itertools.product(*axes.values())
    return [dict(zip(axes, row, strict=True)) for row in rows]


def _list(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    entries = content.get("list", [{}])
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise BnsError("list: give one [[list]] table for each configuration.")
    if not entries:
        raise BnsError("The list is empty, so there is nothing to run.")
    rows = []
    for number, entry in enumerate(entries):
        named = {"label": str(entry["label"])} if "label" in entry else {}
        rest = {key: value for key, value in entry.items() if key != "label"}
        rows.append(named | flatten(rest, f"[[list]] {number + 1}"))
    return rows


def _sample(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    table = dict(_table(content, "sample"))
    if not table:
        return [{}]
    count, seed = table.pop("count", 0), table.pop("seed", 0)
    if type(seed) is not int or seed < 0:
        raise BnsError(f"[sample]: seed = {seed!r}: give a whole number from 0 on.")
    return draw(flatten(table, "[sample]"), count, seed, "[sample]")


def _check_size(
    parts: list[list[dict[str, Any]]],
    content: Mapping[str, Any],
    replicates: int,
    sure: bool,
) -> None:
    drawn = _table(content, "sample").get("count", 1)
    count = math.prod(map(len, parts)) * (drawn if type(drawn) is int else 1)
    runs = count * replicates
    if count > NEVER_ABOVE or (runs > ASK_ABOVE and not sure):
        raise BnsError(
            f"This campaign has {count:,} configurations, {runs:,} runs with "
            f"{replicates} replicates each: "
            + (
                f"{NEVER_ABOVE:,} configurations is the most."
                if count > NEVER_ABOVE
                else "add --yes if that is meant."
            )
        )


def _table(content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, Mapping):
        raise BnsError(f"{name} = {table!r} is not allowed: it is a table, [{name}].")
    return table


def _whole(content: Mapping[str, Any], key: str, default: int, bound: Any) -> int:
    value = content.get(key, default)
    if type(value) is not int or not bound.low <= value <= bound.high:
        raise BnsError(
            f"{key} = {value!r} is not allowed: give a whole number from "
            f"{bound.low:g} to {bound.high:g}."
        )
    return value


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
