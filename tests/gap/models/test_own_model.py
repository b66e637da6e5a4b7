"""A stranger's robot: planted effects are named; what is wrong with a file is said."""

import re
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap import warnings
from bns.gap.bench import mjcf_cases
from bns.gap.candidates import mjcf, mjcf_usual
from bns.gap.decomposition import descent, diagnosis, refit, simpler, statements
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.reference import Corrected
from bns.gap.decomposition.shares import Part
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import masses
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.effects import CLASSES, OWNERS
from bns.gap.models.mjcf.masses import Body
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.recordings.trial_conditions import moments_unknown
from bns.worlds.data.importing import MOMENTS
from tests.sources import ROOT

ARM = ROOT / "examples" / "arm" / "arm.toml"
KEPT = (
    "joint_damping[elbow]",
    "body_mass[forearm]",
    "actuator_gain[shoulder_servo]",
    "command_delay[all]",
)


@pytest.fixture(scope="module")
def arm():
    return OwnModel.read(ARM, threads=1)


@pytest.fixture(scope="module")
def told(arm):
    return mjcf_cases.commands(arm, np.random.default_rng(0), 4, seconds=2.0)


@pytest.fixture(scope="module")
def find(arm, told):
    def run(*texts):
        trials = mjcf_cases.record(arm, told, [arm.parse(t) for t in texts], seed=1)
        return diagnose(trials, arm, rows=KEPT, full=False)

    return run


@pytest.mark.parametrize(
    ("text", "name", "value", "tolerance"),
    [
        ("joint_damping:part=elbow,added=0.06", KEPT[0], 0.06, 0.004),
        ("body_mass:part=forearm,added=0.1", KEPT[1], 0.1, 0.003),
        ("actuator_gain:part=shoulder_servo,factor=0.8", KEPT[2], 0.8, 0.005),
        ("command_delay:part=all,delay=0.04", KEPT[3], 0.04, 0.001),
    ],
)
def test_a_planted_effect_is_named_with_its_value(find, text, name, value, tolerance):
    found = find(text)
    assert found.verdict.kind == "effect"
    assert found.verdict.named == ((name,),)
    assert found.best.magnitudes[0] == pytest.approx(value, abs=tolerance)


def test_nothing_planted_is_no_gap(find):
    assert find().verdict.kind == "no gap"


@pytest.mark.parametrize("delay", [0.015, 0.03])
def test_a_delay_of_about_a_sample_is_no_shift_in_time(arm, told, delay):
    late = arm.parse(f"command_delay:part=all,delay={delay}")
    trials = [
        trial.replace(conditions={MOMENTS: "sampled"})  # as in a log of 50 Hz
        for trial in mjcf_cases.record(arm, told, [late], seed=1)
    ]
    assert moments_unknown(trials) == pytest.approx(0.02)
    found = diagnose(trials, arm, rows=KEPT[3:], full=False)
    assert found.verdict.named == ((KEPT[3],),)
    assert found.best.magnitudes[0] == pytest.approx(delay, abs=0.003)


def test_it_rests_at_home_and_follows(arm, told):
    ((seen,),) = arm.simulate(mjcf_cases.record(arm, told[:1], []), [()])
    home = np.array([0.6, 0.9])
    assert np.abs(seen[0] - home).max() < 0.1  # gravity makes the servos give way
    assert np.ptp(seen, axis=0).min() > 0.2


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_every_effect_is_nothing_at_its_nominal_value_and_reads_back(name):
    effect = CLASSES[name]({})
    assert effect.is_nominal
    assert effect.doc and effect.source
    assert effect.stage in ("command", "body", "sensor", "tracking")
    about = effect.parameters[0]
    changed = CLASSES[name]({"part": "elbow", about.name: min(0.25, about.high)})
    assert OwnModel.parse(str(changed)) == changed
    with pytest.raises(BnsError, match="names no part"):
        CLASSES[name]({"part": "a,b"})


@pytest.mark.parametrize("part", ["robot:panda0_joint1", "robot0:hand mount"])
def test_a_part_may_have_a_colon_or_a_space_in_its_name(part):
    text = f"joint_damping:part={part},added=0.25"
    assert str(OwnModel.parse(text)) == text


def test_effects_act_on_their_part_alone(arm):
    plain = arm.physics.model
    doubled = arm.physics.compiled(
        [arm.parse("joint_damping:part=elbow,added=0.06")]
    ).model
    np.testing.assert_allclose(plain.dof_damping.ravel()[:2], [0.15, 0.06])
    np.testing.assert_allclose(doubled.dof_damping.ravel()[:2], [0.15, 0.12])
    heavy = arm.physics.compiled([arm.parse("body_mass:part=forearm,added=0.1")]).model
    np.testing.assert_allclose(heavy.body_mass, plain.body_mass + np.eye(3)[2] / 10)
    weak = arm.physics.compiled(
        [arm.parse("actuator_gain:part=elbow_servo,factor=0.5")]
    )
    np.testing.assert_allclose(weak.model.actuator_gainprm[:, 0], [30, 6])


