"""Effects on tendons and couplings, against answers that are known beforehand."""

import pytest

from bns.errors import UnknownNameError
from tests.worlds.effects.subjects import ARM, at_rest, built

CORD = '<joint joint="elbow" coef="0.1"/>'


def test_a_tendon_of_a_stiffness_holds_its_joint_by_its_lever_squared():
    model = built("tendon_stiffness:part=cord,added=400", gravity=False)
    assert at_rest(model).qpos == pytest.approx(
        [0.5, 0.3 * 12 / (12 + 400 * 0.1**2)], abs=1e-3
    )


def test_a_tendon_is_damped_and_rubs_as_a_joint_is_by_its_lever():
    for what, joint in (
        ("tendon_damping:part=cord,added=50", "joint_damping:part=elbow,added=0.5"),
        (
            "tendon_friction:part=cord,added=4",
            "joint_friction:part=elbow,added=0.4",
        ),
    ):
        one, other = (
            at_rest(built(text, gravity=False), seconds=0.2) for text in (what, joint)
        )
        assert one.qpos == pytest.approx(other.qpos, abs=1e-3)


def test_a_slack_tendon_pulls_from_its_end_on():
    stiff = "tendon_stiffness:part=cord,added=1200"
    slack = "tendon_slack:part=cord,slack=0.02"
    held = at_rest(built(stiff, slack, gravity=False)).qpos[1]
    assert 12 * (0.3 - held) == pytest.approx(120 * (0.1 * held - 0.01), abs=0.02)


def test_a_lever_arm_counts_squared_and_the_tendon_stays_what_it_is():
    cord = "tendon_stiffness:part=cord,added=399"
    model = built(cord, "tendon_arm:part=cord/elbow,factor=0.5", gravity=False)
    assert model.tendon_stiffness == [400]
    assert at_rest(model).qpos == pytest.approx(
        [0.5, 0.3 * 12 / (12 + 400 * 0.05**2)], abs=1e-3
    )


def test_other_arms_of_a_tendon_stay():
    text = ARM.replace(CORD, f'<joint joint="shoulder" coef="0.2"/>{CORD}')
    changed = built("tendon_arm:part=cord/elbow,factor=1.2", xml=text)
    assert changed.wrap_prm == pytest.approx([0.2, 0.12])
    both = built("tendon_arm:part=cord/*,factor=1.2", xml=text)
    assert both.wrap_prm == pytest.approx([0.24, 0.12])


def test_a_joint_follows_by_another_ratio():
    text = ARM.replace('active="false"', 'solref="0.01 1"')
    for ratio in (0.8, 1.25):
        effect = f"coupling_ratio:part=elbow,factor={ratio}"
        shoulder, elbow = at_rest(built(effect, xml=text, gravity=False)).qpos
        assert elbow == pytest.approx(0.5 * ratio * shoulder, abs=0.02)


@pytest.mark.parametrize(
    "text", ["tendon_arm:part=cord/hip", "coupling_ratio:part=shoulder"]
)
def test_a_part_that_the_model_lacks_is_refused_with_those_it_has(text):
    with pytest.raises(UnknownNameError, match="elbow"):
        built(f"{text},factor=1.2")
