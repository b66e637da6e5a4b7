"""The worlds of wheeled robots.

Physics: known motions, cuts, damage within a trial, divergence. Static SNNs: networks,
files, what effects they can have.
"""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bns.errors import BnsError, FormatError, OutOfBoundsError
from bns.worlds import registry
from bns.worlds.damage import Damage, Event
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.physics import compile, rollout
from bns.worlds.static_snn import StaticNets, StaticSnnWorld, kinematic_nets
from bns.worlds.trial import Commands, body_displacements

AXLE = 0.0874  # [m] between the wheels, models/khepera3


class Pull(BodyEffect):
    """Gravity in multiples of the nominal one, and a share of it sideways."""

    name = "test_pull"
    doc = "gravity is scaled and tilted"
    parameters = (
        Parameter("factor", "1", 1.0, -1e30, 1e30, "", 2.0),
        Parameter("aside", "1", 0.0, 0.0, 10.0, "", 1.0),
        Parameter("nothing", "1", 0.0, 0.0, 1.0, "", 1.0),
    )

    def edit(self, spec):
        down = spec.option.gravity[2]
        spec.option.gravity = [0, down * self["aside"], down * self["factor"]]


def run(commands, trial=0, seeds=(), **settings):
    """One trial of one robot."""
    world = registry.make("mujoco", **settings)
    return world.run([commands], trial=trial, seeds=seeds)[0]


def drive(left, right, duration):
    """A single command."""
    return Commands([[left, right]], [duration])


def gravity(factor=1.0, aside=0.0, nothing=0.0, **schedule):
    """Another gravity, as damage."""
    values = {"factor": factor, "aside": aside, "nothing": nothing}
    return Damage((Event(Pull(values), **schedule),))


def test_a_straight_drive_covers_speed_times_time():
    trial = run(drive(0.1, 0.1, 6.0))
    second = trial.poses_world[trial.times >= 3.0]
    way = second[-1, 0] - second[0, 0]
    assert way == pytest.approx(0.1 * 3.0, rel=0.03)
    assert abs(trial.poses_world[-1, 1]) < 1e-3


def test_a_spin_turns_by_speed_over_half_the_axle_and_yaw_is_continuous():
    trial = run(drive(-0.1, 0.1, 6.0))
    second = trial.poses_world[trial.times >= 3.0]
    turn = second[-1, 2] - second[0, 2]
    assert turn == pytest.approx(0.1 / (AXLE / 2) * 3.0, rel=0.1)
    assert second[-1, 2] > 2 * np.pi
    assert np.diff(trial.poses_world[:, 2]).max() < 0.3
    assert np.hypot(*trial.poses_world[-1, :2]) < 0.01


def test_yaw_is_continuous_with_coarse_samples():
    fine = run(drive(-0.1, 0.1, 6.0))
    coarse = run(drive(-0.1, 0.1, 6.0), sample_dt=3.0)
    assert coarse.times.tolist() == [0.0, 3.0, 6.0]
    assert coarse.poses_world[-1, 2] == fine.poses_world[-1, 2]


def test_mirrored_commands_give_a_mirrored_path():
    values, durations = np.array([[0.12, 0.06], [-0.05, 0.1]]), [2.0, 1.0]
    left = run(Commands(values, durations)).poses_world
    right = run(Commands(values[:, ::-1], durations)).poses_world
    assert np.abs(left[-1, 1]) > 0.05
    assert left == pytest.approx(right * [1, -1, -1], abs=1e-6)


