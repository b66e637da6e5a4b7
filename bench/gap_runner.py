"""Cases of the gap benches: made, diagnosed once, kept as JSON lines, scored many ways.

    python -m bench.gap_runner KIND FIRST LAST [FILE]

runs the missing cases of a kind with seeds FIRST to LAST - 1.
"""

import json
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent / "results"
FILE = HERE / "gap_cases.jsonl"
SEALED = 1_000_000  # seeds of the scored cases begin here; development uses lower ones
COUNTS = {"single": 180, "pair": 45, "none": 60, "off-library": 30, "fault": 15}
QUICK = {"single": 2, "none": 1}
_ORDER = tuple(COUNTS)


def seed_of(kind: str, number: int) -> int:
    """Seed of the scored case `number` of a kind."""
    return SEALED + 10_000 * _ORDER.index(kind) + number


def rows(file: Path = FILE) -> list[dict]:
    """All results so far."""
    if not file.is_file():
        return []
    return [json.loads(line) for line in file.read_text().splitlines() if line]


def ensure(quick: bool = False, file: Path = FILE) -> list[dict]:
    """Run what is missing; the results of the scored cases."""
    wanted = QUICK if quick else COUNTS
    seeds = {(k, seed_of(k, n)) for k, count in wanted.items() for n in range(count)}
    produce([*sorted(seeds)], file)
    return [row for row in rows(file) if (row["kind"], row["seed"]) in seeds]


def produce(cases: list[tuple[str, int]], file: Path = FILE) -> None:
    """Make and diagnose the cases that the file lacks, appending as they come."""
    from bns.gap.wheeled import WheeledModel

    done = {(row["kind"], row["seed"]) for row in rows(file)}
    file.parent.mkdir(exist_ok=True)
    model = WheeledModel("khepera3", threads=2)
    for kind, seed in cases:
        if (kind, seed) not in done:
            row = one(kind, seed, model)
            with file.open("a") as out:
                out.write(json.dumps(row) + "\n")


def one(kind: str, seed: int, model) -> dict:
    """One case: what is true, what was said, and how long it took."""
    from bench.gap_effects import off_library, other_solver
    from bns.errors import BnsError
    from bns.gap import cases, scoring
    from bns.gap.diagnose import diagnose
    from bns.gap.records import plain

    case = cases.build(
        seed, kind, model, off_library=off_library(), extra=other_solver()
    )
    begin = time.perf_counter()
    try:
        found = diagnose(case.trials, model, seed=seed)
        said = scoring.said(found, case, model)
    except BnsError as error:
        said = {"error": str(error)}
    seconds = time.perf_counter() - begin
    row = {"kind": kind, "seed": seed, "seconds": seconds}
    return plain({**row, "answer": case.answer.as_dict(), "said": said})


if __name__ == "__main__":
    kind, first, last, *rest = sys.argv[1:]
    produce(
        [(kind, seed) for seed in range(int(first), int(last))],
        Path(rest[0]) if rest else FILE,
    )
