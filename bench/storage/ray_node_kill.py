"""A campaign on a Ray cluster of two local nodes, one of which dies on the way."""

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.result import Result, bench
from bench.storage.campaigns import held, tiny
from bns.campaign import drive
from bns.campaign.engines.base import Beat, Outcome
from bns.campaign.engines.inline import InlineEngine
from bns.campaign.engines.ray_engine import RayEngine
from bns.campaign.plan import Job


class Killing:
    """Ray's engine; after some outcomes a node dies.

    Args:
        cluster: of `ray.cluster_utils`.
        node: of it, to be killed.
        after: outcomes.
    """

    name = "ray"

    def __init__(self, cluster: Any, node: Any, after: int):
        self.cluster, self.node, self.after = cluster, node, after
        self.seen = 0

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Iterator[Outcome]:
        """See `Engine.run`."""
        for outcome in RayEngine(self.cluster.address).run(jobs, beat=beat):
            self.seen += 1
            if self.seen == self.after:
                self.cluster.remove_node(self.node, allow_graceful=False)
            yield outcome


@bench(
    "batches done on two local Ray nodes of which one is killed mid-run",
    bar="all, with the bytes of one process",
)
def ray_node_kill(quick: bool) -> Result:
    """A node of one CPU each; the second is killed after a third of the batches."""
    from ray.cluster_utils import Cluster

    batches = 6 if quick else 16
    campaign = tiny(batches, trials=12)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        node = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        engine = Killing(cluster, node, batches // 3)
        with tempfile.TemporaryDirectory() as name:
            home = Path(name)
            session = drive.run(campaign, home / "ray", engine)
            drive.run(campaign, home / "inline", InlineEngine())
            same = held(home / "ray") == held(home / "inline")
    finally:
        cluster.shutdown()
    return Result(
        figure=session.done,
        unit=f"of {batches}",
        holds=session.done == batches and same,
        n=batches,
        details={
            "failed": dict(session.failed),
            "same bytes as in process": same,
            "batches done when the node was killed": engine.after,
        },
    )
