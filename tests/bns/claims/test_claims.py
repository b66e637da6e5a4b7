"""Claims as data, the rule of verdicts, and what runs say of them."""

import csv
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bench.learning import experiments
from bns import presets, stats
from bns.campaign.identity import identity
from bns.campaign.part import Block
from bns.claims import measures, schedule, verdict
from bns.claims.claim import Cell, claims, content, find, lacking, member_of
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from tests.sources import ROOT

CELLS = [(claim, cell) for claim in claims().values() for cell in claim.cells]


def test_there_are_157_claims():
    count = Counter(claim.investigation for claim in claims().values())
    assert count == {"A": 28, "B": 53, "C": 41, "D": 35}
    assert Counter(c.kind for c in claims().values())["R"] == 20
    assert [*claims()] == [f"{i}{n}" for i in "ABCD" for n in range(1, count[i] + 1)]


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_a_claim_is_tested_or_says_why_not(claim):
    assert bool(claim.cells) != bool(claim.untested)
    assert claim.kind in ("S", "N") or claim.reading or claim.untested
    assert len({cell.text for cell in claim.cells}) == len(claim.cells)
    for cell in claim.cells:
        assert cell.says in (">", "<", "=", "?")
        assert bool(cell.b) == (cell.at_most is None and cell.at_least is None)
        for name in (cell.measure, cell.measure_b or cell.measure):
            assert measures.measure(name).doc
        for side in cell.sides:
            assert set(side.split()) <= set(content(claim.investigation)["pieces"])


def test_p_values_are_those_of_the_tables():
    with open(ROOT / "bench" / "claims" / "p_values.csv") as file:
        printed = Counter(row["p"] for row in csv.DictReader(file))
    assert sum(printed.values()) == 178
    own = [cell for _, cell in CELLS if not cell.variant]
    used = Counter(cell.p for cell in own if cell.p[0].isdigit())
    assert not used - printed
    assert sum(used.values()) == 163  # 15 cells of the tables belong to no claim


def test_the_sides_of_a15_are_those_of_the_benches():
    for window in (0, 150, 300):
        piece = f" window-{window}" if window else ""
        given = {"window": window} if window else {}
        ours = member_of("A", f"left-20{piece}", world="mujoco").identity
        assert ours == identity(experiments.damaged("left-20", **given))
    short = replace(experiments.undamaged("infinity"), trials=24)  # A6 asks no more
    ours = member_of("A", "undamaged-infinity", world="mujoco").identity
    assert ours == identity(short)


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_every_side_can_run_in_the_physics_a_and_d_in_the_static_world_too(claim):
    letter = claim.investigation
    if content(letter)["preset"] not in presets.names():
        pytest.skip(f"no preset {content(letter)['preset']}")
    for cell in claim.cells:
        assert lacking(letter, cell, world="mujoco") == "", cell.text
        if letter in "AD":
            assert lacking(letter, cell, world="static-snn") == "", cell.text


@pytest.mark.parametrize("claim", claims().values(), ids=lambda claim: claim.id)
def test_two_sides_of_a_comparison_differ(claim):
    if content(claim.investigation)["preset"] not in presets.names():
        pytest.skip(f"no preset {content(claim.investigation)['preset']}")
    for cell in claim.cells:
        if cell.b and not cell.measure_b:
            names = {
                member_of(claim.investigation, side, world="mujoco").identity
                for side in cell.sides
            }
            assert len(names) == 2, cell.text


