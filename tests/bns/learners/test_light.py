"""Closed-loop light following: known answers of every part, and the loop itself."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns.draws import Draws
from bns.errors import BnsError
from bns.experiment.task_settings import LightConfig
from bns.learners.bns.light import simulator as simulated
from bns.learners.bns.light.simulator import Simulator, Thetas
from bns.tasks.light import LampGoal, lost
from bns.tasks.light_controller import Controllers, GenomePolicy, brightness, counts
from tests.bns.robots import FakeLightWorld, small_light

TASK = LampGoal.of(LightConfig(goal=0.3, circle_cycles=40))


class TestController:
    def kind(self, *, recurrent=False, hidden=1):
        return Controllers(hidden, recurrent, -0.1, 0.1, 0.02)

    def test_genes_are_counted_with_biases(self):
        assert self.kind(hidden=5).genes == 5 * 3 + 2 * 6
        assert self.kind(hidden=5, recurrent=True).genes == 5 * 5 + 2 * 6

    def test_two_layers_by_hand(self):
        genome = torch.tensor([[1.0, -2.0, 0.5, 3.0, -1.0, 0.25, 0.0]])
        policy = GenomePolicy(self.kind(), genome)
        speeds, _ = policy.act(counts(np.array([[0.8, 0.3]])), policy.memory(1))
        neuron = np.tanh(0.8 - 2 * 0.3 + 0.5)
        told = 0.1 * np.tanh([3 * neuron + 0.25, -neuron])
        np.testing.assert_allclose(speeds[0], told, rtol=1e-5)

    def test_slow_wheels_stop(self):
        policy = GenomePolicy(self.kind(), torch.tensor([[0, 0, 0, 0, 0, 0.1, 3.0]]))
        speeds, _ = policy.act(np.full((1, 2), 4095.0), policy.memory(1))
        assert speeds[0, 0] == 0.0
        assert speeds[0, 1] == pytest.approx(0.1 * np.tanh(3.0))

    def test_recurrent_controllers_remember_their_outputs(self):
        genome = torch.zeros(1, self.kind(recurrent=True).genes)
        genome[0, 2] = 1.0  # from the left output to the neuron
        genome[0, 5] = 1.0  # from the neuron to the left output
        policy = GenomePolicy(self.kind(recurrent=True), genome)
        memory = np.array([[0.7, -0.2]])
        _, memory = policy.act(np.full((1, 2), 4095.0), memory)
        np.testing.assert_allclose(
            memory, [[np.tanh(np.tanh(0.7)), 0.0]], rtol=1e-5, atol=1e-7
        )

    @pytest.mark.parametrize("recurrent", [False, True])
    def test_robots_of_a_batch_do_not_mix(self, recurrent):
        kind = self.kind(recurrent=recurrent, hidden=3)
        genomes = Draws(3).uniform(4, kind.genes) * 4 - 2
        readings = np.linspace(0, 4095, 8).reshape(4, 2)
        whole = GenomePolicy(kind, genomes)
        together, _ = whole.act(readings, whole.memory(4))
        for robot in range(4):
            alone = GenomePolicy(kind, genomes[robot : robot + 1])
            one, _ = alone.act(readings[robot : robot + 1], alone.memory(1))
            np.testing.assert_allclose(one[0], together[robot], rtol=1e-6)

    def test_balanced_readings_are_what_other_weights_would_make_of_them(self):
        draws, plain = Draws(5), self.kind()
        genomes = draws.uniform(4, plain.genes) * 2 - 1
        hidden = plain.hidden
        weights = genomes[:, : 2 * hidden].view(4, hidden, 2)
        other = genomes.clone()
        other[:, : 2 * hidden] = 2 * weights.flatten(1)
        other[:, 2 * hidden : 3 * hidden] -= weights.sum(2)
        readings = np.linspace(0, 4095, 8).reshape(4, 2)
        balanced = replace(plain, balanced=True)
        one, _ = GenomePolicy(balanced, genomes).act(readings, np.zeros((4, 0)))
        two, _ = GenomePolicy(plain, other).act(readings, np.zeros((4, 0)))
        np.testing.assert_allclose(one, two, atol=1e-6)

    def test_wrong_length_and_nan_are_refused(self):
        with pytest.raises(BnsError, match=r"has 6 weights.*has 7"):
            GenomePolicy(self.kind(), torch.zeros(1, 6))
        with pytest.raises(BnsError, match="Genome 1 holds NaN"):
            GenomePolicy(self.kind(), torch.tensor([[0.0] * 7, [0.0] * 6 + [np.nan]]))


class TestTask:
    def test_a_lamp_that_no_robot_can_reach_is_refused(self):
        with pytest.raises(BnsError, match="off the board"):
            LampGoal.of(LightConfig(lamps=("x=1.4,y=0",)))
        assert LampGoal.of(LightConfig(lamps=("x=1.3,y=0", "x=9"))).lamp == (1.3, 0)

    def test_cost_of_standing_still_is_the_start_distance_share(self):
        path = np.tile([0.9, 0.0], (11, 1))
        assert TASK.cost(path) == pytest.approx(10 * (0.9 - 0.3) / 0.9)

    def test_on_the_goal_radius_nothing_is_charged(self):
        angle = np.linspace(0, 2, 11)
        path = 0.3 * np.stack([np.cos(angle), np.sin(angle)], 1)
        assert TASK.cost(path) == pytest.approx(0.0, abs=1e-12)

    def test_stopped_cycles_cost_as_the_start(self):
        path = np.array([[1.0, 0], [0.5, 0], [0.1, 0], [0.1, 0], [0.1, 0]])
        charged = TASK.cost(path, np.array([False, False, True, True]))
        assert charged == pytest.approx(0.2 + 0.2 + 2 * 0.7)
        stand = LampGoal(TASK.lamp, replace(TASK.config, charge_stopped="stand"))
        assert stand.cost(path) == pytest.approx(0.2 + 0.2 + 2 * 0.2)
        far = LampGoal(TASK.lamp, replace(TASK.config, charge_stopped="far"))
        lost = np.array([False, False, True, True])
        assert far.cost(path, lost) == pytest.approx(0.2 + 0.2 + 2 * 1.0)

    def circle(self, radius=0.3, turns=1.2, cycles=40):
        angle = np.linspace(0, 2 * np.pi * turns, cycles + 1)
        return radius * np.stack([np.cos(angle), np.sin(angle)], 1)

    def test_circling_solves(self):
        none = np.zeros(40, bool)
        assert TASK.solved(self.circle(), none)
        assert TASK.solved(self.circle()[::-1], none)

    def test_circling_has_a_side(self):
        both = np.stack([self.circle(radius=0.35), self.circle()[::-1]])
        off, sweep = TASK.circling(both)
        np.testing.assert_allclose(off, [0.05, 0.0], atol=1e-12)
        np.testing.assert_allclose(sweep, [2.4 * np.pi, -2.4 * np.pi])

    def test_standing_far_circles_and_being_stopped_do_not(self):
        none = np.zeros(40, bool)
        assert not TASK.solved(np.tile([0.3, 0.0], (41, 1)), none)
        assert not TASK.solved(self.circle(radius=0.46), none)
        assert not TASK.solved(self.circle(turns=0.4), none)
        assert not TASK.solved(self.circle(), np.arange(40) == 20)

    def test_starts_keep_away_from_the_lamp_and_on_the_board(self):
        away = np.hypot(*TASK.start_pool().T)
        assert away.min() >= 0.5
        assert away.max() <= np.hypot(1.27, 0.82)

    @pytest.mark.parametrize("text", ["x", "x=left", "x=1,y"])
    def test_lamps_that_cannot_be_read(self, text):
        with pytest.raises(BnsError, match="Lamp"):
            LampGoal.of(LightConfig(lamps=(text,)))

    def test_no_lamp(self):
        with pytest.raises(BnsError, match="lamps is empty"):
            LampGoal.of(LightConfig(lamps=()))


class TestSimulator:
    """The SNN's closed loop against the same loop by hand, one robot."""

    @pytest.mark.parametrize("recurrent", [False, True])
    def test_a_cycle_by_hand(self, recurrent):
        config = small_light(recurrent=recurrent, hidden=3)
        simulator, draws = Simulator.of(config), Draws(5)
        kind = simulator.controllers
        genome = draws.uniform(1, 1, kind.genes) * 4 - 2
        thetas = Thetas(
            simulator.motion.random(1, draws), simulator.sensors.random(1, draws)
        )
        state = simulator.begin(torch.full((1, 1, 1), 0.6), torch.full((1, 1, 1), -0.4))
        layers = kind.layers(genome)
        pose = np.zeros(3)
        lamp, policy = np.array([0.6, -0.4]), GenomePolicy(kind, genome[0])
        memory = policy.memory(1)
        total = 0.0
        for _ in range(5):
            bright = simulator.look(thetas, state)[0, :, 0, 0].numpy()
            speeds, memory = policy.act(counts(bright)[None], memory)
            state, seen = simulator.step(thetas, layers, state)
            np.testing.assert_allclose(seen.speeds[0, :, 0, 0], speeds[0], rtol=1e-4)
            forward, left, turn = seen.moved[0, :, 0, 0].double().numpy()
            cos, sin = np.cos(pose[2]), np.sin(pose[2])
            pose += [cos * forward - sin * left, sin * forward + cos * left, turn]
            total += abs(np.hypot(*(lamp - pose[:2])) - config.light.goal)
        here = simulated.in_body(pose[None], tuple(lamp))[0]
        np.testing.assert_allclose(state.ahead.item(), here[0], atol=1e-5)
        np.testing.assert_allclose(state.left.item(), here[1], atol=1e-5)
        assert state.error.item() == pytest.approx(total, abs=1e-5)

    def test_inside_the_boundary_robots_stand(self):
        simulator, draws = Simulator.of(small_light()), Draws(1)
        thetas = Thetas(
            simulator.motion.random(1, draws), simulator.sensors.random(1, draws)
        )
        layers = simulator.controllers.layers(
            draws.uniform(1, 1, simulator.controllers.genes)
        )
        state = simulator.begin(torch.full((1, 1, 1), 0.1), torch.zeros(1, 1, 1))
        state, seen = simulator.step(thetas, layers, state)
        assert state.ahead.item() == pytest.approx(0.1)
        assert not seen.moved.any()

    @pytest.mark.parametrize(
        ("charge", "expected"), [("stand", 0.3), ("start", 0.6), ("far", 1.0)]
    )
    def test_what_a_stopped_robots_cycle_costs(self, charge, expected):
        light = replace(small_light().light, goal=0.4, charge_stopped=charge)
        simulator, draws = Simulator.of(replace(small_light(), light=light)), Draws(1)
        thetas = Thetas(
            simulator.motion.random(1, draws), simulator.sensors.random(1, draws)
        )
        layers = simulator.controllers.layers(
            draws.uniform(1, 1, simulator.controllers.genes)
        )
        state = simulator.begin(torch.full((1, 1, 1), 0.1), torch.zeros(1, 1, 1))
        begun = torch.ones(1, 1, 1)
        state, _ = simulator.step(thetas, layers, state._replace(begun=begun))
        assert state.error.item() == pytest.approx(expected)


