"""Calibrate the 90 % sets and the 90 % intervals of magnitudes.

    python -m bench.gap.conformal [--write]

reads diagnosed cases that are not to be scored: the calibration cases and those of
earlier rounds. Both are calibrated on what a user gets to see: cases of all sizes in
which effects were named. With `--write`, `tie` and `scores` go into
`gap/calibration.json`, the errors of magnitudes into `gap/conformal.json`.
"""

import json
import sys
from collections.abc import Iterator

from bench.gap.kept_cases import DIRECTORY
from bench.versions import ROOT
from bns.gap.bench import scoring
from bns.gap.core import conformal
from bns.gap.core.model_order import Rung, climb
from bns.gap.core.verdict import calibration, quantile

GAP = ROOT / "gap"
FILES = ("gap2_calibrate_*.jsonl", "gap2_scored_*.jsonl")  # in the order of rounds
FRESH = 3_000_000  # seeds from here on are of cases that are still to be scored
MISSED = 1e3  # score of a true support that was not among the fitted ones


def rows() -> list[dict]:
    """Cases with verdicts by the package's calibration, each once."""
    found = {}
    for pattern in FILES:
        for file in sorted(DIRECTORY.glob(pattern)):
            for line in file.read_text().splitlines():
                row = json.loads(line)
                found[row["kind"], row["seed"]] = row
    fresh = [seed for _, seed in found if seed >= FRESH]
    if fresh:
        raise ValueError(f"Seed {fresh[0]} is one of the scored cases.")
    kept = [row for _, row in sorted(found.items()) if "rungs" in row["said"]]
    return [scoring.judged(row, calibration()) for row in kept]


def scores(found: list[dict]) -> list[float]:
    """Loss of the true effect over the best one's, per case of one that was named."""
    made = []
    for row in found:
        rung = climb(
            [Rung.from_dict(content) for content in row["said"]["rungs"]],
            row["said"]["worth"],
            calibration(),
        )
        if row["kind"] == "single" and row["said"]["named"] and rung.size == 1:
            ranked = {tuple(sorted(names)): score for names, score in rung.scores}
            truth = tuple(sorted(row["answer"]["names"]))
            made.append(round(ranked.get(truth, MISSED), 3))
    return sorted(made)


def errors(found: list[dict]) -> dict[str, list[float]]:
    """Errors of magnitudes in standard errors, by group, where the truth was named."""
    made: dict[str, list[float]] = {conformal.TIMING: [], conformal.OTHER: []}
    for row in found:
        if row["kind"] in ("single", "pair") and scoring.listed(row):
            for group, error in _errors(row):
                made[group].append(round(min(error, MISSED), 3))
    return {group: sorted(values) for group, values in made.items()}


def _errors(row: dict) -> Iterator[tuple[str, float]]:
    answer = row["answer"]
    fitted = scoring.errors(row["said"], calibration())
    for name, true, (value, error, _) in zip(
        answer["names"], answer["magnitudes"], fitted, strict=True
    ):
        group = conformal.group(*scoring.described(name))
        yield group, abs(value - true) / max(error, 1e-12)


def main(words: list[str]) -> None:
    """Print what was found; write it if asked to."""
    rules, found = calibration(), rows()
    sets, spans = scores(found), errors(found)
    tie = quantile(sets, rules.coverage)
    print(
        f"{len(found)} cases, {len(sets)} scores; tie {tie:.3g} (was {rules.tie:.3g})"
    )
    for group, values in spans.items():
        new = quantile(values, rules.coverage)
        print(f"{group}: {len(values)} magnitudes, {new:.3g} standard errors")
    if "--write" not in words:
        return
    file = GAP / "calibration.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    content.update(tie=tie, scores=sets, widen=1.0)
    file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    text = json.dumps({"errors": spans}, indent=1) + "\n"
    (GAP / "conformal.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