@pytest.mark.parametrize(
    ("says", "share", "p", "holm", "alike", "said"),
    [
        (">", 0.7, 0.01, 0.90, 1.0, "holds"),
        (">", 0.6, 0.20, 1.00, 1.0, "direction only"),
        (">", 0.4, 0.20, 1.00, 1.0, "null"),
        (">", 0.5, 0.01, 0.01, 1.0, "null"),
        (">", 0.3, 0.01, 0.04, 1.0, "reversed"),
        (">", 0.3, 0.01, 0.06, 1.0, "null"),
        ("<", 0.3, 0.01, 0.90, 1.0, "holds"),
        ("<", 0.7, 0.01, 0.04, 1.0, "reversed"),
        ("=", 0.5, 0.90, 1.00, 0.01, "holds"),
        ("=", 0.5, 0.90, 1.00, 0.045, "null"),
        ("=", 0.7, 0.01, 0.06, 1.0, "null"),
        ("=", 0.7, 0.01, 0.04, 1.0, "reversed"),
        ("=", 0.55, 0.01, 0.04, 0.03, "holds"),
        ("?", 0.3, 0.01, 1.00, 1.0, "holds"),
        ("?", 0.3, 0.10, 1.00, 1.0, "null"),
    ],
)
def test_the_rule(says, share, p, holm, alike, said):
    assert verdict.verdict(says, share, p, holm, equivalent=alike) == said


@pytest.mark.parametrize(
    ("says", "share", "p", "alike", "stopped"),
    [
        (">", 0.9, 0.04, 1.0, True),
        (">", 0.1, 0.04, 1.0, False),  # to be reversed asks for more
        (">", 0.1, 0.0002, 1.0, True),
        ("<", 0.1, 0.04, 1.0, True),
        (">", 0.5, 0.9, 0.03, True),
        ("?", 0.1, 0.04, 1.0, True),
        ("=", 0.5, 0.9, 0.04, False),  # equivalence at the last look alone
        ("=", 0.9, 0.04, 1.0, False),
        ("=", 0.9, 0.0002, 1.0, True),
    ],
)
def test_what_a_look_decides(says, share, p, alike, stopped):
    assert verdict.stops(says, share, p, alike) == stopped


def test_clear_comparisons_stop_early_and_close_ones_go_on():
    rng = np.random.default_rng(1)
    low, high = rng.normal(size=100), rng.normal(size=100)
    cell = Cell(a="x", b="y")
    clear = verdict.examine(cell, high + 9, low, verdict.design(cell))
    assert (clear.runs, clear.stopped, clear.verdict) == ((10, 10), True, "holds")
    assert clear.p == pytest.approx(10 * clear.p_look)
    close = verdict.examine(cell, high + 0.3, low, verdict.design(cell))
    assert min(close.runs) > 30
    part = verdict.examine(cell, high[:25] + 0.3, low[:27], verdict.design(cell))
    assert (part.runs, part.stopped) == ((20, 20), False)
    few = verdict.examine(cell, high[:4] + 9, low[:4], verdict.design(cell))
    assert (few.runs, few.stopped) == ((4, 4), False)


def test_a_claimed_null_is_tested_for_equivalence_at_100_runs():
    values = np.arange(100.0)
    cell = Cell(a="x", b="y", says="=")
    same = verdict.examine(cell, values, values, verdict.design(cell))
    assert (same.runs, same.stopped, same.verdict) == ((100, 100), True, "holds")
    early = verdict.examine(cell, values[:50], values[:50], verdict.design(cell))
    assert not early.stopped
    far = verdict.examine(cell, values + 1000, values, verdict.design(cell))
    assert far.runs == (20, 20)  # ten cannot reach Holm's level
    (far,) = verdict.adjusted([far])
    assert far.verdict == "reversed"


def test_a_variant_counts_for_nothing():
    values = np.arange(30.0)
    good = verdict.examine(
        Cell(a="x", b="y"), values + 99, values, verdict.design(Cell(a="x", b="y"))
    )
    beside = Cell(a="x", b="y", variant="another reading")
    bad = verdict.examine(beside, values, values + 99, verdict.design(beside))
    assert bad.runs == (20, 20) or bad.runs == (30, 30)
    first, second = verdict.adjusted([good, bad])
    assert first.p_holm == good.p  # one of one
    assert verdict.of_claim("S", [first, second]) == "holds"


def values(runs):
    """The measures of runs, as `verdict.judge` takes them."""
    return partial(measures.of, runs)


def record(cost, *, onset=2, solved=None):
    """Runs with the given costs, ``(R, T)``."""
    cost = np.array(cost, dtype=float)
    columns = {
        "fitness_best": cost,
        "solved": np.zeros_like(cost) if solved is None else np.array(solved, float),
        "snn_forward": cost / 100,
        "diversity_41": cost[:, ::-1].copy(),
    }
    config = RunConfig(replicates=len(cost), trials=cost.shape[1])
    return Block("x", config, 0, onset, columns).record()