def test_a_corrected_model_is_written(arm, tmp_path):
    texts = ["joint_damping:part=elbow,added=0.06", "command_delay:part=all,delay=0.1"]
    left = arm.write_corrected(texts, tmp_path / "arm.xml")
    assert left == ["command_delay:part=all,delay=0.1"]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert model.dof_damping.ravel()[1] == pytest.approx(0.12)


def test_servos_that_are_all_weak_are_told_as_one(arm, told):
    servos = ("shoulder_servo", "elbow_servo")
    config = replace(arm.config, effects={"actuator_kp": servos})
    model = OwnModel(config, threads=1)
    weak = model.parse("actuator_kp:part=all,factor=0.8")
    found = diagnose(mjcf_cases.record(model, told, [weak], seed=1), model, full=False)
    assert found.best.names == ("actuator_kp[all]",)
    assert found.best.magnitudes[0] == pytest.approx(0.8, abs=0.01)


def test_effects_are_considered_where_none_are_listed(arm):
    config = replace(OwnConfig.read(ARM), effects=None)
    names = {item.name for item in OwnModel(config, threads=1).listed}
    assert {
        "joint_damping[elbow]",
        "reading_gain[shoulder]",
        "command_delay[elbow_goal]",
    } < names


UNPLACED = {"marker_mount"}  # an arm has no place that is followed
PARTS = {
    "joint": "elbow",
    "body": "forearm",
    "actuator": "elbow_servo",
    "geom": "forearm",
    "tendon": "cord",
    "lever arm": "cord/elbow",
    "follower": "elbow",
    "model": "all",
}
CORD = """<tendon><fixed name="cord" stiffness="200"><joint joint="elbow" coef="0.1"/>
  </fixed></tendon><equality><joint joint1="elbow" joint2="shoulder"
  polycoef="0 0.5 0 0 0" solref="0.5 1"/></equality></mujoco>"""


@pytest.fixture(scope="module")
def corded(arm, tmp_path_factory):
    """The arm with a tendon, and an elbow that is softly coupled to the shoulder."""
    path = tmp_path_factory.mktemp("corded") / "arm.xml"
    path.write_text(arm.config.model.read_text().replace("</mujoco>", CORD))
    return OwnModel(replace(arm.config, model=path), threads=1)


@pytest.mark.parametrize("name", sorted(set(CLASSES) - UNPLACED))
def test_every_effect_can_be_a_candidate(corded, name):
    channel = "elbow" if name.startswith("reading") else "elbow_goal"
    part = PARTS.get(OWNERS.get(name, ""), channel)
    config = replace(corded.config, effects={name: (part,)}, bounds={})
    made = mjcf.candidates(config, corded.physics.model)
    strengths = [item.name for item in CLASSES[name].parameters if item.scales]
    assert [item.parameter for item in made] == strengths
    for item in made:
        assert item.low <= item.nominal <= item.high and item.excite
        for magnitude in (item.low, *item.levels, item.high):
            assert item.make(magnitude)["part"] == part


JOINTS = ("damping", "friction", "armature", "stiffness", "stribeck")


@pytest.mark.parametrize("name", JOINTS)
def test_geared_joints_may_have_ten_times_what_is_looked_for_first(arm, name):
    effect = f"joint_{name}"
    config = replace(OwnConfig.read(ARM), effects={effect: ("elbow",)}, bounds={})
    made, *_ = mjcf.candidates(config, arm.physics.model)
    largest = max(made.levels)
    assert (made.high, made.sd) == pytest.approx((10 * largest, largest / 8))
    given = replace(config, bounds={made.name: {"high": 0.1}})
    made, *_ = mjcf.candidates(given, arm.physics.model)
    assert made.high == max(made.levels) == 0.1


# no contact, no limit, no medium to scale
UNFELT = {
    *mjcf_usual.TOUCHING,
    "actuator_torque_limit",
    "fluid_density",
    "fluid_viscosity",
    *UNPLACED,
}


