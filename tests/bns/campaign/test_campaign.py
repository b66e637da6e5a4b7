"""Campaigns that run: engines, stores, failures, and what is read from them."""

import json
import os
import signal
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from bns.campaign import drive, results
from bns.campaign.engines import pool, registry
from bns.campaign.engines.pool import PoolEngine
from bns.campaign.engines.registry import InlineEngine, Outcome
from bns.campaign.plan import plan
from bns.campaign.store import CampaignStore, merge
from bns.campaign.table import table
from bns.errors import BnsError, FormatError
from bns.storage import files, reading
from tests.bns.shared import campaign, contents

TIMES = ("log.jsonl",)


def held(directory):
    """All bytes of a store but wall times."""
    found = contents(directory)
    return {name: data for name, data in found.items() if name not in TIMES}


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """The store of a campaign that nothing disturbed."""
    out = tmp_path_factory.mktemp("campaign") / "clean"
    with pytest.MonkeyPatch.context() as patch:  # as `conftest` does in each test
        patch.setattr("bns.experiment.versions.commit", lambda: "test")
        session = drive.run(campaign(), out, InlineEngine())
    assert (session.done, session.failed, session.missing) == (2, {}, 0)
    return out


class FailingEngine:
    """Runs the first batch and loses the others."""

    name = "failing"

    def run(self, jobs, *, beat):
        for number, outcome in enumerate(InlineEngine().run(jobs, beat=beat)):
            yield outcome if number == 0 else Outcome(outcome.key, None, "no luck")


def records(out):
    found = results.records(
        CampaignStore.open(out), {m.identity for m in campaign().members}
    )
    return {m.label: found.get(m.identity) for m in campaign().members}


def test_every_run_is_there_once(clean):
    for record in records(clean).values():
        assert (record.replicates, record.trials) == (2, 3)
        assert record.damage_onset.tolist() == [1, 1]
        assert np.isfinite(record["fitness"]).all()
    assert not (clean / "parts").exists()


def test_the_pool_gives_the_same_bytes(clean, tmp_path):
    drive.run(campaign(), tmp_path / "pool", PoolEngine(2))
    assert held(tmp_path / "pool") == held(clean)


def test_stopped_and_resumed_gives_the_same_bytes(clean, tmp_path):
    out = tmp_path / "run"
    session = drive.run(campaign(), out, InlineEngine(), stop=lambda: True)
    assert (session.done, session.missing) == (1, 1)
    assert sum(r is not None for r in records(out).values()) == 2
    drive.run(campaign(), out, InlineEngine(), resume=True)
    assert held(out) == held(clean)
    again = drive.run(campaign(), out, InlineEngine(), resume=True)
    assert again.done == 0
    assert held(out) == held(clean)


def test_a_failure_is_kept_with_its_reason_and_tried_again_on_demand(clean, tmp_path):
    out = tmp_path / "run"
    session = drive.run(campaign(), out, FailingEngine())
    assert list(session.failed.values()) == ["no luck"]
    (entry,) = CampaignStore.open(out).failures().values()
    assert entry["reason"] == "no luck"
    session = drive.run(campaign(), out, InlineEngine(), resume=True)
    assert (session.done, session.waiting) == (0, 1)
    session = drive.run(campaign(), out, InlineEngine(), resume=True, retry=True)
    assert (session.done, session.waiting, session.failed) == (1, 0, {})
    assert held(out) == held(clean)


def test_replicates_added_later_leave_the_first_as_they_are(clean, tmp_path):
    out = tmp_path / "run"
    drive.run(campaign(), out, InlineEngine())
    drive.run(campaign(replicates=3), out, InlineEngine(), resume=True)
    for label, before in records(clean).items():
        after = records(out)[label]
        assert after.replicates == 3
        np.testing.assert_array_equal(after["fitness"][:2], before["fitness"])
        assert not np.array_equal(after["fitness"][2], before["fitness"][0])


def test_it_can_be_read_while_it_grows_and_while_it_is_compacted(clean, tmp_path):
    out = tmp_path / "run"
    drive.run(campaign(), out, FailingEngine())
    store = CampaignStore.open(out)
    reading = store.read()
    first = next(iter(reading)).key
    whole = CampaignStore.open(clean)
    for part in whole.read():
        from bns.campaign.part import encode

        store.add(part.key, encode(part))
    assert [part.key for part in store.read()] == [part.key for part in whole.read()]
    reading = store.read()
    next(iter(reading))
    store.compact()
    assert len(list(reading)) == 1 and first in [p.key for p in store.read()]
    assert (out / "results.parquet").read_bytes() == (
        clean / "results.parquet"
    ).read_bytes()