def test_a_claim_has_the_least_favourable_verdict_of_its_kind():
    worse, better = np.full((30, 4), 9.0), np.full((30, 4), 1.0)
    worse += np.arange(30)[:, None] * 1e-3
    better += np.arange(30)[:, None] * 1e-3
    better, worse = values(record(better)), values(record(worse))
    won = verdict.judge(Cell(a="x", b="y"), better, worse)
    lost = verdict.judge(Cell(a="x", b="y", says="="), better, worse)
    won, lost = verdict.adjusted([won, lost])
    assert (won.verdict, lost.verdict) == ("holds", "reversed")
    assert won.share.value == 1.0 and won.p < 0.01 and won.runs == (10, 10)
    assert verdict.of_claim("S", [won, lost]) == "holds"
    assert verdict.of_claim("N", [won, lost]) == "reversed"
    assert verdict.of_claim("Q", [won, lost]) == "reversed"
    assert verdict.of_claim("N", [won]) == "holds"


def test_more_of_what_is_neither_good_nor_bad():
    low, high = (values(record(np.full((5, 4), cost))) for cost in (1.0, 3.0))
    more = verdict.judge(Cell(a="x", b="y", measure="diversity41-end"), high, low)
    assert more.share.value == 1.0
    less = verdict.judge(Cell(a="x", b="y", measure="end"), high, low)
    assert less.share.value == 0.0


def test_a_side_against_a_number():
    solved = np.zeros((30, 6))
    solved[:24, 3] = 1  # 24 of 30 recover within 2 trials from the damage in trial 2
    runs = values(record(np.ones((30, 6)), solved=solved))
    found = verdict.judge(Cell(a="x", measure="recover", at_most=2), runs, None)
    assert found.share.value == 1.0 and found.verdict == "holds"
    assert found.runs == (10,) and found.p_look == pytest.approx(2 / 2**10)
    never = verdict.judge(Cell(a="x", measure="recover", at_least=3), runs, None)
    assert never.share.value == 0.0 and never.runs == (20,)
    (never,) = verdict.adjusted([never])
    assert never.verdict == "reversed"


def test_measures_by_hand():
    cost = [[1, 2, 30, 4, 5, 6], [1, 1, 10, 10, 10, 10]]
    runs = record(cost)
    assert measures.of(runs, "before").tolist() == [3, 2]
    assert measures.of(runs, "before-10").tolist() == [1.5, 1]
    assert measures.of(runs, "after").tolist() == [11.25, 10]
    assert measures.of(runs, "next").tolist() == [4, 10]
    assert measures.of(runs, "end").tolist() == [8, 7]
    assert measures.of(runs, "snn-first").tolist() == [0.01, 0.01]
    assert measures.of(runs, "diversity41-next").tolist() == [30, 10]
    assert measures.of(runs, "observation").tolist() == [45, 40]
    assert measures.of(runs, "snn-onset").tolist() == [0.3, 0.1]
    whole = record(cost, onset=-1)
    assert np.isnan(measures.of(whole, "after")).all()
    after, whole = Cell(a="x", b="y", measure="after"), values(whole)
    assert verdict.judge(after, whole, whole) is None
    with pytest.raises(BnsError, match="diversity_73"):
        measures.of(runs, "diversity73-end")


def test_the_onset_of_improvement_is_where_a_fifth_is_made_up():
    calm, high = [10.0] * 10, [100.0] * 20
    falling = list(np.linspace(100, 10, 10))
    runs = record([calm + high + falling, calm + high + [100.0] * 10], onset=10)
    # smoothed over five trials, 82 or less for the first time from trial 30 on
    assert measures.of(runs, "onset-of-improvement").tolist() == [30.0, np.inf]


