"""A nominal model that is simulated with effects of the library: `LibraryModel`."""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

PLANE = "xy"
"""parameters of rows that together are the size and the direction of an effect"""


class LibraryModel(GapModel):
    """A model whose rows say which effect of the library they are, and which is
    simulated with effects.

    Attributes:
        known: its rows by explanation, as `rows` gave them last.
    """

    known: Mapping[str, tuple[Row, ...]] = {}
    one_step = True

    def remembered(self, rows: Sequence[Row]) -> tuple[Row, ...]:
        """Rows, kept so that effects can be made of them."""
        made: dict[str, tuple[Row, ...]] = {}
        for row in rows:
            made[row.term] = (*made.get(row.term, ()), row)
        self.known = {**self.known, **made}
        return tuple(rows)

    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """See `GapModel.effect`."""
        found = effects_of([r for r in self.known[term] if r.name in values], values)
        return found[0] if found else None

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`; there is one step alone."""
        del fine
        wanted: dict[tuple[Effect, ...], list[tuple[int, int]]] = {}
        made: list[list[np.ndarray]] = [[np.empty(0)] * len(trials) for _ in sets]
        for place, row in enumerate(sets):
            for number, values in enumerate(row):
                wanted.setdefault(self._effects(values), []).append((place, number))
        alike: dict[tuple[int, ...], list[tuple[Effect, ...]]] = {}
        for effects, places in wanted.items():
            needed = tuple(sorted({number for _, number in places}))
            alike.setdefault(needed, []).append(effects)
        for needed, groups in alike.items():
            found = self.simulate([trials[number] for number in needed], groups)
            for effects, paths in zip(groups, found, strict=True):
                for place, number in wanted[effects]:
                    made[place][number] = paths[needed.index(number)]
        return made

    def _effects(self, values: Mapping[str, float]) -> tuple[Effect, ...]:
        terms: dict[str, dict[str, float]] = {}
        owner = {row.name: term for term, rows in self.known.items() for row in rows}
        for name, value in values.items():
            terms.setdefault(owner[name], {})[name] = value
        return tuple(
            effect
            for term, rows in terms.items()
            for effect in effects_of(
                [r for r in self.known[term] if r.name in rows], rows
            )
        )


def effects_of(rows: Sequence[Row], values: Mapping[str, float]) -> list[Effect]:
    """The effects that rows of one explanation make, one for each way in which it may
    act; none for a nuisance.

    Args:
        rows: of the explanation.
        values: of them, by name.
    """
    moved = [row for row in rows if values[row.name] != row.nominal] or list(rows[:1])
    ways: dict[str, list[Row]] = {}
    for row in moved:
        if row.effect:
            ways.setdefault(str(sorted(row.fixed.items())), []).append(row)
    return [_made(group, values) for group in ways.values()]


def _made(rows: Sequence[Row], values: Mapping[str, float]) -> Effect:
    first = rows[0]
    given: dict[str, float | str] = {**first.fixed}
    about = {p.name: p for p in registry.get(first.effect).parameters}
    numbers = {row.parameter: float(values[row.name]) for row in rows}
    if not set(numbers) <= set(about) and set(numbers) <= set(PLANE):
        size, way = list(about)[:2]
        x, y = (numbers.get(axis, 0.0) for axis in PLANE)
        numbers = {size: float(np.hypot(x, y)), way: float(np.arctan2(y, x))}
    for name, value in numbers.items():
        value = min(max(value, about[name].low), about[name].high)
        given[name] = round(value) if about[name].integer else value
    return registry.make(first.effect, **given)
