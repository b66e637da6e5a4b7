"""Calibrate the verdict on cases that are not scored.

    python -m bench.gap_calibrate FILE [--write]

reads rows of `gap_runner` with development seeds and finds the conformal threshold of
the sets; with `--write` it goes into `gap/calibration.json`.
"""

import json
import sys
from pathlib import Path

from bench.gap_runner import SEALED, rows

FILE = Path(__file__).resolve().parent.parent / "gap" / "calibration.json"
MISSED = 1e3  # score of a true support that was not among the fitted ones


def scores(found: list[dict]) -> list[float]:
    """Loss of the true support over the best one's, per case in which one was named.

    Raises:
        ValueError: a row with a seed of the scored cases.
    """
    made = []
    for row in found:
        if row["seed"] >= SEALED:
            raise ValueError(f"Seed {row['seed']} is one of the scored cases.")
        said, truth = row["said"], sorted(row["answer"]["names"])
        if row["kind"] == "single" and said.get("verdict") in ("effect", "either"):
            ranked = {tuple(sorted(r["names"])): r["score"] for r in said["ranked"]}
            made.append(round(ranked.get(tuple(truth), MISSED), 3))
    return sorted(made)


def main(words: list[str]) -> None:
    """Print the threshold; write it if asked to."""
    from bns.gap.verdict import quantile

    found = scores(rows(Path(words[0])))
    content = json.loads(FILE.read_text(encoding="utf-8"))
    tie = quantile(found, content["coverage"])
    print(f"{len(found)} scores, tie {tie:.2f} (was {content['tie']:.2f})")
    if "--write" in words:
        content.update(tie=tie, scores=found)
        FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
