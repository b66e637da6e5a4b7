"""Damage: effects with a schedule, seen in the record and never by the learner.

An event is written in text as

    NAME[:parameter=value,...][@ONSET[..END]][~RAMP][%PERIOD/ON]

ONSET and END are a trial, counted from 0, or a time within it, ``trial:seconds``:

    wheel_gain:wheel=left,factor=0.8            always (onset in trial 0)
    wheel_gain:wheel=left,factor=0.8@30         from trial 30 on
    wheel_gain:wheel=left,factor=0.8@30:2.5s    from 2.5 s into trial 30 on
    wheel_gain:wheel=left,factor=0.8@30..60     in trials 30 to 59
    wheel_gain:wheel=left,factor=0.5@30~10      grows over trials 30 to 39
    wheel_gain:wheel=left,factor=0.5@30%5/2     in 2 of every 5 trials from 30 on

END is the first moment at which the effect is off again. A ramp of n trials has the
severity 1/n in the onset trial and 1 from the n-th on; severity is constant within a
trial. Nothing here is random: a schedule gives the same answer at every call.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from bns.errors import BnsError
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect

GRAMMAR = "NAME[:parameter=value,...][@ONSET[..END]][~RAMP][%PERIOD/ON]"
EXAMPLE = "wheel_gain:wheel=left,factor=0.8@30"

_MOMENT = r"(?P<{0}_trial>\d{{1,9}})(:(?P<{0}_time>\d+(\.\d+)?(e-?\d+)?)s?)?"
_EVENT = re.compile(
    r"(?P<effect>[^@~%]+)"
    rf"(@{_MOMENT.format('onset')}(\.\.{_MOMENT.format('end')})?)?"
    r"(~(?P<ramp>\d{1,9}))?"
    r"(%(?P<period>\d{1,9})/(?P<on_for>\d{1,9}))?"
)
_TABLE_KEYS = {
    "onset": "onset_trial",
    "onset_time": "onset_time",
    "end": "end_trial",
    "end_time": "end_time",
    "ramp": "ramp",
    "period": "period",
    "on_for": "on_for",
}

WHOLE = ("blend", "loss")  # strengths that go from nothing (0) to everything (1)


@dataclass(frozen=True)
class ActiveEffect:
    """An effect as it is in one trial.

    Attributes:
        effect: already scaled to its severity in this trial.
        start: when in the trial it sets in [s].
        stop: when it ends [s]; infinite = lasts to the end of the trial.
    """

    effect: Effect
    start: float = 0.0
    stop: float = math.inf


@dataclass(frozen=True)
class Event:
    """One effect with its schedule.

    Attributes:
        effect: at full severity.
        onset_trial: first trial in which it acts, counted from 0.
        onset_time: when in that trial it sets in [s].
        end_trial: trial in which it ends; None = never.
        end_time: when in that trial it ends [s]; 0 = it is off in all of it.
        ramp: trials over which severity grows linearly to 1; 0 = at once.
        period: length of a recurrence [trials], counted from the onset; 0 = none.
        on_for: trials at the start of every period in which it acts.

    Raises:
        BnsError: a negative number, an end before the onset, or a recurrence that
            is never or always on.
    """

    effect: Effect
    onset_trial: int = 0
    onset_time: float = 0.0
    end_trial: int | None = None
    end_time: float = 0.0
    ramp: int = 0
    period: int = 0
    on_for: int = 0

    def __post_init__(self) -> None:
        for name in ("onset_trial", "end_trial", "ramp", "period", "on_for"):
            value = getattr(self, name)
            optional = name == "end_trial" and value is None
            if not optional and (type(value) is not int or value < 0):
                self._refuse(f"{name} = {value!r}", "give a whole number from 0 on")
        for name in ("onset_time", "end_time"):
            value = getattr(self, name)
            number = type(value) in (int, float)
            if not (number and math.isfinite(value) and value >= 0):
                self._refuse(f"{name} = {value!r}", "give seconds from 0 on")
        if self.end_trial is None and self.end_time:
            self._refuse(f"end_time = {self.end_time}", "give end_trial as well")
        if self.end_trial is not None and self._end <= self._onset:
            self._refuse(
                f"end {self._end} at or before onset {self._onset} (trial, seconds)",
                "give an end after the onset",
            )
        if (self.period or self.on_for) and not 0 < self.on_for < self.period:
            self._refuse(
                f"on for {self.on_for} of every {self.period} trials",
                "give 0 < ON < PERIOD, or leave the recurrence away",
            )

    def _refuse(self, given: str, remedy: str) -> NoReturn:
        raise BnsError(f"Damage {self.effect}: {given} is not allowed: {remedy}.")

    @property
    def _onset(self) -> tuple[int, float]:
        return self.onset_trial, self.onset_time

    @property
    def _end(self) -> tuple[float, float]:
        return math.inf if self.end_trial is None else self.end_trial, self.end_time

    @classmethod
    def parse(cls, text: str) -> "Event":
        """The event written in `text`, see the grammar in the module's docstring.

        Raises:
            BnsError: bad syntax or schedule, unknown names, values out of bounds.
        """
        match = _EVENT.fullmatch(re.sub(r"\s+", "", text))
        if match is None:
            raise BnsError(
                f"Damage {text!r} cannot be read: write {GRAMMAR}, ONSET and END as "
                f"trial or trial:seconds, as in {EXAMPLE!r} or '...@30:2.5s..60'."
            )
        given = {key: value for key, value in match.groupdict().items() if value}
        schedule: dict[str, Any] = {
            key: float(value) if key.endswith("_time") else int(value)
            for key, value in given.items()
            if key != "effect"
        }
        effect = registry.parse(given["effect"])
        named = [p for p in effect.values if f"{p}=" in given["effect"]]
        return cls(_strong(effect, named), **schedule)

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Event":
        """The event in a table: an effect's table plus schedule keys.

        Keys of the schedule: onset, onset_time, end, end_time, ramp, period, on_for.

        Raises:
            BnsError: bad schedule, unknown names, values out of bounds.
        """
        effect = {key: item for key, item in table.items() if key not in _TABLE_KEYS}
        schedule = {_TABLE_KEYS[key]: table[key] for key in table if key not in effect}
        return cls(_strong(registry.from_table(effect), effect), **schedule)

    def __str__(self) -> str:
        """The event as text (parses back)."""
        text = str(self.effect)
        if self._onset != (0, 0.0) or self.end_trial is not None:
            text += f"@{_moment(*self._onset)}"
        if self.end_trial is not None:
            text += f"..{_moment(self.end_trial, self.end_time)}"
        text += f"~{self.ramp}" if self.ramp else ""
        return text + (f"%{self.period}/{self.on_for}" if self.period else "")

    def severity(self, trial: int) -> float:
        """Share of the effect's strength in a trial, 0 (off) to 1."""
        since = trial - self.onset_trial
        if since < 0 or (trial, 0.0) >= self._end:
            return 0.0
        if self.period and since % self.period >= self.on_for:
            return 0.0
        return min(1.0, (since + 1) / self.ramp) if self.ramp else 1.0

    def at(self, trial: int, duration: float = math.inf) -> tuple[ActiveEffect, ...]:
        """What is active in a trial: one effect, or none.

        Args:
            trial: counted from 0.
            duration: of the trial [s]; what sets in later is left out.
        """
        severity = self.severity(trial)
        start = self.onset_time if trial == self.onset_trial else 0.0
        if severity == 0.0 or start >= duration:
            return ()
        since = trial - self.onset_trial
        since = since % self.period if self.period else since
        effect = self.effect.scaled(severity).in_trial(since)
        if effect.is_nominal:
            return ()
        stop = self.end_time if trial == self.end_trial else math.inf
        return (ActiveEffect(effect, start, stop),)

    @property
    def first_trial(self) -> int:
        """First trial in which anything is changed; -1 = none ever is."""
        span = max(self.ramp, 1) * max(self.period, 1)
        trials = range(self.onset_trial, self.onset_trial + span + 1)
        return next((trial for trial in trials if self.at(trial)), -1)


