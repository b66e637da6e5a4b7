"""Trials that sides share: trained once, and nobody can tell."""

from dataclasses import replace

import numpy as np
import pytest

from bns.campaign import trunk, work
from bns.campaign.file import Member
from bns.campaign.part import decode
from bns.claims import schedule
from bns.experiment.config import AdaptationConfig, RunConfig, WorldConfig

DAMAGE = "wheel_gain:wheel=left,factor=0.6@2"


def side(damage: str = DAMAGE, trials: int = 4, **adaptation) -> Member:
    """A small side of investigation A."""
    plain = RunConfig()
    config = replace(
        plain,
        trials=trials,
        replicates=1,
        record_replicates=0,
        compiled="no",
        threads=1,
        evolution=replace(plain.evolution, population=8, generations=1),
        snn=replace(plain.snn, epochs=3),
        world=WorldConfig(damage=(damage,)),
        adaptation=AdaptationConfig(**adaptation),
    )
    return Member("A: x", config)


def figures(data: bytes) -> dict[str, np.ndarray]:
    """The columns of a batch of one configuration."""
    return dict(decode(data, "test").blocks[0].columns)


@pytest.mark.parametrize("reset", ["", "population_reset", "restart"])
def test_a_side_is_the_same_with_and_without_its_trunk(tmp_path, reset):
    plain = side()
    other = side(
        damage=DAMAGE.replace("0.6", "0.3"), **({reset: True} if reset else {})
    )
    first, second = (schedule.job(m, 0, 2, tmp_path) for m in (plain, other))
    assert first.trunk == second.trunk and first.seed == second.seed
    alone = work.run(second)
    assert not (tmp_path / "trunks").exists()
    assert work.run(replace(first, grows=True)) == b""
    grown = (tmp_path / "trunks").stat().st_mtime_ns
    assert work.run(second) == alone
    assert work.run(replace(second, grows=True)) == b""
    assert (tmp_path / "trunks").stat().st_mtime_ns == grown
    before, after = figures(work.run(first)), figures(alone)
    same = [
        np.array_equal(before["fitness"][:, t], after["fitness"][:, t]) for t in (0, 1)
    ]
    assert same == [True, True]
    assert not np.array_equal(before["fitness"][:, 2:], after["fitness"][:, 2:])


def test_sides_that_differ_before_the_damage_share_nothing(tmp_path):
    roots = {
        schedule.job(member, 0, 2, tmp_path).trunk
        for member in (
            side(),
            side(trials=9),  # as long as before, until the damage
            side(window=5),
            side(damage=DAMAGE.replace("@2", "@3")),
        )
    }
    assert len(roots) == 3
    assert schedule.job(side(damage="payload:mass=0.2@0"), 0, 2, tmp_path).trunk == ""


@pytest.mark.parametrize("harm", ["torn", "other seed", "none"])
def test_a_trunk_that_cannot_be_used_is_trained_again(tmp_path, harm):
    job = schedule.job(side(), 0, 2, tmp_path)
    work.run(replace(job, grows=True))
    (path,) = (tmp_path / "trunks").iterdir()
    (config,) = job.configs.values()
    seed, trials = config.seed, trunk.shared(config)
    assert trunk.read(path, seed=seed, trials=trials).trials == 2
    if harm == "torn":
        path.write_bytes(path.read_bytes()[:200])
    elif harm == "none":
        path.unlink()
    assert trunk.read(path, seed=seed + (harm == "other seed"), trials=2) is None


@pytest.mark.parametrize(
    ("runs", "done", "made"),
    [
        (10, 0, [(0, 10)]),
        (30, 0, [(0, 10), (10, 10), (20, 10)]),
        (100, 30, [(30, 20), (50, 50)]),
        (35, 30, [(30, 5)]),
        (50, 35, [(35, 15)]),
        (10, 10, []),
    ],
)
def test_blocks_end_at_the_looks(runs, done, made):
    assert schedule.blocks(runs, done) == made
