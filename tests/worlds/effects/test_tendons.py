"""Effects on tendons, against answers that are known beforehand."""

import pytest

from tests.worlds.effects.subjects import at_rest, built


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
