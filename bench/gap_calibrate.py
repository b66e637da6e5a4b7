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

FILE = Path(__file__).resolve().parent.parent / "gap" / "calibration.json"
MISSED = 1e3  # score of a true support that was not among the fitted ones
ALARMS = 0.02  # share of recordings without an effect in which a gap may be claimed
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


def misfit_share(found: list[dict], alpha: float) -> float:
    """Excess over what was explained that effects of the library hardly reach."""
    shares = sorted(
        row["said"]["excess"] / max(row["said"]["explained"], 1e-9)
        if row["said"]["p_misfit"] < alpha
        else 0.0
        for row in found
        if row["kind"] in ("single", "pair") and row["said"].get("size")
    )
    place = int(np.ceil((1 - STRANGE) * (len(shares) + 1))) - 1
    return float(shares[min(place, len(shares) - 1)]) if shares else 0.05


def main(words: list[str]) -> None:
    """Print the thresholds; write them if asked to."""
    from bns.gap.verdict import quantile

    found = [row for row in rows("calibrate") if "size" in row["said"]]
    content = json.loads(FILE.read_text(encoding="utf-8"))
    conformal = scores(found)
    new = {
        "tie": quantile(conformal, content["coverage"]),
        "alpha_gap": alpha_gap(found),
        "misfit_share": max(0.02, misfit_share(found, content["alpha_misfit"])),
    }
    print(f"{len(found)} cases, {len(conformal)} scores")
    for name, value in new.items():
        print(f"{name} {value:.4g} (was {content[name]:.4g})")
    if "--write" in words:
        content.update(new, scores=conformal)
        FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
