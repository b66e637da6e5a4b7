"""Cases of a gap bench, by kind and seed: diagnosed once, kept as JSON lines.

What is diagnosed is kept in `runs/bench/`. A round that takes longer than a machine is
there goes on elsewhere: rows that lie in `bench/results/rounds/` as well are not made
again. Each row says of which commit it is.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.versions import ROOT, commit

DIRECTORY = ROOT / "runs" / "bench"
ROUNDS = ROOT / "bench" / "results" / "rounds"

Case = tuple[str, int]
"""kind and seed"""


class Stopwatch:
    """Time since it was made."""

    def __init__(self) -> None:
        self._begin, self._busy = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        """Wall time and this process's time, "seconds" and "cpu" [s]."""
        wall, busy = time.perf_counter() - self._begin, time.process_time() - self._busy
        return {"seconds": wall, "cpu": busy}


def mixed(counts: Mapping[str, int], seed: Callable[[str, int], int]) -> list[Case]:
    """Kinds and seeds, kinds mixed, should the work be cut short.

    Args:
        counts: how many of each kind.
        seed: of a kind's case, by its number.
    """
    share = {
        (kind, seed(kind, n)): n / count
        for kind, count in counts.items()
        for n in range(count)
    }
    return sorted(share, key=share.__getitem__)


def kept(file: str) -> dict[Case, dict[str, Any]]:
    """All results so far, in `<file>_<part>.jsonl` of both directories."""
    found = {}
    for path in (
        each for d in (ROUNDS, DIRECTORY) for each in sorted(d.glob(f"{file}_*.jsonl"))
    ):
        for line in path.read_text().splitlines():
            row = json.loads(line)
            found[row["kind"], row["seed"]] = row
    return found


def made(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What a bench's result says of when its rows were made: commits and seconds."""
    commits = tuple(sorted({row["commit"] for row in rows if "commit" in row}))
    seconds = sum(row.get("seconds", 0.0) for row in rows)
    return {"commits": commits, "seconds": round(seconds, 2)} if commits else {}


def produce(
    file: str,
    one: Callable[[str, int], dict[str, Any]],
    cases: Sequence[Case],
    part: int = 0,
) -> list[dict[str, Any]]:
    """Diagnose the cases that are missing, appending as they come.

    Args:
        file: where results are kept, see `kept`.
        one: makes and diagnoses a case.
        cases: that are wanted.
        part: of the work, where it is shared.

    Returns:
        results of the cases.
    """
    done = kept(file)
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    for case in cases:
        if case not in done:
            done[case] = one(*case) | {"commit": commit().replace("-dirty", "+")}
            with (DIRECTORY / f"{file}_{part}.jsonl").open("a") as out:
                out.write(json.dumps(done[case]) + "\n")
    return [done[case] for case in cases]


@dataclass(frozen=True)
class Cases:
    """The cases of a bench.

    Attributes:
        file: their results are kept in `runs/bench/<file>_<part>.jsonl`.
        counts: how many of each kind.
        first: seed of the first kind's first case.
        span: seeds between kinds.
    """

    file: str
    counts: Mapping[str, int]
    first: int
    span: int = 1_000

    def wanted(self, counts: Mapping[str, int] | None = None) -> list[Case]:
        """Kinds and seeds, kinds mixed, see `mixed`."""
        kinds = list(self.counts)
        return mixed(
            counts or self.counts,
            lambda kind, n: self.first + self.span * kinds.index(kind) + n,
        )

    def rows(self) -> dict[Case, dict[str, Any]]:
        """All results so far."""
        return kept(self.file)

    def produce(
        self,
        one: Callable[[str, int], dict[str, Any]],
        cases: Sequence[Case],
        part: int = 0,
    ) -> list[dict[str, Any]]:
        """Diagnose the cases that are missing, see `produce`."""
        return produce(self.file, one, cases, part)