@dataclass(frozen=True)
class Damage:
    """Any number of events; permanent ones have their onset in trial 0."""

    events: tuple[Event, ...] = ()

    @classmethod
    def none(cls) -> "Damage":
        """No damage at all."""
        return cls()

    @classmethod
    def parse(cls, texts: Iterable[str]) -> "Damage":
        """The damage written as one text per event (a lone string is one event).

        Raises:
            BnsError: as `Event.parse`.
        """
        if isinstance(texts, str):
            texts = (texts,)
        return cls(tuple(Event.parse(text) for text in texts))

    def __add__(self, other: "Damage") -> "Damage":
        """Both together, the effects of `self` first."""
        return Damage(self.events + other.events)

    def at(self, trial: int, duration: float = math.inf) -> tuple[ActiveEffect, ...]:
        """What is active in a trial, in the order of the events."""
        return tuple(
            active for event in self.events for active in event.at(trial, duration)
        )

    def is_on(self, trial: int) -> bool:
        """Whether anything is changed in a trial."""
        return bool(self.at(trial))

    @property
    def first_trial(self) -> int:
        """First trial in which anything is changed; -1 = none ever is."""
        firsts = [event.first_trial for event in self.events]
        return min((first for first in firsts if first >= 0), default=-1)

    def texts(self) -> tuple[str, ...]:
        """One text per event (parses back)."""
        return tuple(str(event) for event in self.events)


def _strong(effect: Effect, given: Iterable[str]) -> Effect:
    """A damage as it is meant: what can only be more or less so is wholly so.

    Raises:
        BnsError: a strength that nobody can guess is not given.
    """
    strengths = [item for item in effect.parameters if item.scales]
    if not effect.is_nominal or any(item.name in given for item in strengths):
        return effect
    if len(strengths) == 1 and strengths[0].name in WHOLE:
        return registry.make(effect.name, **{**effect.values, strengths[0].name: 1.0})
    remedy = " or ".join(f"{item.name}={item.example:g}" for item in strengths)
    raise BnsError(
        f"Damage {effect.name!r} without a strength changes nothing: "
        f"give for example {remedy}."
    )


def _moment(trial: int, time: float) -> str:
    return f"{trial}:{time!r}s" if time else f"{trial}"
