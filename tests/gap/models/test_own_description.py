"""Descriptions of a user's own robot, its logs, and maps of their columns."""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.gap.bench import mjcf_cases
from bns.gap.candidates import mjcf
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.recordings import load_recordings
from bns.worlds.data import dataset
from tests.sources import ROOT

ARM = ROOT / "examples" / "arm" / "arm.toml"
MAP = """[columns]
time = { column = "t_ms", unit = "ms" }
shoulder_goal = { column = "g1", unit = "deg" }
elbow_goal = { column = "g2", unit = "deg" }
shoulder = { column = "a1", unit = "deg" }
elbow = { column = "a2", unit = "deg" }
trial = "run"
"""


@pytest.fixture(scope="module")
def arm():
    return OwnModel.read(ARM, threads=1)


@pytest.fixture
def log(tmp_path):
    rows = [f"{20 * n},10,-20,{n},{-n},{n // 50}" for n in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t_ms,g1,g2,a1,a2,run", *rows]) + "\n")
    return str(path)


def read(log, text):
    path = log.replace("log.csv", "map.toml")
    with open(path, "w", encoding="utf-8") as out:
        out.write(text)
    model = OwnModel.read(ARM, threads=1)
    return load_recordings.trials([log], model, columns=path)


def test_a_map_names_columns_and_units(log):
    trials = read(log, MAP)
    assert len(trials) == 2
    assert trials[0].commands.values[0] == pytest.approx(np.radians([10, -20]))
    assert trials[0].observed[10] == pytest.approx(np.radians([10, -10]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no table .columns."),
        (f'robot = "khepera3"\n{MAP}', "robot 'khepera3'"),
        (MAP.replace("elbow =", "elbo ="), "Did you mean 'elbow'"),
        (MAP.replace('"a2"', '"a3"'), "no column 'a3'"),
        (MAP.replace('"g2", unit = "deg"', '"g2", unit = "degrees"'), "a unit among"),
    ],
)
def test_what_is_wrong_with_a_map_is_said(log, text, said):
    with pytest.raises(BnsError, match=said) as caught:
        read(log, text)
    assert "\n" not in str(caught.value)


def test_logs_and_datasets_give_the_same_trials(arm, tmp_path):
    told = mjcf_cases.commands(arm, np.random.default_rng(0), 1, seconds=2.0)
    (trial,) = mjcf_cases.record(arm, told, [])
    dataset.write(tmp_path / "data", [trial])
    (kept,) = dataset.read(tmp_path / "data").trials
    np.testing.assert_array_equal(kept.observed, trial.observed)
    ends = np.searchsorted(np.cumsum(trial.commands.durations), trial.times, "right")
    rows = trial.commands.values[np.minimum(ends, len(trial.commands) - 1)]
    lines = ["time,shoulder_goal,elbow_goal,shoulder,elbow"]
    for time, goal, seen in zip(trial.times, rows, trial.observed, strict=True):
        lines.append(",".join(map(repr, map(float, (time, *goal, *seen)))))
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    (read,) = arm.read_log(str(tmp_path / "log.csv"))
    np.testing.assert_allclose(read.observed, trial.observed)
    np.testing.assert_allclose(read.commands.values, trial.commands.values)
    np.testing.assert_allclose(read.commands.durations, trial.commands.durations)


WRONG = {
    "no file": (("arm.xml", "leg.xml"), "There is no model file"),
    "no actuator": (("shoulder_servo", "shoulder_motor"), "actuator of the model"),
    "no joint": (('joint = "elbow"', 'joint = "knee"'), "joint of the model 'knee'"),
    "no keyframe": (('keyframe = "home"', 'keyframe = "rest"'), "'rest'"),
    "no part": (
        ('["upper_arm", "forearm"]', '["hand"]'),
        "body in .effects. body_mass",
    ),
    "no effect": (("joint_friction =", "joint_fiction ="), "Did you mean 'joint_fr"),
    "unknown key": (("[start]", "[begin]"), "Unknown key"),
    "no noise": (("noise = 0.002\n", ""), "positive noise"),
    "limits": (("low = -0.5", "low = 5"), "low < high"),
}


@pytest.mark.parametrize("kind", sorted(WRONG))
def test_what_is_wrong_with_a_description_is_said(kind, tmp_path):
    (old, new), said = WRONG[kind]
    text = ARM.read_text()
    assert old in text
    (tmp_path / "arm.toml").write_text(text.replace(old, new))
    (tmp_path / "arm.xml").write_text(ARM.with_suffix(".xml").read_text())
    with pytest.raises(BnsError, match=said) as caught:
        OwnModel.read(tmp_path / "arm.toml", threads=1)
    assert "\n" not in str(caught.value)


def test_what_is_wrong_with_a_log_is_said(arm, tmp_path):
    (tmp_path / "log.csv").write_text(
        "time,shoulder_goal,elbow_goal,shoulder\n1,2,3,4\n"
    )
    with pytest.raises(FormatError, match="no column 'elbow'"):
        arm.read_log(str(tmp_path / "log.csv"))


def test_a_joint_far_beyond_its_range_is_in_another_unit(tmp_path):
    text = ARM.with_suffix(".xml").read_text()
    limited = text.replace('name="elbow" axis', 'name="elbow" range="-115 115" axis')
    (tmp_path / "arm.xml").write_text(limited)
    (tmp_path / "arm.toml").write_text(ARM.read_text())
    model = OwnModel.read(tmp_path / "arm.toml", threads=1)
    head, rows = "time,shoulder_goal,elbow_goal,shoulder,elbow", "{0},0.1,0.2,0.6,{1}"
    log = tmp_path / "log.csv"
    for angle in (1.2, 69.0):  # [rad], [deg]
        log.write_text("\n".join([head, *(rows.format(t, angle) for t in range(9))]))
        if angle == 1.2:
            assert len(model.read_log(str(log))) == 1
    with pytest.raises(FormatError, match="elbow comes to 69 rad, and joint 'elbow'"):
        model.read_log(str(log))


def test_former_names_in_a_description_are_read(arm):
    config = replace(
        OwnConfig.read(ARM),
        effects={"sensor_gain": ("elbow",)},
        bounds={"sensor_gain[elbow]": {"high": 1.5}},
    )
    (made,) = mjcf.candidates(config, arm.physics.model)
    assert (made.name, made.high) == ("sensor_gain[elbow]", 1.5)  # as it was written
    assert str(made.make(1.2)) == "reading_gain:part=elbow,factor=1.2"


def test_an_effect_that_says_nothing_of_its_motion_is_a_candidate(arm, monkeypatch):
    monkeypatch.delitem(mjcf.EXCITE, "command_rate")
    config = replace(OwnConfig.read(ARM), effects={"command_rate": ("elbow_goal",)})
    (item,) = mjcf.candidates(replace(config, bounds={}), arm.physics.model)
    assert item.excite == "any motion" and item.unit == "s/(rad)"


@pytest.mark.parametrize("given", [{"low": 2.0, "high": 0.5}, {"low": 9.0}])
def test_bounds_with_nothing_between_are_refused(arm, given):
    config = replace(
        OwnConfig.read(ARM),
        effects={"reading_gain": ("elbow",)},
        bounds={"reading_gain[elbow]": given},
    )
    with pytest.raises(BnsError, match=r"reading_gain\[elbow\]: low = .* give both"):
        mjcf.candidates(config, arm.physics.model)


def test_the_description_in_the_documentation_is_one(tmp_path):
    page = (ARM.parents[2] / "docs" / "gap_your_robot.md").read_text()
    (tmp_path / "arm.toml").write_text(page.split("```")[1])
    (tmp_path / "arm.xml").write_text(ARM.with_suffix(".xml").read_text())
    text = (tmp_path / "arm.toml").read_text()
    assert "[log]" in text and "[bounds]" in text
    elbow = '[commands.elbow_goal]\nactuator = "elbow_servo"\nunit = "rad"\n'
    (tmp_path / "arm.toml").write_text(text + elbow + "low = 0\nhigh = 2\n")
    made = OwnModel.read(tmp_path / "arm.toml", threads=1)
    bounds = {item.name: item for item in made.listed}
    assert bounds["joint_damping[elbow]"].high == 0.5
    assert bounds["body_mass[forearm]"].slack == 0.01
    assert made.config.log["shoulder"] == ("q1", "deg", 1.0)


def test_commands_between_steps_of_the_model_begin_when_they_were_told(arm, tmp_path):
    step = 2.5 * arm.dt  # as of 200 Hz and 2 ms
    count = 201
    lines = ["time,shoulder_goal,elbow_goal,shoulder,elbow"]
    lines += [
        f"{n * step},{0.2 * np.sin(n / 20)},0.1,0,{n / 1e3}" for n in range(count)
    ]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    (trial,) = load_recordings.trials([str(tmp_path / "log.csv")], arm)
    np.testing.assert_allclose(trial.commands.durations, step)


@pytest.mark.parametrize(
    ("effect", "part"),
    [
        ("tendon_arm", "cord/elbow"),
        ("coupling_ratio", "elbow"),
        ("command_play", "elbow"),  # which is observed
        ("reading_gain", "elbow_goal"),  # which is told
    ],
)
def test_effects_on_parts_that_the_model_lacks_are_refused_at_once(effect, part):
    config = replace(OwnConfig.read(ARM), effects={effect: (part,)}, bounds={})
    with pytest.raises(UnknownNameError, match=part):
        OwnModel(config, threads=1)
