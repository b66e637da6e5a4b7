"""Recordings by an examiner that shares no code with this project, scored as it does.

    python -m bench.gap.examiner SEED [...] [--only A|B] [--ids ID ...]

The examiner's cases are made with its own generator, diagnosed by way of the command
line and judged by the names that it accepts. Cases outside the library whose effect the
library has gained since are right when it is named; these are `GAINED`.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bench.gap import kept_cases
from bench.result import Result, bench
from bench.versions import ROOT, commit
from bns.errors import BnsError

BAR_VALUE = 0.95
SEEDS = (88, 89)  # diagnosed once; others can be given on the command line
VARIABLE = "BNS_EXAMINER"
_DEFAULT = ROOT.parent / "shared" / "examiner"
_KEPT = Path(tempfile.gettempdir()) / "bns_examiner"
NAMING = ("effect", "either", "together")
GAINED = {
    "marker turned by 0.06 rad": ("marker_mount.yaw",),
    "marker 12 mm ahead, 8 mm left": ("marker_mount.dx", "marker_mount.dy"),
    "battery falls 1 % a trial": ("battery_fade",),
    "backlash 0.25 rad both": ("wheel_backlash[both]",),
    "caster stuck, friction 0.4": ("caster_drag",),
    "eccentric left wheel 1.5 mm": ("wheel_eccentricity[left]",),
    "dead zone taken off both": ("dead_zone[both]",),
    "swimmer thinner fluid": ("fluid_density[all]",),
}
BARS = (
    ("A", "singles named (aliases merged)", ">= 0.95"),
    ("A", "gap claimed without an effect", "<= 0.03"),
    ("A", "pairs, both named and no other", ">= 0.80"),
    ("A", "onset dated within one trial and named", ">= 0.90"),
    ("A", "outside: the rest said to be most, or gained and named", ">= 0.90"),
    ("A", "wrong and alone", "<= 0.02"),
    ("A", "magnitude error over the departure, median", "<= 0.03"),
    ("A", "closed, median", ">= 0.97"),
    ("B", "singles named (aliases merged)", ">= 0.90"),
    ("B", "gap claimed without an effect", "<= 0.05"),
    ("B", "pairs, both named and no other", ""),
    ("B", "outside: the rest said to be most, or gained and named", ""),
    ("B", "wrong and alone", ""),
    ("B", "seconds, median", ""),
    ("A", "seconds, median", "<= 10"),
)


def examiner() -> Path:
    """The examiner's directory.

    Raises:
        BnsError: it is absent.
    """
    found = Path(os.environ.get(VARIABLE, _DEFAULT))
    if not (found / "make_cases.py").is_file():
        raise BnsError(f"Skipped: needs the examiner; set {VARIABLE} to its directory.")
    return found


@bench("an examiner's recordings: wheeled singles named", bar=">= 0.95")
def gap_examiner(quick: bool) -> Result:
    """All cases of a seed that was used once; quick takes the first of each kind."""
    rows = [row for seed in SEEDS for row in scored(seed, quick=quick)]
    figures = table(rows)
    named = figures[("A", "singles named (aliases merged)")]
    return Result(
        **kept_cases.made(rows),
        figure=round(named[0], 3),
        unit="of cases",
        holds=named[0] >= BAR_VALUE,
        n=named[1],
        details={f"{part}: {name}": value for (part, name), value in figures.items()},
    )


def scored(
    seed: int, *, only: str = "", ids: Iterable[str] = (), quick: bool = False
) -> list[dict[str, Any]]:
    """Cases of a seed, each with what was said of it and whether that is right."""
    home = _KEPT / str(seed)
    answers = made(seed, home)
    chosen = [a for a in answers if not only or a["part"] == only]
    wanted = tuple(ids)
    if wanted:
        chosen = [a for a in chosen if a["id"] in wanted or a["kind"] in wanted]
    if quick:
        first = {(a["part"], a["kind"]): a for a in reversed(chosen)}
        chosen = list(first.values())
    rows = []
    for answer in chosen:
        row = judged(answer, said(home / "cases" / answer["id"], home / "said"))
        print(_line(row), flush=True)
        rows.append(row)
    return rows


def made(seed: int, home: Path) -> list[dict[str, Any]]:
    """Make the cases of a seed, once; their answers."""
    answers = home / "answers.json"
    if not answers.is_file():
        home.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, str(examiner() / "make_cases.py"), "--seed", str(seed)]
        words += ["--out", str(home / "cases"), "--answers", str(answers)]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    return json.loads(answers.read_text(encoding="utf-8"))


def said(case: Path, out: Path) -> dict[str, Any]:
    """Diagnose a case by way of the command line, once; what was said."""
    kept = out / f"{case.name}.json"
    if kept.is_file():
        return json.loads(kept.read_text(encoding="utf-8"))
    out.mkdir(parents=True, exist_ok=True)
    data = case / "dataset" if (case / "dataset").is_dir() else case / "log.csv"
    words = [sys.executable, "-m", "bns", "gap", "diagnose", str(data)]
    if (case / "map.toml").is_file():
        words += ["--columns", str(case / "map.toml")]
    if (case / "model.txt").is_file():
        words += ["--model", (case / "model.txt").read_text().strip()]
    with tempfile.TemporaryDirectory() as scratch:
        words += ["--out", f"{scratch}/out", "--no-rerun", "--no-report"]
        begin = time.perf_counter()
        done = subprocess.run(
            words, capture_output=True, text=True, check=False, cwd=case,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        took = time.perf_counter() - begin
        found: dict[str, Any] = {"seconds": took, "commit": commit()}
        file = Path(scratch) / "out" / "diagnosis.json"
        if done.returncode == 0 and file.is_file():
            found["diagnosis"] = json.loads(file.read_text(encoding="utf-8"))
        else:
            found["error"] = done.stderr[-300:]
    kept.write_text(json.dumps(found) + "\n", encoding="utf-8")
    return found


def judged(answer: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """An answer beside what was said, as the examiner's `score.py` judges it."""
    kept = {key: found[key] for key in ("seconds", "commit") if key in found}
    row = {**answer, **kept, "error": found.get("error", "")}
    content = found.get("diagnosis")
    if content is None:
        return {**row, "verdict": "error", "named": []}
    verdict = content["verdict"]
    named = [sorted(names) for names in verdict["named"]]
    right = [sorted(names) for names in (*answer["strict"], *answer["merged"])]
    naming = verdict["kind"] in NAMING
    row |= {
        "verdict": verdict["kind"],
        "named": named,
        "right": naming and any(names in right for names in named),
        "gained": naming and _gained(answer["name"], named),
        "closed": content["closed"].get("closed"),
        "errors": _errors(answer, content["fits"], named, right),
        "change": content["where"].get("change") or {},
    }
    row["alone"] = (
        verdict["kind"] in ("effect", "together") and bool(named) and not row["right"]
    )
    return row


