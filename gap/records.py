"""What passes between the parts of the diagnosis, and its result as JSON.

All records are frozen. `Diagnosis.to_json` writes plain JSON with the keys `schema`
("bns-diagnosis") and `version`; the rest are the attributes below, by name.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError
from bns.storage import reading

SCHEMA, VERSION = "bns-diagnosis", 1
KINDS = ("no gap", "effect", "either", "together", "none of the library")


@dataclass(frozen=True, eq=False)
class Residuals:
    """Recorded minus simulated relative motion, of all trials.

    Attributes:
        horizons: lengths of time [s]; infinity = whole trials.
        rms: root mean square by horizon and feature channel, ``(H, C)``.
        low, high: 90 % bootstrap interval of it over trials, ``(H, C)``.
        channels: names of the feature channels, C.
        units: of the channels.
    """

    horizons: tuple[float, ...]
    rms: np.ndarray
    low: np.ndarray
    high: np.ndarray
    channels: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class Fit:
    """Effects fitted to a recording.

    Attributes:
        names: of the candidates, in the order of their strength; empty = nothing.
        effects: as text that parses.
        magnitudes: fitted parameter of each.
        intervals: 90 % interval of each magnitude.
        units: of the magnitudes.
        loss: minus twice the log-likelihood on all trials, the noise's constant left
            out (robust).
        held_out: the same on trials that were not fitted, all folds together.
        held_out_se: standard error over trials of the improvement on nothing.
        evidence: minus twice the log marginal likelihood (Laplace).
        at_bound: names of the candidates whose magnitude sits on a bound.
        condition: of the scaled normal matrix; large = magnitudes trade off.
    """

    names: tuple[str, ...]
    effects: tuple[str, ...]
    magnitudes: tuple[float, ...]
    intervals: tuple[tuple[float, float], ...]
    units: tuple[str, ...]
    loss: float
    held_out: float
    held_out_se: float
    evidence: float
    at_bound: tuple[str, ...] = ()
    condition: float = 1.0


@dataclass(frozen=True)
class Verdict:
    """What the diagnosis says.

    Attributes:
        kind: one of `KINDS`.
        named: supports that explain the recording, best first: one for "effect" and
            "together", two or more for "either", none else. A support is a tuple of
            candidate names.
        sets: all supports in the 90 % set, best first (``()`` is "nothing").
        angle: between the whitened signatures of the first two of "either" [deg].
        p_gap: probability of so large a gap if there were none.
        p_misfit: probability of so large a rest if the best support were right.
        second: the second best support outside the first one's alias class.
        margin: by how much its loss is larger.
        sentence: all of this in words.
        change: what would change the answer, in words.
    """

    kind: str
    named: tuple[tuple[str, ...], ...]
    sets: tuple[tuple[str, ...], ...]
    angle: float
    p_gap: float
    p_misfit: float
    second: tuple[str, ...]
    margin: float
    sentence: str
    change: str = ""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise BnsError(f"Verdict.kind {self.kind!r} is none of {', '.join(KINDS)}.")


@dataclass(frozen=True)
class Diagnosis:
    """All that `diagnose` found; every part is plain data.

    Attributes:
        model: name of the nominal model.
        trials: how many were used.
        faults: what `check` repaired or noticed, one line each.
        verdict: the answer.
        fits: by rank: the supports that were fitted in full, "nothing" included.
        where: shares, change point, regime and the like (see `where`).
        signatures: detectability, alias classes and angles (see `signatures`).
        floor: what the recording scatters by itself (see `floor`).
        closed: gap before and after, floor, ceiling (see `quantify`).
        warnings: one line each.
        seed: of all that was drawn.
        seconds: wall time by stage.
        partial: stages that were left out, with the reason.
        provenance: which model and recordings, versions, and the like.
        decomposition: of a joint fit: the parts of the gap with their shares, the three
            statements on size, explanation and rest, and what sets in when; empty in
            diagnoses that were made otherwise.
    """

    model: str
    trials: int
    faults: tuple[str, ...]
    verdict: Verdict
    fits: tuple[Fit, ...]
    where: Mapping[str, Any]
    signatures: Mapping[str, Any]
    floor: Mapping[str, Any]
    closed: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    seed: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)
    partial: Mapping[str, str] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    decomposition: Mapping[str, Any] = field(default_factory=dict)

    @property
    def change(self) -> Mapping[str, Any]:
        """When the gap sets in or ends, if not in the first trial; else empty."""
        found = self.where.get("change") or {}
        later = found.get("place", found.get("trial", 0)) > 0
        return found if found.get("direction") and later else {}

    @property
    def best(self) -> Fit:
        """The fit that the verdict rests on (the empty one if it names nothing)."""
        wanted = self.verdict.named[0] if self.verdict.named else ()
        return next(fit for fit in self.fits if set(fit.names) == set(wanted))

    def to_json(self) -> str:
        """As text; infinities and NaN become null."""
        content = {"schema": SCHEMA, "version": VERSION, **asdict(self)}
        return json.dumps(plain(content), indent=1, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> "Diagnosis":
        """Read what `to_json` wrote (null reads as NaN where a number belongs).

        Raises:
            FormatError: it is something else, or of another version.
        """
        return cls.of(reading.json(text, "A diagnosis"))

    @classmethod
    def of(cls, content: Any) -> "Diagnosis":
        """A diagnosis from what `to_json` writes, parsed.

        Raises:
            FormatError: it is something else, or of another version.
        """
        given = dict(content) if isinstance(content, dict) else {}
        schema, version = given.pop("schema", None), given.pop("version", None)
        if (schema, version) != (SCHEMA, VERSION):
            raise FormatError(
                f"This is {schema!r} version {version}; {SCHEMA!r} version {VERSION} "
                "can be read."
            )
        for key in ("verdict", "fits", "seconds"):
            given[key] = _numbers(given.get(key))
        return reading.typed(given, cls, "A diagnosis")


def plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _numbers(value: Any) -> Any:
    """A value from JSON with NaN for null."""
    if isinstance(value, dict):
        return {key: _numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_numbers(item) for item in value]
    return math.nan if value is None else value