def test_the_start_pose_moves_the_path_rigidly():
    commands = Commands([[0.1, 0.05], [0.1, 0.1]], [1.0, 1.0])
    home = run(commands).poses_world
    away = run(commands, start=(0.3, -0.2, 7.0)).poses_world
    cos, sin = np.cos(7.0), np.sin(7.0)
    turned = home[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + [0.3, -0.2]
    assert away[:, :2] == pytest.approx(turned, abs=1e-4)
    assert away[:, 2] == pytest.approx(home[:, 2] + 7.0, abs=1e-3)


def test_samples_lie_on_a_grid_and_at_the_ends_of_commands():
    trial = run(Commands([[0.1, 0.1], [0, 0]], [0.2522, 0.201]), sample_dt=0.1)
    assert trial.times == pytest.approx([0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.45])
    assert trial.boundaries.tolist() == [0, 3, 6]


def test_threads_and_sample_times_change_no_bit():
    rng = np.random.default_rng(0)
    commands = [
        Commands(rng.uniform(-0.12, 0.12, (k, 2)), rng.uniform(0.2, 1.0, k))
        for k in (1, 5, 2, 4, 3, 6)
    ]
    ends = {
        threads: [t.command_poses_world for t in world.run(commands)]
        for threads in (1, 2, 4)
        for world in [registry.make("mujoco", threads=threads, sample_dt=0.1 * threads)]
    }
    for pair in zip(*ends.values(), strict=True):
        assert len({poses.tobytes() for poses in pair}) == 1


def test_a_cut_without_a_change_gives_the_same_bytes():
    scene = compile.compiled("khepera3")
    start = compile.start_state(scene, (0.0, 0.0, 0.0))
    control = np.repeat([[5.0, 2.0], [-3.0, 4.0]], 100, axis=0)
    whole = rollout.run(rollout.Job(start, (rollout.Segment(scene, control),)))
    cuts = (0, 1, 37, 100, 163, 200)
    pieces = [rollout.Segment(scene, control[a:b]) for a, b in pairwise(cuts)]
    cut = rollout.run(rollout.Job(start, tuple(pieces)))
    assert cut.states.tobytes() == whole.states.tobytes()
    assert whole.diverged == cut.diverged == -1
    assert np.ptp(whole.states[:, 1]) > 0.01


def test_a_model_compiled_anew_and_unchanged_goes_on_to_the_same_bytes():
    commands = drive(0.1, 0.05, 2.0)
    hit = run(commands, damage=gravity(nothing=1.0, onset_time=1.0))
    assert "test_pull" in hit.conditions["damage"][0]
    assert hit.observed.tobytes() == run(commands).observed.tobytes()


@pytest.mark.parametrize(
    "text",
    [
        "wheel_gain:wheel=left,factor=0.5@0:1.0s..0:1.5s",
        "wheel_diameter:wheel=left,factor=0.8@0:1.0s..0:1.5s",
        "rolling_drag:wheel=left,torque=0.002,breakaway=0.004@0:1.0s..0:1.5s",
    ],
)
def test_damage_within_a_trial_starts_and_stops_there(text):
    commands = drive(0.1, 0.1, 3.0)
    sound, hit = run(commands), run(commands, damage=[text])
    before = sound.times <= 1.0
    assert hit.observed[before].tobytes() == sound.observed[before].tobytes()
    turn = np.diff(hit.poses_world[:, 2])
    during = (hit.times[1:] > 1.1) & (hit.times[1:] <= 1.5)
    after = hit.times[1:] > 2.2
    assert (turn[during] > 0.01).all()
    assert np.abs(turn[after]).max() < 0.002
    assert "from 1 s to 1.5 s" in hit.conditions["damage"][0]


def test_damage_that_starts_after_the_trial_changes_nothing():
    late = run(drive(0.1, 0.1, 1.0), damage=["payload:mass=0.3@0:5.0s"])
    assert late.conditions["damage"] == []
    assert late.observed.tobytes() == run(drive(0.1, 0.1, 1.0)).observed.tobytes()


def test_the_longest_robot_of_a_batch_does_not_touch_the_shortest():
    world = registry.make("mujoco", threads=1)
    short = drive(0.1, 0.02, 0.5)
    together = world.run([short, drive(0.05, 0.05, 8.0)])[0]
    assert together.times[-1] == 0.5
    assert together.observed.tobytes() == world.run([short])[0].observed.tobytes()


def test_a_diverged_trial_is_flagged_and_its_poses_are_lost():
    wild = gravity(-1e30, onset_time=0.5)
    commands = [drive(0.1, 0.1, 1.0)] * 2
    bad, good = registry.make("mujoco", damage=[wild, Damage.none()]).run(commands)
    assert bad.outcome.diverged and not bad.outcome.usable
    assert not good.outcome.diverged
    lost = np.isnan(bad.observed)
    assert (lost.all(axis=1) == lost.any(axis=1)).all()
    assert lost[-1].all()
    early = bad.times <= 0.5
    assert bad.observed[early].tobytes() == good.observed[early].tobytes()
    assert np.isfinite(good.observed).all()


def test_a_trial_that_diverges_at_once_is_flagged():
    for factor in (1e20, -1e30):
        trial = run(drive(0.1, 0.1, 0.005), damage=gravity(factor))
        assert trial.outcome.diverged
        assert np.isnan(trial.observed[-1]).all()


def test_a_robot_that_tips_over_is_flagged():
    assert not run(drive(0.1, 0.1, 0.5)).outcome.fell
    trial = run(drive(0.1, 0.1, 2.0), damage=gravity(0.1, aside=3.0, onset_time=0.2))
    assert trial.outcome.fell
    assert not trial.outcome.diverged


def test_truth_is_kept_if_asked():
    trial = run(drive(0.1, 0.1, 1.0), truth=True)
    qpos = trial.truth["qpos"]
    assert qpos.shape == (len(trial.times), 9)
    assert qpos[:, :2] == pytest.approx(trial.poses_world[:, :2])
    assert run(drive(0.1, 0.1, 1.0)).truth == {}


def test_mujoco_writes_no_log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(drive(0.1, 0.1, 0.5), damage=gravity(1e30)).outcome.diverged
    assert not list(Path.cwd().iterdir())


def test_effects_of_another_stage_or_robot_are_refused(monkeypatch):
    monkeypatch.setattr(Pull, "robots", ("legged",))
    with pytest.raises(BnsError, match="this robot is wheeled"):
        registry.make("mujoco", damage=gravity(2.0))
    monkeypatch.setattr(Pull, "stage", "sensor")
    with pytest.raises(BnsError, match="an effect on the sensor"):
        registry.make("mujoco", damage=gravity(2.0))


@pytest.fixture(scope="module")
def nets():
    """Small networks with random weights."""
    rng = np.random.default_rng(0)
    return StaticNets(
        w1=rng.normal(size=(3, 5, 4)),
        b1=rng.normal(size=(3, 4)),
        w2=rng.normal(size=(3, 4)),
        b2=rng.normal(size=3),
        input_scale=np.array([10, 10, 10, 10, 0.3]),
        output_scale=np.array([0.1, 0.05, 0.5]),
        provenance={"world": "test"},
    )


def by_hand(nets, inputs):
    """The formula of the docstring, output by output."""
    outputs = []
    for k in range(3):
        hidden = 1 / (
            1 + np.exp(-((nets.input_scale * inputs) @ nets.w1[k] + nets.b1[k]))
        )
        outputs.append(nets.output_scale[k] * (nets.w2[k] @ hidden + nets.b2[k]))
    return outputs


def test_networks_follow_their_formula(nets):
    inputs = np.array([0.1, -0.05, 0.02, 0.1, 1.3])
    assert nets(inputs[None])[0] == pytest.approx(by_hand(nets, inputs), rel=1e-12)


def test_a_trial_is_the_sum_of_what_the_networks_say(nets):
    commands = Commands([[0.1, 0.02], [-0.1, 0.1], [0.05, 0.05]], [0.5, 1.0, 2.0])
    world = StaticSnnWorld(nets, start=(0.1, -0.2, 0.3))
    (trial,) = world.run([commands])
    moved = body_displacements(trial.command_poses_world)
    before = [[0, 0], [0.1, 0.02], [-0.1, 0.1]]
    for k in range(3):
        inputs = [*before[k], *commands.values[k], commands.durations[k]]
        assert moved[k] == pytest.approx(by_hand(nets, np.array(inputs)), rel=1e-9)
    assert trial.times == pytest.approx([0, 0.5, 1.5, 3.5])
    assert trial.poses_world[0] == pytest.approx([0.1, -0.2, 0.3])


def test_the_default_drives_like_an_ideal_robot():
    commands = Commands([[0.1, 0.1], [-0.1, 0.1], [0.06, 0.12]], [2.0, 1.5, 1.0])
    (trial,) = StaticSnnWorld().run([commands])
    moved = body_displacements(trial.command_poses_world)
    axle = kinematic_nets().provenance["axle"]
    assert moved[0] == pytest.approx([0.2, 0, 0], abs=5e-3)
    assert moved[1] == pytest.approx([0, 0, 0.2 / axle * 1.5], abs=5e-3)
    assert moved[2, 2] == pytest.approx(0.06 / axle, abs=5e-3)


def test_a_damaged_command_acts_as_the_command_it_becomes(nets):
    commands = Commands([[0.1, 0.1], [0.05, 0.1]], [1.0, 2.0])
    damaged = StaticSnnWorld(nets, damage=["wheel_gain:wheel=left,factor=0.5"])
    weaker = Commands(commands.values * [0.5, 1.0], commands.durations)
    (hit,), (sound,) = damaged.run([commands]), StaticSnnWorld(nets).run([weaker])
    assert hit.observed.tobytes() == sound.observed.tobytes()
    assert hit.commands is commands


def test_damage_within_a_command_acts_by_its_share(nets):
    half = StaticSnnWorld(nets, damage=["wheel_gain:wheel=left,factor=0.5@0:1.0s"])
    (hit,) = half.run([Commands([[0.1, 0.1]], [2.0])])
    (mean,) = StaticSnnWorld(nets).run([Commands([[0.075, 0.1]], [2.0])])
    assert hit.observed == pytest.approx(mean.observed, abs=1e-12)


def test_noise_scatters_displacements_by_as_much(nets):
    world = StaticSnnWorld(nets, noise=(0.01, 0.02, 0.0))
    commands = [Commands([[0.1, 0.1]], [1.0])] * 400
    poses = np.array([t.poses_world[-1] for t in world.run(commands, seeds=range(400))])
    assert poses[:, :2].std(axis=0) == pytest.approx([0.01, 0.02], rel=0.15)
    assert np.ptp(poses[:, 2]) == 0


def test_what_it_cannot_represent_is_refused(nets):
    with pytest.raises(
        BnsError, match="cannot represent 'payload', an effect on the b"
    ):
        StaticSnnWorld(nets, damage=["payload:mass=0.2"])
    with pytest.raises(OutOfBoundsError, match="noise"):
        StaticSnnWorld(nets, noise=(0, float("nan"), 0))
    with pytest.raises(BnsError, match="shape"):
        StaticNets(nets.w1, nets.b1, nets.w2.T, nets.b2, nets.input_scale, np.ones(3))


def test_networks_survive_a_file(nets, tmp_path):
    file = tmp_path / "nets.npz"
    nets.save(file)
    read = StaticNets.load(file)
    for name in ("w1", "b1", "w2", "b2", "input_scale", "output_scale"):
        assert getattr(read, name).tobytes() == getattr(nets, name).tobytes()
    assert read.provenance == {"world": "test"}
    commands = [Commands([[0.1, 0.05]], [1.0])]
    from_file, direct = StaticSnnWorld(str(file)), StaticSnnWorld(nets)
    assert from_file.run(commands)[0].observed.tobytes() == (
        direct.run(commands)[0].observed.tobytes()
    )
    with pytest.raises(BnsError, match="not overwritten"):
        nets.save(file)
    again = tmp_path / "again.npz"
    nets.save(again)
    assert again.read_bytes() == file.read_bytes()


def test_files_that_are_no_networks_are_refused(nets, tmp_path):
    with pytest.raises(FormatError, match=r"no\.npz"):
        StaticNets.load(tmp_path / "no.npz")
    text = tmp_path / "text.npz"
    text.write_text("hello")
    with pytest.raises(FormatError, match="cannot be read as NPZ"):
        StaticNets.load(text)
    whole = tmp_path / "whole.npz"
    nets.save(whole)
    half = tmp_path / "half.npz"
    half.write_bytes(whole.read_bytes()[:500])
    with pytest.raises(FormatError, match="cannot be read as NPZ"):
        StaticNets.load(half)
    for header, says in (
        ({"schema": "other", "version": 1}, "schema 'other'"),
        ({"schema": "bns-static-nets", "version": 9}, "version 9"),
    ):
        changed = tmp_path / f"{header['version']}.npz"
        np.savez(changed, header=np.array(json.dumps(header)), w1=nets.w1)
        with pytest.raises(FormatError, match=says):
            StaticNets.load(changed)
