"""Campaign files, identities, seeds, plans and shared trials against known answers."""

from dataclasses import replace

import numpy as np
import pytest

from bns.campaign import file, identity, trunk, work
from bns.campaign.file import Member, draw
from bns.campaign.part import decode
from bns.campaign.plan import Job, plan
from bns.claims import schedule
from bns.errors import BnsError
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.loading import from_mapping, to_mapping
from bns.learners.bns.config import AdaptationConfig
from tests.bns.shared import CONTENT, campaign


def test_a_grid_is_every_combination():
    members = campaign().members
    assert [m.label for m in members] == [
        "window=0, mutation_rate=0.1",
        "window=0, mutation_rate=0.2",
        "window=20, mutation_rate=0.1",
        "window=20, mutation_rate=0.2",
    ]
    assert [m.config.adaptation.window for m in members] == [0, 0, 20, 20]
    assert {m.config.trials for m in members} == {3}
    assert campaign().runs == 8


def test_grid_and_list_multiply_and_labels_are_kept():
    entries = [{"label": "plain"}, {"label": "fresh", "adaptation.restart": True}]
    found = campaign(list=entries, grid={"adaptation.window": [0, 5]}).members
    assert [m.label for m in found] == [
        "plain, window=0",
        "fresh, window=0",
        "plain, window=5",
        "fresh, window=5",
    ]
    assert [m.config.adaptation.restart for m in found] == [False, True] * 2


def test_a_grid_over_damage_takes_texts_and_lists():
    damage = ["payload:mass=0.1", ["payload:mass=0.1", "payload:mass=0.2@5"]]
    found = campaign(grid={"world.damage": damage}).members
    assert [len(m.config.world.damage) for m in found] == [1, 2]


def test_a_preset_is_the_base():
    found = file.from_content({"preset": "khepera-simple"}, "x").members
    assert len(found) == 1
    assert found[0].config.adaptation.window == 150


def test_samples_stay_inside_and_more_of_them_keep_the_first():
    ranges = {
        "evolution.mutation_rate": {"low": 0.01, "high": 0.3, "scale": "log"},
        "evolution.population": {"low": 10, "high": 20},
        "evolution.crossover": ["sbx", "uniform"],
    }
    few, many = (draw(ranges, n, 1, "[sample]") for n in (5, 50))
    assert many[:5] == few
    rates = [row["evolution.mutation_rate"] for row in many]
    assert 0.01 <= min(rates) < 0.04 and 0.08 < max(rates) <= 0.3
    assert {type(row["evolution.population"]) for row in many} == {int}
    assert {row["evolution.crossover"] for row in many} == {"sbx", "uniform"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"grid": {"adaptation.windo": [1]}}, "Did you mean 'adaptation.window'"),
        ({"grid": {"adaptation.window": []}}, "has no values"),
        ({"grid": {"adaptation.window": 3}}, "give a list of values"),
        ({"grid": {"seed": [1, 2]}}, "stand at the top"),
        ({"grid": {"adaptation.window": ["x"]}}, "a whole number"),
        ({"grid": {"trials": list(range(1, 30000))}}, r"29,999 conf.*--yes"),
        (
            {"grid": {f"task.{n}": list(range(9999)) for n in ("radius", "penalty")}},
            "99,980,001 configurations",
        ),
        ({"sample": {"count": 10**9, "snn.epochs": [1]}}, "1,000,000,000"),
        ({"sample": {"count": 0, "snn.epochs": [1]}}, "count = 0"),
        ({"sample": {"count": 3}}, "varies nothing"),
        ({"sample": {"count": 3, "snn.epochs": {"low": 9, "high": 1}}}, "no range"),
        ({"list": []}, "nothing to run"),
        ({"list": [{"snn.epoch": 1}]}, "Did you mean 'snn.epochs'"),
        ({"replicates": 0}, "replicates = 0"),
        ({"grids": {}}, "Did you mean 'grid'"),
        ({"preset": "khepera-simpel"}, "Did you mean 'khepera-simple'"),
        ({"settings": {"trials": 0}}, "trials = 0"),
    ],
)
def test_what_is_wrong_is_said(content, words):
    with pytest.raises(BnsError, match=words):
        file.from_content({"settings": {}, **content}, "x")


def test_a_large_campaign_is_taken_when_it_is_meant():
    grid = {"adaptation.window": list(range(1000))}
    with pytest.raises(BnsError, match="30,000 runs"):
        file.from_content({"grid": grid}, "x")
    assert file.from_content({"grid": grid}, "x", sure=True).runs == 30_000


def test_identity_is_of_the_experiment_alone():
    config = RunConfig(trials=7)
    same = from_mapping({"seed": 4, "replicates": 9, "threads": 1}, config)
    assert identity.identity(same) == identity.identity(config)
    other = from_mapping({"snn": {"epochs": 1}}, config)
    assert identity.identity(other) != identity.identity(config)
    assert identity.core(other) != identity.core(config)
    near = from_mapping({"adaptation": {"window": 1}}, config)
    assert identity.core(near) == identity.core(config)