def test_results_open_in_other_tools(clean):
    import pyarrow.parquet as pq

    found = pq.read_table(clean / "results.parquet")
    assert found.num_rows == 4 * 2 * 3
    assert {"config", "replicate", "trial", "fitness_best"} <= set(found.column_names)


LONG = {
    "trials": 12,
    "compiled": "no",
    "evolution": {"population": 8, "generations": 1},
    "snn": {"epochs": 2},
}


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_worker_costs_only_its_own_batch(tmp_path, blow):
    """One worker is killed, or stopped for good, in the middle of its batch."""
    long = campaign(grid={"adaptation.window": [0, 20]}, settings=LONG, batch_runs=2)
    jobs = plan(long, {})
    engine = PoolEngine(1, patience=240.0)
    struck = []

    def beat(key, trials):
        engine.patience = 240.0
        if trials > 0 and not struck:
            struck.append(key)
            os.kill(engine.crew[0].process.pid, blow)
            engine.patience = 8.0  # until the next worker gives a sign of life

    outcomes = list(engine.run(jobs, beat=beat))
    assert sorted(o.key for o in outcomes if o.data) == [job.key for job in jobs]
    attempts = {outcome.key: outcome.attempts for outcome in outcomes}
    assert attempts.pop(struck[0]) >= 2
    if blow == signal.SIGKILL:
        assert list(attempts.values()) == [1]
    assert len(struck) == 1


def test_a_batch_that_kills_every_worker_is_given_up(monkeypatch, tmp_path):
    import sys

    monkeypatch.setattr(sys, "executable", "/bin/false")
    session = drive.run(campaign(), tmp_path / "run", PoolEngine(2, attempts=3))
    assert session.done == 0
    assert all("worker lost: exit code 1" in r for r in session.failed.values())
    entries = CampaignStore.open(tmp_path / "run").failures().values()
    assert [entry["attempts"] for entry in entries] == [3, 3]


def test_a_batch_that_raises_takes_nothing_with_it(monkeypatch, tmp_path):
    from bns.campaign import work

    def run(job, beat):
        raise ArithmeticError("went away")

    monkeypatch.setattr(work, "run", run)
    session = drive.run(campaign(), tmp_path / "run", InlineEngine())
    assert set(session.failed.values()) == {"ArithmeticError: went away"}


def test_other_seed_other_version_other_schema_are_refused(clean, tmp_path):
    with pytest.raises(BnsError, match="seed = 0, the file says 5"):
        drive.run(campaign(seed=5), clean, InlineEngine(), resume=True)
    with pytest.raises(BnsError, match="--resume"):
        drive.run(campaign(), clean, InlineEngine())
    out = tmp_path / "other"
    CampaignStore.create(out, "tiny", 0)
    head = json.loads((out / "campaign.json").read_text())
    files.write_json(out / "campaign.json", {**head, "schema": 99})
    with pytest.raises(FormatError, match="install a newer bns"):
        drive.run(campaign(), out, InlineEngine(), resume=True)
    versions = {**head["versions"], "torch": "1.0"}
    files.write_json(out / "campaign.json", {**head, "versions": versions})
    with pytest.raises(BnsError, match=r"made with torch 1.0.*--mix"):
        drive.run(campaign(), out, InlineEngine(), resume=True)
    assert drive.run(campaign(), out, InlineEngine(), resume=True, mix=True).done == 2


class SecondDriver:
    """While it runs, another driver tries to write the same store."""

    name = "second"

    def __init__(self, out):
        self.out = out

    def run(self, jobs, *, beat):
        with pytest.raises(BnsError, match="written by another process"):
            drive.run(campaign(), self.out, InlineEngine(), resume=True)
        yield from InlineEngine().run(jobs, beat=beat)


def test_two_drivers_cannot_write_one_store(tmp_path):
    session = drive.run(campaign(), tmp_path / "run", SecondDriver(tmp_path / "run"))
    assert session.done == 2