def test_the_peak_is_placed_by_the_other_runs():
    cost = np.full((3, 20), 1.0)
    cost[:, 8:13] = 9.0  # damage at 5, worst from 8 to 12
    cost[0, 15:20] = 99.0  # one run's own accident
    runs = record(cost, onset=5)
    assert measures.of(runs, "peak")[0] == 9.0


def test_nothing_but_noise_is_no_improvement():
    rng = np.random.default_rng(3)
    noise = record(rng.normal(size=(100, 100)), onset=30)
    cell = Cell(a="x", b="x", measure="end", measure_b="peak")
    found = verdict.judge(cell, values(noise), values(noise))
    assert found.share.low < 0.5 < found.share.high
    own = np.array([c[30:].max() for c in noise["fitness_best"]])
    assert stats.a12_value(own, measures.of(noise, "end")) > 0.99  # a run's own worst


def with_columns(onset, **columns):
    """Runs with the given columns, each ``(R, T)``."""
    arrays = {name: np.array(values, float) for name, values in columns.items()}
    runs, trials = next(iter(arrays.values())).shape
    config = RunConfig(replicates=runs, trials=trials)
    return Block("x", config, 0, onset, arrays).record()


def test_handedness_by_hand():
    one, half = [3.0] * 10, [3.0, -0.1] * 5
    nine = [-2.0] * 9 + [2.0]
    runs = with_columns(-1, turned=[[-1.0, *one], [1.0, *half], [1.0, *nine]])
    assert measures.of(runs, "one-handed").tolist() == pytest.approx([1, 0, 0.8])


def test_walking_as_far_as_before_by_hand():
    ways = [[1, 2, 2, 0, 1.7, 1.9, 2.1], [1, 2, 2, 2, 0, 0, 0], [1, 2, 2, 0, 0, 0, 0]]
    runs = with_columns(3, distance=ways)
    assert measures.of(runs, "regain").tolist() == [3, 1, np.inf]
    assert measures.of(runs, "surpass").tolist() == [4, 1, np.inf]


def test_a_side_that_needs_what_does_not_exist_says_so():
    cell = Cell(a="left-20 no-such-piece")
    assert "Unknown piece of A" in lacking("A", cell, world="mujoco")


@pytest.mark.parametrize(
    ("letter", "side", "trials"),
    [
        ("A", "undamaged", 24),  # solved within 24, nothing else
        ("C", "sensor-min adapted", 28),  # recovers within 8 from trial 20 on
        ("C", "left-slow feedforward", 36),
        ("A", "left-20", 100),  # its cost counts as well
        ("D", "type-0 restart", 200),
    ],
)
def test_a_side_runs_no_longer_than_what_is_asked_of_it(letter, side, trials):
    assert member_of(letter, side, world="mujoco").config.trials == trials


def test_a_comparison_costs_what_its_share_implies():
    clear, close = Cell(a="x", b="y", p="0.00000"), Cell(a="x", b="y", p="0.04207")
    assert schedule.implied(close) == pytest.approx(0.5 + 0.153, abs=0.002)
    assert schedule.expected(clear, schedule.implied(clear)) == 20
    assert schedule.expected(close, schedule.implied(close)) == 50
    assert schedule.expected(Cell(a="x", b="y", says="<"), 0.02) == 10
    assert schedule.expected(Cell(a="x", b="y", says="="), 0.5) == 100
    assert schedule.expected(Cell(a="x", at_most=5), 1.0) == 10
    assert schedule.expected(Cell(a="x", b="y", variant="v"), 0.6) == 30


def test_shared_trials_are_paid_once():
    two = schedule.planned([find("D20")], world="mujoco")
    assert two.sides == 4 and two.hours < two.apart  # 14, 14 data-reset, each printed
    alone = schedule.planned([find("D31")], world="mujoco")
    assert alone.hours == alone.apart > 0
    assert schedule.planned([find("B2")], world="static-snn").sides == 0


def test_quick_sides_are_short():
    whole = member_of("A", "left-20-at-40", world="mujoco").config
    short = member_of("A", "left-20-at-40", world="mujoco", quick=True).config
    assert (whole.trials, short.trials) == (100, 20)
    assert short.world.damage == ("wheel_gain:wheel=left,factor=0.8@8",)
