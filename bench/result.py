"""How a bench is declared, and what it returns.

A bench is a function in any module of this package (dashes in its name become
underscores):

    @bench("one line: what is measured", bar="<= 1.10 x")
    def world_overhead(quick: bool) -> Result: ...

`quick` asks for a coarser figure within 60 s on 2 cores.
"""

from collections.abc import Callable, Mapping
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


Run = Callable[[bool], Result]


def bench(doc: str, *, bar: str) -> Callable[[Run], Run]:
    """Declare a bench; `bench.runner` reads this from the source, without importing it.

    Args:
        doc: what is measured, one line, a literal.
        bar: what the figure is to be, a literal.
    """
    del doc, bar
    return lambda run: run