def _gained(name: str, named: list[list[str]]) -> bool:
    wanted = sorted(GAINED.get(name, ()))
    return bool(wanted) and any(names == wanted for names in named)


def _errors(answer, fits, named, right) -> list[float]:
    """Error of each magnitude over its departure, in the fit that is right."""
    for fit in fits:
        names = sorted(fit["names"])
        if names in right and names in named:
            return [
                abs(float(value) - answer["sizes"][name])
                / abs(answer["sizes"][name] - _nominal(name))
                for name, text in zip(fit["names"], fit["effects"], strict=True)
                if name in answer["sizes"]
                and "saturation" not in name
                and (value := _value(name, text)) is not None
            ]
    return []


def _nominal(name: str) -> float:
    ones = ("gain", "diam", "axle", "scale", "floor_friction", "torque_limit")
    return 1.0 if any(word in name for word in ones) else 0.0


def _value(name: str, text: str) -> float | None:
    """The magnitude in an effect's text: the parameter named, else the first."""
    wanted = name.partition("[")[0].partition(".")[2]
    numbers = dict(re.findall(r"([a-z_]+)=(-?[0-9.eE+-]+)(?:,|$)", text))
    if wanted in numbers:
        return float(numbers[wanted])
    return float(next(iter(numbers.values()))) if numbers else None


