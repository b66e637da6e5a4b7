"""What effects on walking robots do, against answers known in advance."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.models import ax12a
from bns.worlds import registry as worlds
from bns.worlds.damage import Damage
from bns.worlds.effects import leg_sets as legs
from bns.worlds.effects import registry
from bns.worlds.physics import servo_law
from bns.worlds.trial import Channel, Commands
from tests.worlds.effects.subjects import edited

LEGS = tuple(Channel(*item) for item in models.robot("phantomx").channels)
NOMINAL = servo_law.joint_numbers(ax12a.law())


def phantomx(*texts: str) -> mujoco.MjModel:
    return edited(models.spec("phantomx", visuals=False), *texts)


def stiffness(model, joint: str) -> float:
    return float(model.actuator(joint).gainprm[0])


def ran(*damages: str, goals=None, **settings) -> list:
    """One trial per damage ("" = none), of the same commands."""
    goals = np.zeros((1, 18)) if goals is None else np.atleast_2d(goals)
    commands = Commands(goals, np.full(len(goals), 2.0), LEGS)
    damage = [(text,) if text else () for text in damages]
    world = worlds.make("hexapod", damage=damage, truth=True, **settings)
    return world.run([commands] * len(damages))


def test_damage_types_are_the_classes_of_the_symmetries():
    def classes(sets):
        other_end = {1: 3, 2: 4, 3: 1, 4: 2, 5: 5, 6: 6}
        made = set()
        for item in sets:
            ends = tuple(sorted(other_end[leg] for leg in item))
            images = [item, ends, legs.mirrored(item), legs.mirrored(ends)]
            made.add(min(tuple(sorted(image)) for image in images))
        return made

    assert len(legs.subsets()) == 31
    assert len(classes(legs.subsets())) == 20
    assert classes(legs.TYPES.values()) == classes(legs.subsets())
    assert len(classes(legs.TYPES[number] for number in range(16))) == 16


def test_legs_are_named_in_three_ways():
    ways = ("legs=1,5", "legs=5,1", "legs=left_front+left_middle", "legs=type4")
    made = {str(registry.parse(f"leg_raised:{way},blend=1")) for way in ways}
    assert made == {"leg_raised:legs=1,5,blend=1"}
    (event,) = Damage.parse("leg_raised:legs=1,5,blend=1@100").events
    assert str(event) == "leg_raised:legs=1,5,blend=1@100"
    with pytest.raises(BnsError, match="all legs are too many"):
        registry.parse("leg_missing:legs=all,loss=1")


def test_a_raised_leg_is_up_from_the_start_and_a_missing_one_weighs_nothing():
    goals = np.array([[0.1, 0, 0] * 6])
    sound, raised, missing, limp = ran(
        "",
        "leg_raised:legs=2,blend=1",
        "leg_missing:legs=2,loss=1",
        "leg_limp:legs=2,loss=1",
        goals=goals,
    )
    femur = raised.channel("right_front_femur_position")
    assert femur.min() > 1.25 and sound.channel("right_front_femur_position").max() < 1
    other = raised.channel("left_front_femur_position")[-1]
    assert other == pytest.approx(0.05, abs=0.1)
    assert not any(trial.outcome.fell for trial in (raised, missing, limp))
    hangs = limp.channel("right_front_femur_position")[-1]
    assert abs(hangs - sound.channel("right_front_femur_position")[-1]) > 0.02
    light, whole = phantomx("leg_missing:legs=2,loss=1"), phantomx()
    gone = whole.body_mass.sum() - light.body_mass.sum()
    assert gone == pytest.approx(0.209, abs=1e-3)
    assert light.nq == whole.nq and light.npair == whole.npair - 9


def test_a_limp_leg_has_friction_alone():
    model = phantomx("leg_limp:legs=3,loss=1")
    assert stiffness(model, "left_rear_femur") == 0
    assert model.joint("left_rear_femur").damping[0] == ax12a.law()["viscous"]
    assert stiffness(model, "left_front_femur") > 8
    laws = servo_law.laws(model)
    assert (
        laws["powered"].reshape(6, 3).tolist()
        == [[1] * 3, [1] * 3, [0] * 3] + [[1] * 3] * 3
    )


def test_a_locked_joint_stays_and_a_partly_locked_one_has_less_range():
    joint, locked = "left_front_femur", "joint_locked:joint=left_front_femur"
    told = np.zeros((2, 18))
    told[:, 1] = 0.6, -0.4
    (held,) = ran(f"{locked},loss=1,angle=0.3", goals=told)
    assert np.abs(held.channel(f"{joint}_position") - 0.3).max() < 0.03
    low, high = models.robot("phantomx").ranges[1]
    half = phantomx(f"{locked},loss=0.5,angle=0").joint(joint).range
    np.testing.assert_allclose(half, [low / 2, high / 2], atol=1e-3)


def test_servo_effects_reach_the_chosen_servos_and_compose():
    model = phantomx("servo_gain:servo=femur,factor=0.5", "servo_voltage:factor=0.8")
    both, one = (
        stiffness(model, "right_rear_femur"),
        stiffness(model, "right_rear_coxa"),
    )
    assert both == pytest.approx(0.4 * NOMINAL.stiffness)
    assert one == pytest.approx(0.8 * NOMINAL.stiffness)
    weak = phantomx("joint_weak:joint=left_rear_tibia,factor=0.4")
    assert stiffness(weak, "left_rear_tibia") == pytest.approx(0.4 * NOMINAL.stiffness)
    limit = weak.actuator("left_rear_tibia").forcerange[1]
    assert limit == pytest.approx(0.4 * NOMINAL.torque_limit)
    dry = phantomx("servo_coulomb:servo=left_rear,torque=0.03")
    assert dry.joint("left_rear_coxa").frictionloss[0] == pytest.approx(0.08)
    assert dry.joint("left_front_coxa").frictionloss[0] == pytest.approx(0.05)


def test_an_offset_shifts_the_joint_and_not_the_reading():
    told = np.zeros((1, 18))
    told[0, 1] = 1.0  # in the air
    offset = "servo_offset:servo=left_front_coxa,angle=0.1"
    sound, shifted = ran("", offset, goals=told)
    reading = [t.channel("left_front_coxa_position")[-1] for t in (sound, shifted)]
    joint = [trial.truth["qpos"][-1, 7] for trial in (sound, shifted)]
    assert joint[0] == pytest.approx(0.0, abs=0.02)
    assert joint[1] == pytest.approx(-0.1, abs=0.03)
    assert reading[1] - joint[1] == pytest.approx(0.1, abs=ax12a.UNIT)


def test_late_goals_start_late():
    told = np.zeros((1, 18))
    told[0, 1] = 1.0
    sound, late, latency = ran(
        "",
        "servo_delay:servo=left_front,delay=0.1",
        "command_latency:delay=0.1",
        goals=told,
        sample_dt=0.004,
    )

    def begins(trial):
        angle = trial.channel("left_front_femur_position")
        return trial.times[np.argmax(angle > angle[0] + 0.2)]

    assert begins(late) - begins(sound) == pytest.approx(0.1, abs=0.009)
    assert begins(latency) - begins(sound) == pytest.approx(0.1, abs=0.009)


def test_a_loose_horn_hangs_in_its_play():
    told = np.zeros((1, 18))
    told[0, 1] = 1.0  # in the air
    (loose,) = ran("loose_horn:joint=left_front_femur,angle=0.2", goals=told)
    model = phantomx("loose_horn:joint=left_front_femur,angle=0.2")
    at = model.jnt_qposadr[model.joint("left_front_femur_play").id]
    play = loose.truth["qpos"][-1, at]
    assert play == pytest.approx(-0.1, abs=0.02)  # the leg's weight pulls it down
    shaft = loose.channel("left_front_femur_position")[-1]
    assert shaft == pytest.approx(1.0, abs=0.06)
    assert model.joint("left_front_femur_play").range.tolist() == [-0.1, 0.1]
    wider = phantomx(*["loose_horn:joint=left_front_femur,angle=0.2"] * 2)
    assert wider.joint("left_front_femur_play").range.tolist() == [-0.2, 0.2]


def test_floor_feet_links_and_loads():
    model, bare = phantomx("foot_slippery:legs=2,factor=0.25"), phantomx()
    assert model.geom("right_front_foot").friction[0] == pytest.approx(0.2)
    assert model.geom("left_front_foot").friction[0] == 0.8
    every = phantomx("floor_friction:factor=0.5")
    assert every.geom("right_rear_foot").friction[0] == pytest.approx(0.4)
    soft = phantomx("floor_compliance:factor=3")
    assert soft.geom("left_rear_foot").solref[0] == pytest.approx(0.03)
    long = phantomx("link_length:legs=1,factor=1.1")
    assert long.site("left_front_foot").pos[0] == pytest.approx(0.133 * 1.1)
    assert long.geom("left_front_foot").pos[0] == pytest.approx(0.126 * 1.1)
    assert long.site("right_front_foot").pos[0] == pytest.approx(0.133)
    thigh = phantomx("link_length:part=femur,factor=0.9")
    assert thigh.body("left_rear_tibia").pos[0] == pytest.approx(0.066 * 0.9)
    assert thigh.geom("left_rear_femur").size[1] == pytest.approx(0.033 * 0.9)
    heavy = phantomx("payload:mass=0.5,x=0.05")
    assert heavy.body_mass.sum() == pytest.approx(bare.body_mass.sum() + 0.5)
    sound, loaded = ran("", "payload:mass=0.5")
    sinks = sound.truth["qpos"][0, 2] - loaded.truth["qpos"][0, 2]
    assert 0.0003 < sinks < 0.02


def test_what_a_joint_can_not_hold_is_refused():
    spec = models.spec("phantomx", visuals=False)
    with pytest.raises(BnsError, match="can not represent 'dead_zone'"):
        registry.parse("servo_dead_zone:angle=0.05").edit(spec)
