"""Calibrate the verdict on cases that are not scored.

    python -m bench.gap_calibrate [--write]

reads the calibration cases (`python -m bench.gap_runner calibrate`) and finds the
thresholds; with `--write` they go into `gap/calibration.json`.
"""

import json
import sys
from pathlib import Path

import numpy as np

from bench.gap_runner import SEALED, rows
from bns.gap.verdict import quantile

FILE = Path(__file__).resolve().parent.parent / "gap" / "calibration.json"
MISSED = 1e3  # score of a true support that was not among the fitted ones
ALARMS = 0.02  # share of recordings without an effect in which a gap may be claimed
SURE = 0.98  # coverage of what is named, at least
LEAST, MOST = 6.0, 12.0  # for it; likelihood ratios of 20 and 400
STRANGE = 0.02  # share of effects of the library that may be called none of it


def scores(found: list[dict]) -> list[float]:
    """Loss of the true support over the best one's, per case in which one was found.

    Raises:
        ValueError: a row with a seed of the scored cases.
    """
    made = []
    for row in found:
        if row["seed"] >= SEALED:
            raise ValueError(f"Seed {row['seed']} is one of the scored cases.")
        said, truth = row["said"], sorted(row["answer"]["names"])
        if row["kind"] == "single" and said.get("size") == 1:
            ranked = {tuple(sorted(r["names"])): r["score"] for r in said["ranked"]}
            made.append(round(ranked.get(tuple(truth), MISSED), 3))
    return sorted(made)


def alpha_gap(found: list[dict]) -> float:
    """p-value below which there is a gap: at most `ALARMS` where there is none."""
    none = sorted(
        row["said"]["p_gap"]
        for row in found
        if row["kind"] == "none" and row["said"]["size"] < 2
    )
    place = int(np.floor(ALARMS * (len(none) + 1)))
    lowest = none[place] if none else ALARMS
    return float(min(ALARMS, lowest * 0.999))


def alpha_misfit(found: list[dict], share: float) -> float:
    """p-value that the rest of effects of the library hardly falls below."""
    rests = sorted(
        row["said"]["p_misfit"]
        for row in found
        if row["kind"] in ("single", "pair")
        and row["said"]["size"]
        and row["said"]["excess"] > share * row["said"]["explained"]
    )
    count = sum(row["kind"] in ("single", "pair") for row in found)
    place = int(np.floor(STRANGE * (count + 1)))
    return float(min(0.01, rests[place] * 0.999)) if place < len(rests) else 0.01


def sure(conformal: list[float]) -> float:
    """Difference of losses beyond which the best support may be named alone."""
    return float(np.clip(quantile(conformal, SURE), LEAST, MOST))


def main(words: list[str]) -> None:
    """Print the thresholds; write them if asked to."""
    found = [row for row in rows("calibrate") if "size" in row["said"]]
    content = json.loads(FILE.read_text(encoding="utf-8"))
    conformal = scores(found)
    new = {
        "tie": quantile(conformal, content["coverage"]),
        "alpha_gap": alpha_gap(found),
        "sure": sure(conformal),
        "alpha_misfit": alpha_misfit(found, content["misfit_share"]),
    }
    print(f"{len(found)} cases, {len(conformal)} scores")
    for name, value in new.items():
        print(f"{name} {value:.4g} (was {content.get(name, 0.0):.4g})")
    if "--write" in words:
        content.update(new, scores=conformal)
        FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
