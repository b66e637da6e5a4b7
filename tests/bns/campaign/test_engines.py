"""Engines of campaigns: their messages, workers, signs of life, and names."""

import threading

import pytest

from bns.campaign.engines import frames, registry
from bns.errors import BnsError


def test_messages_arrive_in_pieces():
    inbox = frames.Inbox()
    data = frames.pack(frames.BEAT, b"12") + frames.pack(frames.DONE, b"x" * 300)
    found = [m for i in range(len(data)) for m in inbox.feed(data[i : i + 1])]
    assert found == [(frames.BEAT, b"12"), (frames.DONE, b"x" * 300)]


def test_a_worker_goes_when_its_driver_goes():
    from bns.campaign.engines.pool import Worker

    worker = Worker()
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


def test_a_batch_hangs_only_once_it_has_started_and_said_nothing_new():
    from bns.campaign.engines.pulse import Pulse, Watch

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


def test_engines_are_found_by_name():
    assert registry.make("local", workers=3).workers == 3
    with pytest.raises(BnsError, match="Did you mean 'local'"):
        registry.make("locl")
    with pytest.raises(BnsError, match="--engine ray"):
        registry.make("local", ray_address="a:1")
    with pytest.raises(BnsError, match="--workers"):
        registry.make("local", workers=-1)
