"""What a description does not list, where that explains what its effects leave."""

import numpy as np

from bns.gap.bench import mjcf_cases
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import effects
from bns.gap.models.mjcf.model import OwnModel
from bns.viz.gap import report
from tests.gap.own_robots import ARM, MOTORS

DESCRIBED = """
name = "arm"
model = "robot.xml"
commands.hip = { actuator = "hip", unit = "N m", low = -2.0, high = 2.0 }
commands.calf = { actuator = "calf", unit = "N m", low = -0.5, high = 0.5 }
observed.q0 = { joint = "FL_hip_joint", unit = "rad", noise = 0.002 }
observed.q1 = { joint = "FL_calf_joint", unit = "rad", noise = 0.002 }
[effects]
actuator_gain = ["hip", "calf"]
joint_armature = ["FL_calf_joint"]
"""
GAIN = ("actuator_gain", {"part": "hip", "factor": 1.2})
FRICTION = ("joint_friction", {"part": "FL_calf_joint", "added": 0.1})
RUBS = "joint_friction[FL_calf_joint]"


def diagnosis(folder, *planted):
    """Of an arm whose description lists gains and an armature."""
    actuators = MOTORS
    for name in ("hip", "calf"):
        told = f'joint="FL_{name}'
        actuators = actuators.replace(told, f'name="{name}" {told}')
    (folder / "robot.xml").write_text(ARM.replace("ACTUATORS", actuators))
    (folder / "own.toml").write_text(DESCRIBED)
    arm = OwnModel.read(folder / "own.toml", threads=1)
    told = mjcf_cases.commands(arm, np.random.default_rng(0), 3)
    made = [effects.make(name, values) for name, values in planted]
    return diagnose(mjcf_cases.record(arm, told, made), arm, full=False)


def test_a_cause_that_is_not_listed_is_named_beside_the_verdict(tmp_path):
    found = diagnosis(tmp_path, FRICTION)
    assert found.verdict.kind == "none of the library"
    assert found.verdict.change == f"List in [effects] what explains it: {RUBS}."
    assert found.decomposition["unlisted"]["names"] == [RUBS]
    assert f"[effects] does not list, {RUBS} = 0.0999" in found.verdict.sentence
    assert report.title(found) == f"Not listed in [effects]: {RUBS}"


def test_what_listed_effects_imitate_is_told_with_those_that_are_right(tmp_path):
    found = diagnosis(tmp_path, GAIN, FRICTION)
    assert found.decomposition["unlisted"]["names"] == [RUBS, "actuator_gain[hip]"]
    assert found.verdict.kind == "none of the library"  # two gains imitate it


def test_nothing_further_is_searched_where_the_listed_effects_explain_all(tmp_path):
    found = diagnosis(tmp_path, GAIN)
    assert found.verdict.named == (("actuator_gain[hip]",),)
    assert found.decomposition["unlisted"] == {"searched": False, "names": []}
