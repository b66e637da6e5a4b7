"""In process, local pool and Ray: the same bytes?"""

import tempfile
from hashlib import sha256
from pathlib import Path

from bench.result import Result, bench
from bench.storage.campaigns import held, tiny
from bns.campaign import drive
from bns.campaign.engines import registry
from bns.errors import MissingDependencyError

ENGINES = ("inline", "local", "ray")


@bench(
    "engines whose stores hold the same bytes: in process, local pool of 2, Ray",
    bar="3 of 3",
)
def engines_agree(quick: bool) -> Result:
    """One campaign on each; members alone in a batch, and sharing one."""
    members = 3 if quick else 6
    digests: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as name:
        for engine in ENGINES:
            try:
                digests[engine] = _digest(engine, members, Path(name))
            except MissingDependencyError as error:
                digests[engine] = f"not run: {error}"
    same = sum(digest == digests["inline"] for digest in digests.values())
    return Result(
        figure=same,
        unit=f"of {len(ENGINES)}",
        holds=same == len(ENGINES),
        n=members,
        details=digests,
    )


def _digest(engine: str, members: int, home: Path) -> str:
    """A digest of the two stores that an engine makes."""
    total = sha256()
    for shared, replicates in ((False, 3), (True, 1)):
        out = home / f"{engine}-{shared}"
        campaign = tiny(members, replicates=replicates)
        if shared:
            from dataclasses import replace

            campaign = replace(campaign, batch_runs=4)
        session = drive.run(campaign, out, registry.make(engine, workers=2))
        if session.failed or session.missing:
            raise RuntimeError(f"{engine}: {session}")
        for path, data in held(out).items():
            total.update(path.encode() + data)
    return total.hexdigest()[:16]