def table(rows: list[dict[str, Any]]) -> dict[tuple[str, str], tuple[float, int]]:
    """Figures by part and row of the table, each with the number of cases."""
    made_of = {}
    for part in ("A", "B"):
        own = [row for row in rows if row["part"] == part]
        kinds = {kind: [r for r in own if r["kind"] == kind] for kind in
                 ("single", "none", "pair", "onset", "outside")}  # fmt: skip
        inside = [*kinds["single"], *kinds["pair"], *kinds["onset"]]
        errors = sorted(e for row in inside for e in row.get("errors", ()))
        closed = sorted(row["closed"] for row in (*kinds["single"], *kinds["pair"])
                        if isinstance(row.get("closed"), float))  # fmt: skip
        seconds = sorted(row["seconds"] for row in own)
        made_of |= {
            (part, BARS[0][1]): _rate(kinds["single"], lambda r: r.get("right")),
            (part, BARS[1][1]): _rate(kinds["none"], _claimed),
            (part, BARS[2][1]): _rate(kinds["pair"], lambda r: r.get("right")),
            (part, BARS[3][1]): _rate(kinds["onset"], _dated),
            (part, BARS[4][1]): _rate(kinds["outside"], _outside),
            (part, BARS[5][1]): _rate(inside, lambda r: r.get("alone")),
            (part, BARS[6][1]): (_median(errors), len(errors)),
            (part, BARS[7][1]): (_median(closed), len(closed)),
            (part, "seconds, median"): (_median(seconds), len(seconds)),
        }
    return {key: value for key, value in made_of.items() if value[1]}


def _claimed(row: Mapping[str, Any]) -> bool:
    return row["verdict"] not in ("no gap", "error")


def _outside(row: Mapping[str, Any]) -> bool:
    return row["verdict"] == "none of the library" or bool(row.get("gained"))


def _dated(row: Mapping[str, Any]) -> bool:
    told = re.search(r"from trial (\d+)", row["name"])
    found = row.get("change", {}).get("trial")
    near = told and found is not None and abs(int(told[1]) - found) <= 1
    return bool(row.get("right") and near)


def _rate(rows: list, right) -> tuple[float, int]:
    return sum(bool(right(row)) for row in rows) / max(len(rows), 1), len(rows)


def _median(ordered: list[float]) -> float:
    return ordered[len(ordered) // 2] if ordered else float("nan")


def _line(row: Mapping[str, Any]) -> str:
    mark = {"none": not _claimed(row), "outside": _outside(row), "onset": _dated(row)}
    good = mark.get(row["kind"], bool(row.get("right")))
    return (
        f"{'right' if good else 'WRONG'} {row['id']} {row['kind']} | {row['name']} | "
        f"{row['verdict']} {row['named'][:4]} | closed {row.get('closed')} | "
        f"{row['error'][-120:]} {row['seconds']:.0f} s"
    )


def main() -> None:
    """Score the seeds that are named; print each row beside its bar."""
    parser = argparse.ArgumentParser()
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--only", default="", choices=("", "A", "B"))
    parser.add_argument("--ids", nargs="*", default=())
    given = parser.parse_args()
    rows = []
    for seed in given.seeds:
        rows += scored(seed, only=given.only, ids=given.ids)
    figures = table(rows)
    for part, name, bar in BARS:
        if (part, name) in figures:
            value, count = figures[part, name]
            print(f"{part}  {name:58s} {value:8.3f}  n {count:3d}  {bar}")


if __name__ == "__main__":
    main()
