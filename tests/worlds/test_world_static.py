"""The static-SNN world: its networks, its files, what effects it can have."""

import json

import numpy as np
import pytest

from bns.errors import BnsError, FormatError, OutOfBoundsError
from bns.worlds.static_snn import StaticNets, StaticSnnWorld, kinematic_nets
from bns.worlds.trial import Commands, body_displacements


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
