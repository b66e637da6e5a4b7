"""Rows: the numbers of a model that may differ from what it says."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bns.errors import BnsError
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect


@dataclass(frozen=True)
class Row:
    """One number of a model, and what is believed of it before a recording is seen.

    Attributes:
        name: of the number, "wheel_gain[left]".
        nominal: the value that changes nothing.
        sd: plausible size of a departure (standard deviation, unit of the number).
        low, high: bounds.
        unit: of the number.
        slack: how far the nominal model may be off without that being a gap (standard
            deviation); 0 = it is exact there.
        unsure: the same where the model tells otherwise what it does, and `slack` is
            less for it; what lies within (`shares.WITHIN`) is no gap.
        levels: values to start from where a slope at the nominal does not lead.
        smooth: whether there is a slope at the nominal.
        stepped: whether the motion changes in steps with the value, so that only a
            search among values fits it.
        later: whether it is looked at in the place of others alone, of what covers it
            or of what it joins (`simpler.renamed`): it has no slope at the nominal.
        nuisance: fitted always and never an answer.
        step: for differences; 0 = a tenth of `sd`.
        inexact: share of what it changes to which the simulation shows it at best: less
            where a law of friction is one of several; assumed.
        per_trial: whether its effect grows with the number of the trial.
        group: name of the explanation it belongs to; "" = its own. Rows of a group go
            in and out together.
        family: name of the cause that explanations share; one of them or all cost as
            much. "" = its own.
        joins: rows that are this one where they hold alike: its change is the sum of
            theirs, or for a factor (nominally 1) their product.
        covers: explanations that this one can be, too: beside it they explain nothing.
        excite: which commands make it felt, in words.
        effect: name of the effect in the library that it is a number of; "" = the
            model knows.
        parameter: which number of the effect it is.
        fixed: values of the effect's other parameters and choices.
        aliases: names of rows known to look alike whatever is commanded.
    """

    name: str
    nominal: float
    sd: float
    low: float
    high: float
    unit: str = "1"
    slack: float = 0.0
    unsure: float = 0.0
    levels: tuple[float, ...] = ()
    smooth: bool = True
    stepped: bool = False
    later: bool = False
    nuisance: bool = False
    step: float = 0.0
    inexact: float = 0.01
    per_trial: bool = False
    group: str = ""
    family: str = ""
    joins: tuple[str, ...] = ()
    covers: tuple[str, ...] = ()
    excite: str = ""
    effect: str = ""
    parameter: str = ""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    aliases: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (self.low <= self.nominal <= self.high and self.sd > 0):
            raise BnsError(
                f"Row {self.name!r}: the nominal value has to lie between low and "
                "high, and sd has to be positive."
            )

    @property
    def term(self) -> str:
        """Name of the explanation it belongs to."""
        return self.group or self.name

    def make(self, value: float) -> Effect:
        """The effect of the library at a value, clipped to the bounds.

        Raises:
            UnknownNameError: the row is of no effect of the library.
        """
        about = {p.name: p for p in registry.get(self.effect).parameters}
        value = min(max(float(value), self.low), self.high)
        whole = about[self.parameter].integer
        given = {**self.fixed, self.parameter: round(value) if whole else value}
        return registry.make(self.effect, **given)

    def sloped(self, value: float) -> bool:
        """Whether it has a column at a value: a slope, or the secant from nominal."""
        return (self.smooth and not self.later) or value != self.nominal

    def inward(self, value: float, step: float) -> float:
        """A step from a value: the other way, or shorter, where bounds are nearer."""
        up, down = self.high - value, value - self.low
        return min(step, up) if up >= min(step, down) else -min(step, down)

    @property
    def difference(self) -> float:
        """Step for a derivative."""
        return self.step or 0.1 * self.sd