def test_identities_do_not_change_between_versions():
    # a changed default or digest would orphan every store: see identity.py
    assert identity.identity(RunConfig()) == "44136fa355b3"
    assert identity.identity(RunConfig(trials=7)) == "cf4cb4b54e2c"


def test_a_changed_default_is_noticed():
    stored = from_mapping({"snn": {"epochs": 300}})
    assert identity.changed_default(RunConfig(), stored) == (
        "snn.epochs = 300, now 400"
    )
    assert identity.changed_default(RunConfig(), RunConfig(seed=3)) == ""


def test_settings_of_other_learners_are_no_part_of_it():
    other = from_mapping({"light": {"goal": 0.9}})
    assert identity.identity(other) == identity.identity(RunConfig())
    assert identity.changed_default(RunConfig(), other) == ""
    mine = from_mapping({"learner": "light", "light": {"goal": 0.9}})
    plain = from_mapping({"learner": "light"})
    assert identity.identity(mine) != identity.identity(plain)
    assert "light.goal = 0.9" in identity.changed_default(plain, mine)


@pytest.mark.parametrize(
    "watch, part",
    [
        ({"forget_factor": 3.0, "threshold": 9.0}, False),
        ({"forget": True, "threshold": 9.0}, False),
        ({"forget": True, "forget_factor": 3.0}, True),
        ({"detect": True, "forget_factor": 3.0}, False),
        ({"detect": True, "threshold": 9.0}, True),
    ],
)
def test_settings_that_do_nothing_are_no_part_of_it(watch, part):
    switches = {name: on for name, on in watch.items() if on is True}
    config, plain = (from_mapping({"watch": given}) for given in (watch, switches))
    assert (identity.identity(config) != identity.identity(plain)) is part
    assert bool(identity.changed_default(plain, config)) is part


def test_members_that_differ_in_adaptation_share_a_batch():
    jobs = plan(campaign(), {})
    assert [len(job.configs) for job in jobs] == [2, 2]
    for job in jobs:
        rates = {c.evolution.mutation_rate for c in job.configs.values()}
        assert len(rates) == 1
        assert {c.adaptation.window for c in job.configs.values()} == {0, 20}
        assert {c.seed for c in job.configs.values()} == {job.seed}
    assert len({job.seed for job in jobs}) == 2


def test_the_order_in_the_file_changes_nothing():
    turned = {name: values[::-1] for name, values in CONTENT["grid"].items()
              if isinstance(values, list)}  # fmt: skip
    turned["adaptation"] = {"window": [20, 0]}
    assert plan(campaign(grid=turned), {}) == plan(campaign(), {})


def test_a_member_alone_has_seeds_of_its_own():
    few = campaign(batch_runs=2)
    fewer = campaign(batch_runs=2, grid={"adaptation.window": [20]})
    keys = {job.key: job.seed for job in plan(few, {})}
    assert len(keys) == 4
    for job in plan(fewer, {}):
        assert keys.get(job.key) == job.seed


def test_more_replicates_are_added_to_those_that_are_there():
    more = campaign(replicates=7)
    done = {member.identity: 2 for member in more.members}
    jobs = plan(more, done)
    assert {(job.start, job.count) for job in jobs} == {(2, 4), (6, 1)}
    assert sum(len(job.configs) * job.count for job in jobs) == 4 * 5
    assert plan(more, {member.identity: 7 for member in more.members}) == []


def test_another_seed_makes_other_batches():
    one, other = plan(campaign(), {}), plan(campaign(seed=1), {})
    assert not {job.seed for job in one} & {job.seed for job in other}
    assert not {job.key for job in one} & {job.key for job in other}


def test_a_job_is_plain_values():
    for job in plan(campaign(), {}):
        assert Job.from_mapping(job.to_mapping()) == job
        for config in job.configs.values():
            assert from_mapping(to_mapping(config)) == config


def test_learners_are_compared_in_one_campaign_each_with_its_own_settings(tmp_path):
    path = tmp_path / "learners.toml"
    path.write_text(
        'name = "learners"\npreset = "khepera-simple"\nreplicates = 2\n'
        "[settings]\ntrials = 4\nevolution.generations = 3\n"
        '[[list]]\nlabel = "a"\nlearner = "bns"\n'
        '[[list]]\nlabel = "b"\nlearner = "cma"\nsettings.population = 4\n'
    )
    one, other = (member.config for member in file.read(path).members)
    assert (one.learner, one.evolution.generations) == ("bns", 3)
    assert (other.learner, other.settings.population) == ("cma", 4)
    assert identity.identity(one) != identity.identity(other)
    part_of_it = identity.settings(other)
    assert "settings.population" in part_of_it
    assert not any(name.startswith("evolution.") for name in part_of_it)


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
