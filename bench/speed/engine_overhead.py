"""What engines and the store cost beside computing the batches."""

import json
import tempfile
from pathlib import Path
from statistics import median

from bench.result import Result, bench
from bench.storage.campaigns import tiny
from bns.campaign import drive
from bns.campaign.engines import registry
from bns.campaign.file import Campaign, from_content

LIMIT = 2.0
ENGINES = ("local", "ray")


@bench(
    "time per batch beside its computation, one worker, batches of demo size",
    bar="<= 2 % of the batch's time",
)
def engine_overhead(quick: bool) -> Result:
    """From the end of one batch to the end of the next, less what it computed.

    That holds giving out the job, the way back, storing with fsync, and the log. The
    first batch, in which the worker starts, is left out. Medians; the figure is the
    worse engine's.
    """
    batches = 4 if quick else 8
    details: dict[str, object] = {}
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        for engine in ENGINES:
            found = _measure(engine, _demo(batches, quick), Path(name) / engine)
            details[f"{engine}, batches of demo size"] = found
            worst = max(worst, found["percent"])
            small = _measure(engine, tiny(2 * batches), Path(name) / f"{engine}-small")
            details[f"{engine}, tiny batches"] = small
    return Result(
        figure=round(worst, 3),
        unit="%",
        holds=None if quick else worst <= LIMIT,
        n=batches - 1,
        details=details,
    )


def _demo(batches: int, quick: bool) -> Campaign:
    """Six runs a batch with the demo's evolution and training."""
    settings = {
        "trials": 4 if quick else 6,
        "world": {"damage": ["wheel_gain:wheel=left,factor=0.8@2"]},
    }
    content = {
        "preset": "demo",
        "replicates": 6,
        "batch_runs": 6,
        "settings": settings,
        "grid": {"adaptation": {"window": list(range(100, 100 + batches))}},
    }
    return from_content(content, "demo")


def _measure(engine: str, campaign: Campaign, out: Path) -> dict[str, float]:
    session = drive.run(campaign, out, registry.make(engine, workers=1))
    if session.failed or session.missing:
        raise RuntimeError(f"{engine}: {session}")
    lines = [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
    entries = [entry for entry in lines if "batch" in entry]
    ends = [entry["at"] for entry in entries]
    computed = [entry["computed"] for entry in entries][1:]
    beside = [
        later - earlier - own
        for earlier, later, own in zip(ends, ends[1:], computed, strict=False)
    ]
    shares = [100 * b / c for b, c in zip(beside, computed, strict=True)]
    return {
        "percent": round(median(shares), 3),
        "milliseconds": round(1000 * median(beside), 2),
        "computed seconds": round(median(computed), 2),
    }
