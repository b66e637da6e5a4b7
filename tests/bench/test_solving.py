"""What benches print of a side, on values whose answer is known."""

import numpy as np

from bench.learning import solving


def test_waiting_times_say_how_many_came():
    found = solving.waits(np.array([3.0, 1.0, np.inf, 2.0, np.inf]))
    assert (found["came"], found["of"], found["median"]) == (3, 5, 3.0)
    assert found["longest"] == 3.0 and found["interval"][1] is None


def test_a_ratio_of_pairs_that_all_have_it_is_sure():
    second = np.arange(1.0, 31.0)
    found = solving.ratio(second / 2, second)
    assert found == {"ratio": 0.5, "ratio interval": [0.5, 0.5]}


def test_the_interval_of_a_ratio_covers_it_at_about_its_nominal_rate():
    rng, covered = np.random.default_rng(0), 0
    for _ in range(60):
        trunk = rng.normal(size=30)
        first = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30) + np.log(0.9))
        second = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30))
        low, high = solving.ratio(first, second)["ratio interval"]
        covered += low <= 0.9 <= high
    assert 52 <= covered <= 60  # 57 expected