class TestPatterns:
    def trial(self):
        """A fake robot that was handled in cycle 3 and stopped from cycle 7 on."""
        draws = Draws(2)
        kind = Controllers(3, False, -0.12, 0.12, 0.0)
        policy = GenomePolicy(kind, draws.uniform(1, kind.genes) * 6 - 3)
        trial = FakeLightWorld().drive(policy, cycles=10, seeds=[4])[0]
        handled = np.isin(np.arange(10), [3, 7, 8, 9])
        return trial.replace(handled=handled)

    def scales(self):
        return Simulator.of(small_light()).scales

    def test_handled_cycles_teach_no_motion(self):
        trial = self.trial()
        found = simulated.motion_patterns(trial, self.scales())
        assert len(found.inputs) == 6
        assert not found.inputs[0, :2].any()
        assert not found.inputs[3, :2].any()  # cycle 4 begins at rest
        told = trial.commands.values[5] / self.scales().speed
        np.testing.assert_allclose(found.inputs[4, 2:], told)

    def test_sensors_teach_until_the_robot_is_stopped(self):
        found = simulated.sensor_patterns(self.trial(), (0.0, 0.0))
        assert len(found.inputs) == 9  # the start and eight cycles
        away = np.hypot(*found.inputs.T)
        real = np.hypot(*self.trial().command_poses_world[:9, :2].T)
        np.testing.assert_allclose(away, real)

    def test_lost_cycles_begin_after_the_one_in_which_it_was_stopped(self):
        assert np.flatnonzero(lost([self.trial()])[0]).tolist() == [8, 9]

    def test_a_mirrored_world_gives_mirrored_patterns(self):
        trial = self.trial()
        turned = trial.observed * [1, -1, -1, 1, 1]
        turned[:, 3:] = turned[:, [4, 3]]
        commands = replace(trial.commands, values=trial.commands.values[:, ::-1])
        other = trial.replace(observed=turned, commands=commands)
        for kind, mirror, extra in (
            (
                simulated.motion_patterns,
                simulated.mirrored_motion,
                self.scales(),
            ),
            (
                simulated.sensor_patterns,
                simulated.mirrored_sensors,
                (0.0, 0.0),
            ),
        ):
            expected, found = kind(other, extra), mirror(kind(trial, extra))
            np.testing.assert_allclose(found.inputs, expected.inputs, atol=1e-9)
            np.testing.assert_allclose(found.targets, expected.targets, atol=1e-9)

    def test_brightness_and_counts_are_inverse(self):
        read = np.array([0.0, 1000.0, 4095.0])
        np.testing.assert_allclose(counts(brightness(read)), read, atol=1e-9)
        assert brightness(np.array(0.0)) == 1.0


def test_the_net_turn_of_a_trial_goes_on_beyond_half_a_turn():
    from bns.tasks.light import _turned
    from bns.worlds.trial import Commands, Trial

    yaw = np.array([3.0, 4.0, 5.0, 6.0, 7.0])
    poses = np.column_stack([yaw * 0, yaw * 0, (yaw + np.pi) % (2 * np.pi) - np.pi])
    commands = Commands([[0.1, 0.1]] * 4, [1.0] * 4)
    trial = Trial(commands, np.arange(5.0), poses, np.arange(5))
    assert _turned(trial) == pytest.approx(4.0)
