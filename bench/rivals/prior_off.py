"""What the fixed gap of the prior costs the walks of its repertoire."""

from dataclasses import replace

import numpy as np

from bench.result import Result, bench
from bns import presets

LEAST, MOST, BEST = 0.20, 0.30, 20


@bench(
    "loss of the best walks of the repertoire in the world of the prior P2",
    bar="0.20 to 0.30 (median of the best twenty)",
)
def prior_off(quick: bool) -> Result:
    """The best of the map in both worlds; quick: five of them."""
    from bns.prior import mismatch, repertoire
    from bns.tasks import registry as tasks
    from bns.worlds import registry as worlds

    found = repertoire.read("phantomx-1")
    task = tasks.of(replace(presets.load("hexapod-walk"), threads=1))
    rows = np.argsort(-found.worth)[: 5 if quick else BEST]
    tried = found.space(task).controllers(found.vectors(task)[rows])
    told = {"robot": "phantomx", "threads": 1}
    gap = mismatch.reality("phantomx")
    exact, off = (
        task.worth(worlds.make("hexapod", **told, reality=reality).run(tried))
        for reality in ((), gap)
    )
    loss = float(1 - np.median(off / exact))
    return Result(
        figure=round(loss, 4),
        unit="1",
        holds=None if quick else LEAST <= loss <= MOST,
        n=len(rows),
        details={
            "in the nominal world [m]": exact.round(3).tolist(),
            "with the gap [m]": off.round(3).tolist(),
            "gap": list(gap),
            "evaluations of the map": found.head.evaluations,
        },
    )