def test_what_two_machines_ran_is_put_together_to_the_same_bytes(clean, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    drive.run(campaign(), here, InlineEngine(), stop=lambda: True)
    drive.run(campaign(), there, InlineEngine())
    before = held(there)
    assert held(here) != held(clean)
    assert merge(here, [there]) == 4
    assert held(here) == held(clean)
    assert held(there) == before
    assert merge(here, [there]) == 0


def test_what_does_not_belong_together_is_not_put_together(clean, tmp_path):
    other = tmp_path / "other"
    drive.run(campaign(seed=1), other, InlineEngine(), stop=lambda: True)
    with pytest.raises(BnsError, match="seed = 0"):
        merge(other, [clean])
    with pytest.raises(BnsError, match="given twice"):
        merge(clean, [clean])
    head = reading.read_json(other / "campaign.json")
    head["seed"], head["versions"]["mujoco"] = 0, "1.0"
    files.write_json(other / "campaign.json", head)
    with pytest.raises(BnsError, match="another mujoco"):
        merge(other, [clean])
    assert merge(other, [clean], mix=True) == 4  # of eight; it has the first four


def test_the_table_compares_members_that_differ_in_one_setting(clean):
    found = results.Results(
        campaign(),
        CampaignStore.open(clean),
        results.records(
            CampaignStore.open(clean), {m.identity for m in campaign().members}
        ),
    )
    made = table(found)
    assert [row.runs for row in made.rows] == [2] * 4
    assert len(made.pairs) == 4  # of 6: the diagonals differ in two settings
    assert all(pair.p_holm >= pair.p for pair in made.pairs)


def test_progress_counts_what_runs_and_estimates_the_rest():
    from bns.campaign.drive import Progress
    from bns.progress import duration

    jobs = plan(campaign(), {})
    shown = Progress("x", jobs, 0, enabled=False)
    assert shown.left() == float("inf")
    shown.began = time.monotonic() - 10
    shown.beat(jobs[0].key, 1)  # a third of one of two batches
    assert shown.left() == pytest.approx(50, rel=0.01)
    shown.end(jobs[0].key, failed=False)
    assert shown.left() == pytest.approx(10, rel=0.01)
    assert "50 %, 1 of 2 batches" in shown.text()
    assert duration(8000) == "about 2 h 13 min"


def test_messages_arrive_in_pieces():
    inbox = pool.Inbox()
    data = pool.pack(pool.BEAT, b"12") + pool.pack(pool.DONE, b"x" * 300)
    found = [m for i in range(len(data)) for m in inbox.feed(data[i : i + 1])]
    assert found == [(pool.BEAT, b"12"), (pool.DONE, b"x" * 300)]


def test_a_worker_goes_when_its_driver_goes():
    worker = pool.Worker()
    threading.Timer(0.2, worker.input.close).start()
    assert worker.process.wait(timeout=30) == 0
    worker.stop()


def test_ray_that_is_not_there_and_addresses_that_are_none(monkeypatch):
    import sys

    from bns.campaign.engines import ray_engine

    for address in ("nowhere", "host:99999999", "host:"):
        with pytest.raises(BnsError, match="HOST:PORT"):
            ray_engine.answers(address)
    with pytest.raises(BnsError, match="Nobody answers"):
        ray_engine.answers("127.0.0.1:9")
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(BnsError, match=r"pip install 'bns-testbed\[ray\]'"):
        list(ray_engine.RayEngine().run([], beat=lambda key, trials: None))


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (Exception("The current node timed out during startup."), BnsError),
        (Exception("something else"), Exception),
        (RuntimeError("it timed out during startup"), RuntimeError),
    ],
)
def test_ray_that_starts_too_late_is_told_of_and_nothing_else(monkeypatch, error, said):
    import sys

    from bns.campaign.engines.ray_engine import RayEngine

    def init(**words):
        raise error

    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(init=init))
    with pytest.raises(Exception, match=r"timed out|something else") as caught:
        list(RayEngine().run([], beat=lambda key, trials: None))
    assert caught.type is said


def test_a_batch_hangs_only_once_it_has_started_and_said_nothing_new():
    from bns.campaign.engines.ray_engine import Pulse, Watch

    now, pulse = [0.0], Pulse()
    watch = Watch(10.0, clock=lambda: now[0])
    pulse.beat("a", 0)
    assert watch.news(pulse.all()) == {"a": 0}
    now[0] = 9.0
    pulse.beat("a", 1)
    assert watch.news(pulse.all()) == {"a": 1}
    now[0] = 18.0
    assert watch.news(pulse.all()) == {} and watch.hanging() == []
    now[0] = 19.5
    assert watch.hanging() == ["a"]
    watch.forget("a")
    assert watch.hanging() == []


def test_a_batch_that_computes_for_long_says_so_and_one_that_waits_does_not():
    from bns.campaign import work

    said = []
    with work.pulsing(said.append, every=0.05) as told:
        told(3)
        before = time.process_time()
        while time.process_time() - before < 0.5:
            sum(range(1000))
    assert said.count(3) > 1 and set(said) == {3}
    said.clear()
    with work.pulsing(said.append, every=0.05):
        time.sleep(0.5)
    assert len(said) <= 1  # what the thread itself computes is next to nothing


def test_engines_are_found_by_name():
    assert registry.make("local", workers=3).workers == 3
    with pytest.raises(BnsError, match="Did you mean 'local'"):
        registry.make("locl")
    with pytest.raises(BnsError, match="--engine ray"):
        registry.make("local", ray_address="a:1")
    with pytest.raises(BnsError, match="--workers"):
        registry.make("local", workers=-1)
