"""Cases of the gap benches: made, diagnosed once, kept as JSON lines, scored many ways.

    python -m bench.gap.wheeled_cases scored|sets [PART PARTS]

diagnoses the missing cases of a set (every PARTS-th, from PART on) and keeps the
results in `runs/bench/`, one file per part.
"""

import sys

from bench.gap import kept_cases

ROUNDS = {"scored": (10,), "sets": (10,)}
"""of diagnoses, those of a later one count; each has scored cases of its own, see
docs/decisions.md"""
SEALED = 33_000_000  # seeds of the scored cases begin here; lower ones were scored once
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
}
# Planted for "alias": two delays that no command parts, and what a short one is like.
ALIKE = ("command_latency", "tracker_latency", "wheel_stuck_max[both]")
QUICK = {"single": 2, "none": 1}


def seed_of(name: str, kind: str, number: int) -> int:
    """Seed of the case `number` of a kind in a set."""
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
    """Run what is missing of the scored cases; their results."""
    cases = wanted("scored", QUICK if quick else None)
    produce(cases, "scored")
    return [r for r in rows() if (r["kind"], r["seed"]) in set(cases)]


def produce(cases: list[tuple[str, int]], name: str, part: int = 0) -> None:
    """Make and diagnose the cases that are missing, appending as they come."""
    kept_cases.produce(_file(name, ROUNDS[name][-1]), one, cases, part)


def one(kind: str, seed: int) -> dict:
    """One case: what is true, what was said, and how long it took."""
    from bench.gap.strange_effects import off_library, other_solver
    from bns.errors import BnsError
    from bns.gap.bench import cases, scoring
    from bns.gap.bench.wheeled_cases import WheeledStand
    from bns.gap.diagnose import diagnose
    from bns.gap.models.wheeled.model import WheeledModel
    from bns.gap.records import plain

    model = WheeledModel("khepera3", threads=1)
    case = cases.build(
        seed,
        "single" if kind == "alias" else kind,
        WheeledStand(model, other_solver()),
        off_library=off_library(),
        wanted=ALIKE[seed % len(ALIKE)] if kind == "alias" else "",
    )
    watch = kept_cases.Stopwatch()
    try:
        found = diagnose(case.trials, model, seed=seed, full=False)
        row = scoring.row(kind, seed, case, found)
        if kind == "pair":
            row["said"]["edit"] = scoring.edited(found, case, model)
    except BnsError as error:
        row = scoring.refused(kind, seed, case, str(error))
    row |= watch.read()
    return plain(row)


if __name__ == "__main__":
    name, *rest = sys.argv[1:]
    part, parts = (int(word) for word in rest or ("0", "1"))
    produce(wanted(name)[part::parts], name, part)
