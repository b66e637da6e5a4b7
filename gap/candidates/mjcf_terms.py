"""The explanations of a model of one's own, and the effects that they are."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from bns.gap.candidates import mjcf_ends, mjcf_rows
from bns.gap.candidates.mjcf_ends import BUMPER
from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import masses
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.loads import Loads
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial


class Terms:
    """The candidates of a model, further ones included, as rows and as effects.

    Args:
        listed: candidates of the model.
        config: the description.
        model: the nominal model.

    Attributes:
        tried: names of the effects among the rows; of all candidates, before there are
            any.
    """

    def __init__(self, listed: Sequence[Row], config: OwnConfig, model: mujoco.MjModel):
        self._bodies = {
            item.fixed["part"]: masses.Body.of(model, item.fixed["part"])
            for item in listed
            if item.effect == "body_mass"
        }
        further = (
            *mjcf_rows.grouped(listed),
            *mjcf_rows.motors(listed),
            *mjcf_rows.gyros(listed, config),
        )
        centres = mjcf_rows.centres(self._bodies)
        items = (*centres, *listed, *further)  # a centre may be listed
        self._items = {item.name: item for item in items}
        self._asked = config.effects is not None
        self._springs: dict[str, Row] = {}
        self.tried = {item.effect for item in items}

    def rows(
        self,
        trials: Sequence[Trial],
        dt: float,
        loads: Loads,
        ends: Mapping[str, np.ndarray],
        *,
        stepped: bool,
    ) -> tuple[Row, ...]:
        """All numbers that may be off, see `mjcf_rows.rows`.

        Args:
            trials: a recording.
            dt: physics step [s].
            loads: of the nominal motion.
            ends: of joints that are stopped sooner than that.
            stepped: whether finer steps change the motion.
        """
        items = tuple(self._items.values())
        if not self._asked:  # what the user asked for stays
            items = mjcf_rows.touching(items, loads.touching)
        self.tried = {item.effect for item in items}
        made = mjcf_rows.rows(
            items,
            trials,
            dt,
            self._bodies,
            stepped=stepped,
            forces=loads.forces,
            ends=ends,
        )
        self._springs = {row.name: row for row in made if row.effect == BUMPER}
        return made

    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """The effect of an explanation; None for the shift in time and the step.

        Args:
            term: name of the explanation.
            values: of its rows.
        """
        if term in (mjcf_rows.LEAD, mjcf_rows.STEP):
            return None
        item = self._items[term]
        if item.effect == "body_mass":
            part = item.fixed["part"]
            return masses.added(term, values, part, self._bodies[part])
        if item.effect == BUMPER:
            return mjcf_ends.spring(self._springs[term], values)
        return item.make(values[term])

    def covered(self, term: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """See `GapModel.covered`: a load that has no mass shifts its body's centre.

        Args:
            term: name of the load.
            values: of its rows.
        """
        part = self._items[term].fixed["part"]
        return masses.centred(term, values, part, self._bodies[part])

    def changes(self, values: Mapping[str, float]) -> tuple[Effect, ...]:
        """The effects that rows are simulated by.

        Args:
            values: of rows that are not nominal, by name.
        """
        made: list[Effect] = []
        several: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            whole = name if name in self._items else name.rpartition(".")[0]
            item = self._items.get(whole)
            if item and item.effect in ("body_mass", BUMPER):
                several.setdefault(item.name, {})[name] = value
            elif item:
                grown = item.make(value).in_trial(1)  # what grows comes as it has
                made.append(grown)
        for name, rows in several.items():
            if name in self._springs:
                made.append(mjcf_ends.spring(self._springs[name], rows))
                continue
            part = self._items[name].fixed["part"]
            made += masses.changes(name, rows, part, self._bodies[part])
        return tuple(made)
