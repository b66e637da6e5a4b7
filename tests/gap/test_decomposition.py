"""The joint fit on recordings: shares, statements, dates, and what is left out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.bench.wheeled_cases import commands
from bns.gap.candidates import legged, wheeled_rows
from bns.gap.decomposition import (
    descent,
    diagnosis,
    fit,
    record,
    refit,
    rest,
    shares,
    simpler,
    starts,
    statements,
)
from bns.gap.decomposition.decomposition import Decomposition
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.shares import Part
from bns.gap.decomposition.singles import Singles
from bns.gap.diagnose import diagnose
from bns.gap.models.wheeled import changes, drives
from bns.gap.recordings import check
from bns.worlds.physics.rollout import Pool
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"
GAIN = "wheel_gain:wheel=left,factor=0.8"
LEVELS = ("wheel_gain[left]", "wheel_intermittent[both]", "wheel_diameter[both]")
KEPT = ("wheel_gain[left]", "motor_lag[both]", "axle_length", "battery_fade")


@pytest.fixture(scope="module")
def recorded(model):
    told = [
        Commands(item.values[:4], item.durations[:4])
        for item in commands(np.random.default_rng(5), 8)
    ]
    plain = MujocoWorld(reality=[NOISE], threads=1).run(told, seeds=range(8))
    worn = MujocoWorld(reality=[GAIN, NOISE], threads=1).run(told, seeds=range(8))
    return plain, worn


def kept(trials, model):
    return diagnose(trials, model, rows=KEPT, full=False)


def test_damage_that_sets_in_is_dated_and_named(recorded, model):
    plain, worn = recorded
    found = kept([*plain[:5], *worn[5:]], model)
    assert found.verdict.named == (("wheel_gain[left]",),)
    assert found.change["trial"] == 5
    assert found.best.magnitudes[0] == pytest.approx(0.8, abs=0.02)
    assert "sets in at trial 5" in found.verdict.sentence


def test_damage_that_was_always_there_has_no_date(recorded, model):
    found = kept(recorded[1], model)
    assert found.verdict.named == (("wheel_gain[left]",),)
    assert not found.change
    (part,) = found.decomposition["parts"]
    assert part["last"] == pytest.approx(1.0)  # of what closes: the rest is scatter
    assert part["alone"] > 0.95 and part["sure"] > 0.95
    assert found.decomposition["left"] < 0.1
    assert len(found.decomposition["statements"]) == 3


def test_a_trial_that_strays_from_its_repeat_is_named_and_does_not_count(model, told):
    twice = [*told[:4], *told[:4]]
    trials = MujocoWorld(reality=[NOISE], threads=1).run(twice, seeds=range(8))
    slow = "wheel_gain:wheel=left,factor=0.3"
    pushed = MujocoWorld(reality=[slow, NOISE], threads=1).run(told[1:2], seeds=[9])
    found = kept([trials[0], *pushed, *trials[2:]], model)
    assert found.verdict.kind == "no gap"
    assert "Trial 1 went another way than its repeat" in found.verdict.sentence


@pytest.mark.parametrize(
    ("stops", "late", "named"), [(1, 0.1, False), (1, 0.02, True), (2, 0.02, True)]
)
def test_a_level_that_one_trial_alone_shows_is_named_if_it_leaves_nothing(
    model, told, stops, late, named
):
    long = [
        Commands([[0.1, 0.08]] * 5, [0.6] * 5),
        Commands([[0.08, 0.1]] * 5, [0.6] * 5),
    ]
    short = [Commands(item.values[:4], item.durations[:4]) for item in told[:4]]
    world = MujocoWorld(reality=[NOISE], threads=1)
    plain = world.run([*long, *short], seeds=range(6))
    stuck = [  # at the fifth command, or by an obstacle a little later
        replace(
            trial,
            commands=item,
            boundaries=np.delete(trial.boundaries, 5),
            handled=trial.handled[:5],
        )
        for trial, item in zip(
            world.run(
                [
                    Commands([*item.values, [0.0, 0.0]], [0.6] * 4 + [late, 0.6 - late])
                    for item in long
                ],
                seeds=[0, 1],
            ),
            long,
            strict=True,
        )
    ]
    found = diagnose([*stuck[:stops], *plain[2:]], model, rows=LEVELS, full=False)
    if named:
        assert found.verdict.named == (("wheel_intermittent[both]",),)
    else:
        assert found.verdict.kind == "none of the library"
        assert "no other does" in found.verdict.sentence


def test_repeats_are_found_with_tolerance(model):
    told = [Commands([[0.1, 0.05]], [2.0]), Commands([[0.1, 0.05]], [2.004])]
    other = Commands([[0.1, 0.06]], [2.0])
    trials = MujocoWorld(reality=[NOISE], threads=1).run([*told, other])
    trials, _ = check.check(trials, model)
    assert rest.repeats(Problem.of(trials, model)) == [(0, 1)]


def test_a_problem_can_be_narrowed_but_keeps_its_nuisance(recorded, model):
    problem = diagnosis.narrowed(Problem.of(recorded[0], model), ["axle_length"])
    assert [row.name for row in problem.rows] == ["axle_length", "step_lead"]


def test_what_changes_nothing_is_simulated_no_more(recorded, model):
    problem = diagnosis.narrowed(Problem.of(recorded[0], model), KEPT[:2])
    at = next(n for n, row in enumerate(problem.rows) if row.name == KEPT[1])
    quiet = replace(problem, silent=frozenset({KEPT[1]}))
    loud = problem.slopes(problem.nominal, [0, at])
    found = quiet.slopes(problem.nominal, [0, at])
    assert loud[at].any() and not found[at].any()
    np.testing.assert_array_equal(found[0], loud[0])


def test_a_delay_beside_a_gain_is_no_shift_of_the_clock(model, told):
    hidden = ["wheel_gain:wheel=left,factor=0.94", "command_latency:delay=0.06", NOISE]
    trials = MujocoWorld(reality=hidden, threads=1).run(told, seeds=range(4))
    rows = ("wheel_gain[left]", "wheel_gain[right]", "command_latency")
    found = diagnose(trials, model, rows=rows, full=False)
    assert {frozenset(names) for names in found.verdict.named} == {
        frozenset({"wheel_gain[left]", "command_latency"})
    }
    trials, _ = check.check(trials, model)
    problem = diagnosis.narrowed(Problem.of(trials, model), rows)
    number = [row.name for row in problem.rows].index("step_lead")
    assert abs(descent.nothing(problem).values[number]) < 0.02


def test_a_load_that_is_no_point_is_named_alone(model, told):
    hidden = ["payload:mass=0.55,inertia=0.0004", NOISE]
    trials = MujocoWorld(reality=hidden, threads=1).run(told, seeds=range(4))
    rows = ("payload", "wheel_gain[both]", "wheel_diameter[both]")
    found = diagnose(trials, model, rows=rows, full=False)
    assert found.verdict.named == (("payload",),)
    (load,) = [model.parse(text) for text in found.best.effects]
    assert load["mass"] == pytest.approx(0.55, rel=0.1)
    assert load["inertia"] == pytest.approx(4e-4, rel=0.3)


@pytest.mark.parametrize(
    ("effects", "one_does"),
    [
        (["wheel_diameter:wheel=right,factor=1.04"], True),
        (["wheel_diameter:wheel=both,factor=1.08", GAIN], False),
    ],
)
def test_two_explanations_of_which_one_undoes_half_of_the_other_are_one(
    model, told, effects, one_does
):
    several = frozenset({"wheel_diameter[both]", "wheel_gain[left]"})
    one = "wheel_diameter[right]"
    trials = MujocoWorld(reality=[*effects, NOISE], threads=1).run(told, seeds=range(4))
    trials, _ = check.check(trials, model)
    names = [*sorted(several), one, "wheel_diameter[left]"]
    problem = diagnosis.narrowed(Problem.of(trials, model), names)
    point = refit.refitted(problem, descent.nothing(problem), several)
    found = simpler.parted(problem, point)
    assert found.support == ({one} if one_does else several)


@pytest.mark.parametrize(
    ("excite", "said"),
    [
        ("any command", "A longer or less noisy recording may separate them."),
        ("fast motion of that joint", "A recording with fast motion of elbow may"),
    ],
)
def test_what_parts_explanations_is_said_with_the_name_of_its_joint(excite, said):
    rows = [
        Row("a", 0.0, 1.0, -1.0, 1.0, excite="any command"),
        Row("b", 0.0, 1.0, -1.0, 1.0, excite=excite, fixed={"part": "elbow"}),
    ]
    made = SimpleNamespace(
        tied=(frozenset("a"), frozenset("b")), problem=SimpleNamespace(rows=rows)
    )
    assert record._change(made, "either").startswith(said)


@pytest.mark.parametrize(("many", "names"), [(True, {"limp"}), (False, set())])
def test_where_a_load_sits_is_never_silent(many, names):
    rows = ("load", "place", "limp", "moved")
    changes = dict(enumerate([1.0, 0.0, 0.0, 1.0]))
    problem = SimpleNamespace(
        rows=tuple(Row(name, 0.0, 1.0, -1.0, 1.0) for name in rows),
        terms={"load": (0, 1), "limp": (2,), "moved": (3,)},
        sd=np.ones(4),
        model=SimpleNamespace(many=many),
    )
    linear = SimpleNamespace(weight=np.ones((5, 1)))
    slopes = {n: np.full((5, 1), size) for n, size in changes.items()}
    start = SimpleNamespace(linear=linear, slopes=slopes)
    assert fit.silent(problem, start) == names


def test_every_row_of_a_wheeled_robot_makes_its_effect(recorded, model):
    for row in model.rows(recorded[0]):
        if row.nuisance:
            continue
        value = row.levels[0] if row.levels else row.nominal + row.difference
        made = changes.effect(row.term, {row.name: value})
        assert not made.in_trial(1).is_nominal, row.name


def test_between_slow_commands_a_width_of_a_dead_band_is_tried_however_many_are_fast():
    slow = [0.009, 0.01, 0.012, 0.02, 0.025, 0.03, 0.05]
    told = np.concatenate([slow, np.arange(0.07, 0.2, 0.004)])
    trial = SimpleNamespace(
        commands=Commands(np.column_stack([told, told]), np.ones(len(told))),
        conditions={},
    )
    rows = {row.name: row for row in wheeled_rows.rows([trial])}
    assert any(0.03 < level < 0.05 for level in rows["dead_band[both]"].levels)


def test_widths_of_a_dead_band_lie_all_over_what_a_joystick_told():
    told = np.arange(0.001, 0.21, 0.001)
    levels = np.array(wheeled_rows._bands(told))
    assert levels[0] < 0.006 and levels[-1] > 0.15
    assert (levels[1:] / levels[:-1]).max() < 1.35
    some = wheeled_rows._bands(np.linspace(0.01, 0.19, 14))
    assert 10 <= len(some) < 14 and max(some) > 0.18


def test_a_part_of_a_recording_has_its_trials_and_is_looked_at_first(
    recorded, model, monkeypatch
):
    trials, _ = check.check(recorded[1], model)
    whole = Problem.of(trials, model)
    part = whole.some([1, 4])
    assert part.trials == (whole.trials[1], whole.trials[4])
    assert part.numbers == (1, 4)
    at = np.isin(whole.trial, [1, 4])
    np.testing.assert_array_equal(part.gap, whole.gap[at])
    assert set(part.trial) == {0, 1}
    problem = diagnosis.narrowed(whole, KEPT)
    tried = Singles(problem, descent.nothing(problem))
    assert starts._glimpsed(tried) == []  # no long recording
    monkeypatch.setattr(starts, "GLANCE", 8.0)
    (found,) = starts._glimpsed(tried)
    assert found.support == {"wheel_gain[left]"}
    assert found.rest.shape == problem.recorded.shape
    monkeypatch.setattr(starts, "NUMEROUS", 0)  # as if of a robot of many joints
    monkeypatch.setattr(starts, "BRIEF", 8.0)
    looked = []
    monkeypatch.setattr(starts, "_simple", lambda tried: looked.append(tried) or [])
    several = starts._several(tried, found.support, tried.start)
    assert several.support == found.support
    assert {len(each.problem.trials) for each in looked} <= {2, 3}  # of the part alone


def test_speeds_told_are_averaged_over_a_step():
    told = drives.told(Commands([[0.1, 0.2], [0.0, 0.0]], [0.013, 0.1]), (), 0.01)
    np.testing.assert_allclose(told[:3], [[0.1, 0.2], [0.03, 0.06], [0.0, 0.0]])


def test_drives_that_effects_leave_alike_are_simulated_once(recorded, model):
    """None of these speeds is as low as the dead band, one is as the other."""
    trial = recorded[0][0]
    slow = 0.5 * np.abs(trial.commands.values[trial.commands.values != 0]).min()
    made = drives.Drives(model.name, Pool(1))
    both = [[{"dead_band[both]": level}] for level in (slow, 0.9 * slow)]
    (one,), (other,) = made.paths([trial], both)
    assert len(made._cache) == 1
    np.testing.assert_array_equal(one, other)
    assert len(made.paths([trial], [[{"wheel_gain[left]": 0.9}]])[0]) == 1
    assert len(made._cache) == 2


def test_a_row_without_room_is_refused():
    from bns.errors import BnsError

    with pytest.raises(BnsError, match="between low and high"):
        Row("x", 0.0, 1.0, 1.0, 2.0)


def said(model, rows, *parts, **about):
    """Statements on a gap of 10 mm, 10 mm and 10 mrad."""
    gap = np.full((4, 3), 0.01)
    windows = [SimpleNamespace(durations=np.full(4, 0.5))]
    known = {
        "problem": SimpleNamespace(model=model, rows=rows, windows=windows),
        "start": SimpleNamespace(rest=gap),
        "point": SimpleNamespace(rest=0 * gap),
        "floor": SimpleNamespace(sd=1e-6 + 0 * gap),
        "inside": gap > 0,
        "parts": parts,
        **{"kind": "effect", "tied": (), "goes": "", "onset": None},
        **{"before": 50.0, "closed": 0.9, "left": 0.0, "unconfirmed": {}},
        **dict.fromkeys(("lasting", "failing", "recurring", "searched"), False),
        **dict.fromkeys(("unstable", "strayed", "unlisted"), ()),
    }
    return statements.of(SimpleNamespace(**{**known, **about}))


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        (
            "floor_slope",
            {"floor_slope.x": 0.03, "floor_slope.y": 0.04},
            "floor_slope = 0.05 rad [0.036, 0.064], direction 0.9273 rad",
        ),
        (
            "payload",
            {"payload.mass": 0.4, "payload.mx": 0.02, "payload.mz": 0.04},
            "payload = 0.4 kg [0.39, 0.41], x 0.05 m, z 0.17 m",
        ),
        (
            "payload",
            {"payload.mass": 0.4, "payload.inertia": 3e-4},
            "payload = 0.4 kg [0.39, 0.41], inertia 0.0003 kg m2",
        ),
    ],
)
def test_directions_and_places_are_told(recorded, model, name, values, text):
    low, high = ({n: v + off for n, v in values.items()} for off in (-0.01, 0.01))
    part = Part(name, values, low, high, last=1.0, alone=1.0, sure=1.0)
    _, explained, _ = said(model, model.rows(recorded[0]), part)
    assert explained.startswith(f"{text} explains 90 % of the gap")


@pytest.mark.parametrize(
    ("before", "left", "recurs", "why"),
    [
        (5.0, 1.0, False, "does not recur"),
        (5.0, 1.0, True, "recurs, but is within 1 % of the motion"),
        (5.0, 0.1, True, "is unsure by as much"),
        (1.0, 1.0, False, ""),
    ],
)
def test_a_gap_that_is_none_has_its_size_and_why(model, before, left, recurs, why):
    about = {"before": before, "left": left, "recurring": recurs}
    first, *more = said(model, (), kind="no gap", **about)
    assert first.startswith("No gap beyond what the recording scatters")
    size = "10 mm forward, 10 mm left, 10 mrad turn over 0.5 s"
    assert (size in "".join(more)) == bool(why)
    assert why in "".join(more)


@pytest.mark.parametrize(
    ("before", "closed", "kind"),
    [
        (50.0, 0.9, "effect"),
        (50.0, 0.3, "none of the library"),
        (1.0, 0.3, "effect"),  # so small a gap is closed by chance
    ],
)
def test_what_holds_for_the_fitted_motion_alone_is_no_answer(before, closed, kind):
    made = SimpleNamespace(
        point=SimpleNamespace(support=frozenset({"dead_zone[both]"})),
        tied=(frozenset({"dead_zone[both]"}),),
        before=before,
        closed=closed,
        lasting=False,
        unexplained=0.1,
        goes="",
        unconfirmed={},
        strained=False,
        elsewhere=frozenset(),
    )
    made.failing = Decomposition.failing.fget(made)
    made.foreign = Decomposition.foreign.fget(made)
    assert Decomposition.kind.fget(made) == kind


def test_what_came_back_to_its_nominal_value_is_none(recorded, model):
    problem = diagnosis.narrowed(Problem.of(recorded[0], model), KEPT[:2])
    values = problem.nominal.copy()
    values[0] = 0.9
    point = SimpleNamespace(values=values, support=frozenset(KEPT[:2]))
    assert shares.departing(problem, point) == {KEPT[0]}


@pytest.mark.parametrize(("value", "slack"), [(1.2, 0.1), (0.76, 0.1), (1.3, 0.004)])
def test_what_a_model_is_unsure_by_is_slack_and_no_explanation(value, slack):
    grip = Row("foot_slippery[all]", 1.0, 0.4, 0.1, 2.0, slack=0.004, unsure=0.1)
    rows = (grip, Row("centre_of_mass.dy", 0.0, 0.015, -0.03, 0.03))
    none, number = np.zeros((0, 1)), np.zeros(0, dtype=int)
    problem = Problem(None, (), rows, (), none, number, number, ())
    names = frozenset(row.name for row in rows)
    point = SimpleNamespace(support=names, values=np.array([value, 0.02]))
    found = shares.within_slack(problem, point).rows
    assert [row.slack for row in found] == [slack, 0.0]


def test_walkers_keep_what_their_model_is_unsure_by():
    told = {
        row.name: row
        for row in legged.known(legged.rows(legged.Suspects((), (), True)))
    }
    assert told["foot_slippery[all]"].unsure > 10 * told["foot_slippery[all]"].slack
    assert told["centre_of_mass.dy"].unsure == 0


def test_windows_that_may_be_anywhere_do_not_hide_a_gap(recorded, model):
    """The ends of an unstable robot's pieces: half a metre where half may be."""
    gap, sd = np.full((4, 3), 0.01), np.full((4, 3), 0.001)
    gap[2:], sd[2:] = 0.5, 0.6
    floor, start = SimpleNamespace(sd=sd), SimpleNamespace(rest=gap)
    size, *_ = said(model, model.rows(recorded[0]), floor=floor, start=start)
    assert "differ by 350 mm" in size and "that is 9.9 mm" in size