@pytest.mark.parametrize("name", sorted(set(CLASSES) - UNFELT))
def test_every_effect_changes_the_motion_of_its_candidates(corded, told, name):
    trials = mjcf_cases.record(corded, [told[0], told[0]], [])
    channel = "elbow" if name.startswith("reading") else "elbow_goal"
    part = PARTS.get(OWNERS.get(name, ""), channel)
    config = replace(corded.config, effects={name: (part,)}, bounds={})
    most = 0.0
    for item in mjcf.candidates(config, corded.physics.model):
        magnitude = item.levels[0] if item.nominal == item.high else item.levels[-1]
        made = corded.simulate(trials, [(), (item.make(magnitude),)])
        plain, changed = map(np.concatenate, made)
        assert np.isfinite(changed).all()
        most = max(most, np.abs(changed - plain).max())
    assert most > 1e-3  # a plane arm does not feel all ways to shift a mass


def test_play_behind_a_joint_is_found(arm, told):
    config = replace(
        OwnConfig.read(ARM),
        effects={"joint_backlash": ("elbow",), "joint_friction": ("elbow",)},
        bounds={},
    )
    model = OwnModel(config, threads=1)
    play = model.parse("joint_backlash:part=elbow,play=0.08")
    found = diagnose(mjcf_cases.record(model, told, [play], seed=1), model, full=False)
    assert found.verdict.named == (("joint_backlash[elbow]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.08, rel=0.1)


def test_an_encoder_behind_the_play_reads_it_too(arm, told):
    trials = mjcf_cases.record(arm, told[:1], [])
    before, behind = (
        arm.simulate(trials, [(arm.parse(f"{name}:part=elbow,play=0.08"),)])[0][0]
        for name in ("joint_backlash", "output_backlash")
    )
    names = [item.channel.name for item in arm.config.seen]
    elbow = names.index("elbow")
    others = np.arange(len(names)) != elbow
    np.testing.assert_array_equal(before[:, others], behind[:, others])
    apart = (behind - before)[:, elbow]
    assert 0.035 < np.median(np.abs(apart)) < 0.045  # half of it, either way


def test_play_of_one_joint_is_not_read_as_that_of_another(arm, told):
    trials = mjcf_cases.record(arm, told[:1], [])
    effects = [
        (arm.parse(f"joint_backlash:part={joint},play=0.08"),)
        for joint in ("shoulder", "elbow")
    ]
    alone = [
        OwnModel.read(ARM, threads=1).simulate(trials, [made])[0][0] for made in effects
    ]
    for (seen,), expected in zip(arm.simulate(trials, effects), alone, strict=True):
        np.testing.assert_array_equal(seen, expected)


def test_steps_of_a_simulation_are_no_gap(arm, told, tmp_path):
    """A model of 8 ms steps, and recordings by steps of 0.5 ms: no effect does that."""
    scene = ARM.with_name("arm.xml").read_text(encoding="utf-8")
    assert 'timestep="' in scene
    coarse = re.sub(r'timestep="[^"]*"', 'timestep="0.008"', scene)
    (tmp_path / "arm.xml").write_text(coarse, encoding="utf-8")
    config = replace(OwnConfig.read(ARM), model=tmp_path / "arm.xml")
    model = OwnModel(config, threads=1)
    model.rows(mjcf_cases.record(model, told, []))
    assert model._parts > 1
    for parts in (1, 16):
        model._parts = parts
        trials = mjcf_cases.record(model, told, [], seed=3)
        assert diagnose(trials, model, rows=KEPT, full=False).verdict.kind == "no gap"


TORQUE, COMMAND = "actuator_torque_limit", "command_limit"


def limited(tmp_path, most, part=TORQUE):
    """The arm with a shoulder that takes so many N m, or goals of so many rad."""
    scene = ARM.with_name("arm.xml").read_text(encoding="utf-8")
    config = OwnConfig.read(ARM)
    of = {TORQUE: "shoulder_servo", COMMAND: "shoulder_goal"}
    if part == TORQUE:
        scene = scene.replace('kp="30"', f'kp="30" forcerange="-{most} {most}"')
    else:
        wide = replace(config.told[0], low=-most, high=most)
        config = replace(config, told=(wide, *config.told[1:]))
    (tmp_path / "arm.xml").write_text(scene, encoding="utf-8")
    effects = {part: (of[part],), "actuator_gain": (of[TORQUE],)}
    config = replace(config, model=tmp_path / "arm.xml", effects=effects, bounds={})
    return OwnModel(config, threads=1)


@pytest.mark.parametrize(("most", "reached"), [(500.0, False), (6.0, True)])
def test_limits_of_force_that_are_tried_lie_among_the_forces(
    told, tmp_path, most, reached
):
    model = limited(tmp_path, most)
    trials = mjcf_cases.record(model, told, [])
    taken = model.physics.loads(trials).forces["shoulder_servo"] * most
    levels = np.array(model.rows(trials)[0].levels) * most
    assert (taken.max() == pytest.approx(most)) == (levels.max() > most) == reached
    cut = [np.mean(taken > level) for level in levels[levels < most]]
    assert len(cut) > 3 and all(0 < share < 0.7 for share in cut)


@pytest.mark.parametrize(
    ("part", "most", "text", "value"),
    [
        (TORQUE, 500.0, f"{TORQUE}:part=shoulder_servo,factor=0.012", 0.012),
        (COMMAND, 100.0, f"{COMMAND}:part=shoulder_goal,limit=0.6", 0.6),
    ],
)
def test_a_limit_far_below_that_of_the_model_is_named(
    told, tmp_path, part, most, text, value
):
    model = limited(tmp_path, most, part)
    trials = mjcf_cases.record(model, told, [model.parse(text)], seed=1)
    found = diagnose(trials, model, full=False)
    assert [name.partition("[")[0] for name in found.best.names] == [part]
    assert found.best.magnitudes[0] == pytest.approx(value, rel=0.05)


LATE = {"command_delay": "delay=0.03", "command_lag": "time_constant=0.06"}


@pytest.mark.parametrize("taken", sorted(LATE))
@pytest.mark.parametrize("true", sorted(LATE))
def test_a_delay_is_fitted_for_a_lag_and_the_better_is_kept(arm, told, true, taken):
    texts = (f"{true}:part=all,{LATE[true]}", "joint_damping:part=elbow,added=0.06")
    made = mjcf_cases.record(arm, told[:2], [arm.parse(t) for t in texts], seed=1)
    names = [f"{name}[all]" for name in LATE]
    problem = diagnosis.narrowed(Problem.of(made, arm), [KEPT[0], *names])
    start = descent.nothing(problem)
    point = refit.refitted(problem, start, frozenset({KEPT[0], f"{taken}[all]"}))
    found = simpler.swapped(problem, point)
    assert found.support == {KEPT[0], f"{true}[all]"}
    assert (found is point) == (taken == true)


def test_damping_of_all_joints_changes_what_those_of_each_change_together(arm, told):
    parts = [f"joint_damping[{joint}]" for joint in ("shoulder", "elbow")]
    trials = mjcf_cases.record(arm, told[:2], [], seed=1)
    names = ["joint_damping[all]", *parts]
    problem = diagnosis.narrowed(Problem.of(trials, arm), names)
    number = {row.name: n for n, row in enumerate(problem.rows)}
    every = number["joint_damping[all]"]
    assert [problem.rows[n].name for n in problem.joins[every]] == parts
    summed = problem.slopes(problem.nominal, [number[name] for name in names])
    alone = problem.slopes(problem.nominal, [every])
    size = np.abs(alone[every]).max()
    np.testing.assert_allclose(summed[every], alone[every], atol=0.02 * size)


def test_a_mass_on_a_link_is_told_with_its_place(arm):
    (item,) = [item for item in arm.listed if item.name == KEPT[1]]
    body = Body.of(arm.physics.model, "forearm")
    problem = SimpleNamespace(rows=masses.rows(item, body, "motion"), model=arm)
    values = {KEPT[1]: 0.2, f"{KEPT[1]}.mx": 0.01, f"{KEPT[1]}.my": 0.0}
    part = Part(KEPT[1], values, values, values, last=1.0, alone=1.0, sure=1.0)
    told = "body_mass[forearm] = 0.2 kg [0.2, 0.2], dx 0.05 m"
    alone = SimpleNamespace(problem=problem, parts=[part])
    assert statements._said(alone, part) == told
    two = SimpleNamespace(problem=problem, parts=[part, part])
    assert statements._said(two, part) == f"{told} (100 % when added last)"


@pytest.mark.parametrize("kind", ["effect", "none of the library", "no gap"])
def test_a_verdict_on_a_gap_names_what_was_not_tried(arm, kind):
    untried = arm.untried()
    listed = {item.effect for item in arm.listed}
    assert set(untried) == set(CLASSES) - listed - {"body_centre"}  # a mass covers it
    assert {"joint_backlash", "body_tilt"} < set(untried)
    assert Corrected(arm, {}, {}).untried() == untried
    found = SimpleNamespace(
        verdict=SimpleNamespace(kind=kind),
        **{"change": {}, "fits": (), "signatures": {}, "decomposition": {}},
    )
    text = " ".join(warnings.warnings(found, (), untried))
    assert (f"Not tried: {', '.join(untried)}" in text) == (kind != "no gap")
    assert "Not tried" not in " ".join(warnings.warnings(found, ()))
    found.decomposition["unlisted"] = []  # were tried, after all
    assert "Not tried" not in " ".join(warnings.warnings(found, (), untried))
