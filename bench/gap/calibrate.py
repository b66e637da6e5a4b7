"""Calibrate the verdict on cases that are not scored.

    python -m bench.gap.calibrate [--write]

reads the calibration cases (`python -m bench.gap.wheeled_cases calibrate`) and finds
the thresholds; with `--write` they go into `gap/calibration.json`. Those of the 90 %
sets and intervals are found by `bench.gap.conformal`.
"""

import json
import sys

import numpy as np

from bench.gap.wheeled_cases import SEEN, rows
from bench.versions import ROOT
from bns.gap.core.model_order import Rung, climb
from bns.gap.core.verdict import calibration, quantile

FILE = ROOT / "gap" / "calibration.json"
MISSED = 1e3  # score of a true support that was not among the fitted ones
ALARMS = 0.005  # share of recordings without an effect in which a gap may be claimed
SURE = 0.98  # coverage of what is named, at least
LEAST, MOST = 6.0, 12.0  # for it; likelihood ratios of 20 and 400
STRANGE = 0.01  # share of effects of the library that may be called none of it


def scores(found: list[dict]) -> list[float]:
    """Loss of the true support over the best one's, per case in which one was found."""
    made = []
    for row in found:
        rung = _rung(row)
        if row["kind"] == "single" and rung.size == 1:
            ranked = {tuple(sorted(names)): score for names, score in rung.scores}
            truth = tuple(sorted(row["answer"]["names"]))
            made.append(round(ranked.get(truth, MISSED), 3))
    return sorted(made)


def _rung(row: dict) -> Rung:
    """What a recording calls for, by the package's rules on further effects."""
    rungs = [Rung.from_dict(content) for content in row["said"]["rungs"]]
    return climb(rungs, row["said"]["worth"], calibration())


def spurious(found: list[dict]) -> tuple[list[float], list[float]]:
    """Gains by one effect more than there are, and by the last of two true ones."""
    extra, true = [], []
    for row in found:
        rungs = [Rung.from_dict(content) for content in row["said"]["rungs"]]
        count = len(row["answer"]["names"])
        if row["kind"] in ("single", "pair") and len(rungs) > count + 1:
            extra.append(round(rungs[count].loss - rungs[count + 1].loss, 1))
        if row["kind"] == "pair" and len(rungs) > 2:
            true.append(round(rungs[1].loss - rungs[2].loss, 1))
    return sorted(extra), sorted(true)


def alpha_gap(found: list[dict]) -> float:
    """p-value below which there is a gap: at most `ALARMS` where there is none."""
    none = sorted(
        row["said"]["p_gap"]
        for row in found
        if row["kind"] == "none" and _rung(row).size < 2
    )
    place = int(np.floor(ALARMS * (len(none) + 1)))
    lowest = none[place] if none else ALARMS
    return float(min(ALARMS, lowest * 0.999))


def alpha_misfit(found: list[dict], share: float) -> float:
    """p-value that the rest of effects of the library hardly falls below."""
    known = [row for row in found if row["kind"] in ("single", "pair")]
    rests = sorted(
        rung.p_misfit
        for rung in map(_rung, known)
        if rung.size and rung.excess > share * rung.explained
    )
    place = int(np.floor(STRANGE * (len(known) + 1)))
    return float(min(0.01, rests[place] * 0.999)) if place < len(rests) else 0.01


def sure(conformal: list[float]) -> float:
    """Difference of losses beyond which the best support may be named alone."""
    return float(np.clip(quantile(conformal, SURE), LEAST, MOST))


def main(words: list[str]) -> None:
    """Print the thresholds; write them if asked to."""
    found = [row for row in rows("calibrate") if "rungs" in row["said"]]
    seen = [row["seed"] for row in found if row["seed"] >= SEEN]
    if seen:
        raise ValueError(f"Seed {seen[0]} is one of the scored cases.")
    content = json.loads(FILE.read_text(encoding="utf-8"))
    conformal = scores(found)
    new = {
        "alpha_gap": alpha_gap(found),
        "sure": sure(conformal),
        "alpha_misfit": alpha_misfit(found, content["misfit_share"]),
    }
    extra, true = spurious(found)
    print(f"gains by one effect too many: {extra[-5:]}; by a true second: {true[:5]}")
    print(f"{len(found)} cases, {len(conformal)} scores")
    for name, value in new.items():
        print(f"{name} {value:.4g} (was {content.get(name, 0.0):.4g})")
    if "--write" in words:
        content.update(new)
        FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
