"""What every bench returns.

A bench is a module `bench/<name>.py` (dashes in the name become underscores) with

    DOC = "one line: what is measured"
    BAR = "<= 1.10 x"                      # the bar, as text
    def run(quick: bool) -> Result: ...

`quick` asks for a coarser figure within 60 s on 2 cores.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Result:
    """One measured figure beside its bar.

    Attributes:
        figure: the headline number.
        unit: its unit.
        holds: whether the bar holds; None where there is none to hold.
        n: what it rests on (runs, repeats, cases).
        details: further figures, JSON-serialisable.
        commits: of the code that made what was measured, where that was made before
            and only read here; empty = it was made now.
        seconds: that making it took, then; None = it was made now.
    """

    figure: float
    unit: str
    holds: bool | None
    n: int
    details: Mapping[str, object] = field(default_factory=dict)
    commits: tuple[str, ...] = ()
    seconds: float | None = None
