"""What was told before a log begins: the first command, where nothing else would have
kept the robot where it was seen first."""

import mujoco
import numpy as np
import pytest

from bns.gap.decomposition import fit
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import start
from bns.gap.models.mjcf.model import OwnModel

LIFT = """<mujoco model="lift"><option timestep="0.002"/>
  <worldbody><body name="cage">
    <joint name="rise" type="slide" axis="0 0 1" damping="0.8"/>
    <geom type="box" size="0.1 0.1 0.1" mass="0.5"/></body></worldbody>
  <actuator><motor name="winch" joint="rise"/></actuator></mujoco>"""
DESCRIPTION = """name = "lift"
model = "lift.xml"
[commands.winch]
actuator = "winch"
unit = "N"
low = 0
high = 10
[observed.rise]
joint = "rise"
unit = "m"
noise = 0.001
[effects]
command_lag = ["winch"]
actuator_gain = ["winch"]
body_mass = ["cage"]
[log]
trial = "trial"
"""
WEIGHT = 0.5 * 9.81  # [N]


def lifted(folder, *, hovers=True, lag=0.0, more=0.0):
    """A lift and six trials of 2 s at 50 Hz, in which it is told a force every 0.4 s.

    Args:
        folder: where model, description and log are written.
        hovers: whether it hung from its winch before a log begins; else gravity is off.
        lag: time constant of the winch [s].
        more: mass that the recorded one has more [kg].
    """
    text = LIFT if hovers else LIFT.replace('"0.002"', '"0.002" gravity="0 0 0"')
    (folder / "lift.xml").write_text(text)
    (folder / "lift.toml").write_text(DESCRIPTION)
    heavier = text.replace('mass="0.5"', f'mass="{0.5 + more}"')
    model = mujoco.MjModel.from_xml_string(heavier)
    rng, lines = np.random.default_rng(3), ["time,winch,rise,trial"]
    for trial in range(6):
        data, told = mujoco.MjData(model), rng.uniform(-1.5, 1.5, 5).round(2)
        told = np.abs(told)
        if hovers:
            told = np.append(WEIGHT, WEIGHT + told[1:] * [1, -1, 1, -1]).round(4)
        force = told[0] if hovers else 0.0
        for sample in range(100):
            now = told[sample // 20]
            seen = data.qpos[0] + rng.normal(0, 0.001)
            lines.append(f"{sample / 50:.3f},{now},{seen:.5f},{trial}")
            for _ in range(10):
                force += (now - force) * (1 - np.exp(-0.002 / lag) if lag else 1.0)
                data.ctrl[0] = force
                mujoco.mj_step(model, data)
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    own = OwnModel.read(folder / "lift.toml", threads=1)
    return own, own.read_log(str(folder / "log.csv"))


@pytest.mark.parametrize("hovers", [True, False])
def test_the_first_command_was_told_before_if_it_alone_kept_the_robot(tmp_path, hovers):
    _, trials = lifted(tmp_path, hovers=hovers)
    for trial in trials:
        first = [list(trial.commands.values[0])]
        assert trial.conditions.get(start.BEFORE) == (first if hovers else None)


def test_what_was_not_seen_says_nothing_of_it(tmp_path):
    own, trials = lifted(tmp_path)
    blind = trials[0].replace(observed=np.full_like(trials[0].observed, np.nan))
    plain = [trial.replace(conditions={}) for trial in (blind, *trials[1:])]
    stood = own.physics.starts.stood
    made = start.held(plain, own.config, stood)
    assert all(start.BEFORE in trial.conditions for trial in made)
    assert start.held(plain[:1], own.config, stood) == plain[:1]


@pytest.mark.parametrize("hovers", [True, False])
def test_a_lag_is_found_whether_the_robot_hung_or_lay_before(tmp_path, hovers):
    own, trials = lifted(tmp_path, hovers=hovers, lag=0.08)
    found = diagnose(trials, own, full=False)
    assert list(found.best.names) == ["command_lag[winch]"]
    assert found.best.magnitudes[0] == pytest.approx(0.08, abs=0.01)


@pytest.mark.parametrize("more", [0.0, 0.011])
def test_a_load_of_five_times_what_a_mass_may_be_off_is_named(tmp_path, more):
    own, trials = lifted(tmp_path, more=more)
    found = diagnose(trials, own, full=False)
    assert list(found.best.names) == (["body_mass[cage]"] if more else [])


def test_what_slack_explains_is_simulated_no_more_exactly_than_explanations(tmp_path):
    own, trials = lifted(tmp_path, more=0.011)
    problem = Problem.of(trials, own)
    gap = problem.gap  # 0.2 m, most of which the mass explains within its slack
    first = fit.first_noise(problem, gap, problem.recorded - gap)
    _, noise, _ = fit.linearised(problem, problem.nominal, gap, first, order=0)
    far = np.abs(gap) > 0.1
    assert (noise.sd[far] > 0.9 * Row.inexact * np.abs(gap[far])).all()


@pytest.mark.parametrize("order", [0, 1])
def test_noise_is_a_number_where_nothing_was_seen(tmp_path, order):
    own, trials = lifted(tmp_path, more=0.011)
    problem = Problem.of(trials, own)
    problem = problem.without(np.arange(len(problem.trial)) % 50 < 5)
    gap = problem.gap
    motion = np.nan_to_num(problem.recorded - gap)
    first = fit.first_noise(problem, gap, motion)
    _, noise, _ = fit.linearised(problem, problem.nominal, gap, first, order=order)
    assert np.isfinite(noise.sd).all()
    assert np.isfinite(noise.loss(gap))
