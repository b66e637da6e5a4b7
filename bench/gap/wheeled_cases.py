"""Cases of the gap benches: made, diagnosed once, kept as JSON lines, scored many ways.

    python -m bench.gap.wheeled_cases scored|calibrate [PART PARTS]

diagnoses the missing cases of a set (every PARTS-th, from PART on) and keeps the
results in `runs/bench/`, one file per part. Thresholds play no role in that: verdicts
are taken from what was kept, with the package's calibration, when it is read.
"""

import sys

from bench.gap import kept_cases

ROUND = 2  # of the plans
ROUNDS = {"scored": (4,), "calibrate": (2, 3), "sets": (4,)}
"""of diagnoses, those of a later one count; each has scored cases of its own, see
docs/decisions.md"""
SEEN = 1_000_000  # seeds from here on were scored once, calibration uses lower ones
SEALED = 8_000_000  # seeds of the scored cases begin here
CALIBRATION = 400_000  # seeds of the calibration cases begin here
SPAN = 10_000  # seeds between the scored kinds
SETS = {
    "scored": {
        "single": 140,
        "pair": 40,
        "none": 60,
        "off-library": 30,
        "fault": 16,
        "alias": 16,
    },
    "calibrate": {"single": 140, "none": 60, "off-library": 16, "pair": 40},
}
# Planted for "alias": two delays that no command parts, and what a short one is like.
ALIKE = ("command_latency", "tracker_latency", "wheel_stuck_max[both]")
QUICK = {"single": 2, "none": 1}


def seed_of(name: str, kind: str, number: int) -> int:
    """Seed of the case `number` of a kind in a set."""
    if name == "calibrate":
        return CALIBRATION + number
    return SEALED + SPAN * list(SETS[name]).index(kind) + number


def wanted(name: str, counts: dict[str, int] | None = None) -> list[tuple[str, int]]:
    """Kinds and seeds of a set, kinds mixed, should it be cut short."""
    return kept_cases.mixed(
        counts or SETS[name], lambda kind, n: seed_of(name, kind, n)
    )


def rows(name: str = "scored") -> list[dict]:
    """All results of a set so far, by kind and seed."""
    found = {}
    for number in ROUNDS[name]:
        found.update(kept_cases.kept(_file(name, number)))
    return [found[key] for key in sorted(found)]


def _file(name: str, number: int) -> str:
    """Where the results of a round of a set are kept."""
    return f"gap{number}_{name}"


def ensure(quick: bool = False) -> list[dict]:
    """Run what is missing of the scored cases; their results, judged."""
    cases = wanted("scored", QUICK if quick else None)
    produce(cases, "scored")
    return judged([r for r in rows() if (r["kind"], r["seed"]) in set(cases)])


def judged(found: list[dict]) -> list[dict]:
    """Rows with the verdicts that the package's calibration gives."""
    from bns.gap.bench import scoring
    from bns.gap.core import verdict

    rules = verdict.calibration()
    return [scoring.judged(row, rules) for row in found]


def produce(cases: list[tuple[str, int]], name: str, part: int = 0) -> None:
    """Make and diagnose the cases that are missing, appending as they come."""
    kept_cases.produce(_file(name, ROUNDS[name][-1]), one, cases, part)


def one(kind: str, seed: int) -> dict:
    """One case: what is true, what was said, and how long it took."""
    from bench.gap.strange_effects import off_library, other_solver
    from bns.errors import BnsError
    from bns.gap.bench import cases, scoring
    from bns.gap.diagnose import analyse
    from bns.gap.models.wheeled import WheeledModel
    from bns.gap.records import plain

    model = WheeledModel("khepera3", threads=1)
    case = cases.build(
        seed,
        "single" if kind == "alias" else kind,
        model,
        off_library=off_library(),
        extra=other_solver(),
        wanted=ALIKE[seed % len(ALIKE)] if kind == "alias" else "",
    )
    watch = kept_cases.Stopwatch()
    try:
        made = analyse(case.trials, model, seed=seed)
        said = scoring.said(made, case, model)
    except BnsError as error:
        said = {"error": str(error)}
    row = {"kind": kind, "seed": seed, **watch.read()}
    return plain({**row, "answer": case.answer.as_dict(), "said": said})


if __name__ == "__main__":
    name, *rest = sys.argv[1:]
    part, parts = (int(word) for word in rest or ("0", "1"))
    produce(wanted(name)[part::parts], name, part)
