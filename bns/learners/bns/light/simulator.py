"""Closed loops inside the SNNs: 100 cycles one after another, all robots at once.

What happens depends on the lamp's place in the robot's frame alone, so that is all
that is kept of a simulated pose. Arrays have the shape ``(R, S, P)``: runs, starts,
individuals; the individual is last, so that every step works on contiguous memory.

Motion SNN: previous left and right wheel speed, new left and right wheel speed ->
forward, left, turn in the body frame. Sensor SNNs: bearing and distance of the lamp ->
brightness left and right. All are scaled to about -1..1; a cycle has always the same
duration, so it is no input.

Innovations, what the SNNs did not foresee of a trial, are of two wheels and of two
sensors. A wheel's miss is that of the way it rolled: half the turn's share less (left)
or more (right) than the forward one; in scaled units the two simply add.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from bns.experiment.config import RunConfig
from bns.learners.bns.change_detection import Ground, Misses, innovation
from bns.learners.bns.config import SnnConfig, WatchConfig
from bns.learners.bns.memory import Memory, Patterns
from bns.snn.network import AXLE, Shape, forward, predict
from bns.tasks.light import lost, readings
from bns.tasks.light_controller import Controllers, brightness
from bns.worlds.trial import Trial, body_displacements

FAR = 1.0  # [m] distance of the lamp that is scaled to 1; assumed
MOTION_INPUTS, MOTION_OUTPUTS = 4, 3
SENSORS = 2


@dataclass(frozen=True)
class Scales:
    """Scales of the motion SNN.

    Attributes:
        speed: largest wheel speed [m/s].
        moved: of forward, left [m] and turn [rad].
    """

    speed: float
    moved: tuple[float, float, float]

    @classmethod
    def of(cls, controllers: Controllers, cycle: float) -> "Scales":
        """For the speeds of some controllers, held for `cycle` seconds."""
        speed = max(abs(controllers.slowest), abs(controllers.fastest))
        way = speed * cycle
        return cls(speed, (way, way, 2 * way / AXLE))


class Thetas(NamedTuple):
    """Weights of the motion SNN ``(R, D)`` and of the sensor SNNs ``(R, E)``."""

    motion: Tensor
    sensors: Tensor


class Noise(NamedTuple):
    """What is added to the SNNs' outputs in a cycle, alike for all individuals.

    Attributes:
        motion: scaled, ``(R, 3, S, 1)``.
        sensors: scaled, ``(R, 2, S, 1)``.
    """

    motion: Tensor
    sensors: Tensor


class State(NamedTuple):
    """Simulated robots at the start of a cycle.

    Attributes:
        ahead, left: of the lamp in the robot's frame [m], ``(R, S, P)``.
        before: scaled wheel speeds of the last cycle, ``(R, 2, S, P)``.
        memory: last outputs, ``(R, 2, S, P)``; kept for recurrent controllers.
        begun: distance of the lamp at the start [m], ``(R, S, P)``.
        error: sum of the distances from the goal radius so far [m].
    """

    ahead: Tensor
    left: Tensor
    before: Tensor
    memory: Tensor
    begun: Tensor
    error: Tensor


class NetOutputs(NamedTuple):
    """What a cycle was, for paths and for the record; shapes ``(R, n, S, P)``.

    Attributes:
        moved: forward, left [m], turn [rad].
        brightness: that the controllers saw at its start, left and right.
        speeds: told [m/s], left and right.
    """

    moved: Tensor
    brightness: Tensor
    speeds: Tensor


@dataclass(frozen=True)
class Simulator:
    """Motion SNN and sensor SNNs as a world for controllers.

    Attributes:
        controllers: what the controllers have in common.
        scales: of the motion SNN.
        motion: networks from four wheel speeds to a displacement.
        sensors: networks from bearing and distance of the lamp to its brightness.
        sine: whether the bearing is given as sine and cosine.
        goal: radius to stay at [m].
        safety: nearer to the lamp than this a robot is stopped [m].
        back: whether a stopped robot costs as if it were back at its start.
        beyond: or that much farther away [m].
    """

    controllers: Controllers
    scales: Scales
    motion: Shape
    sensors: Shape
    sine: bool
    goal: float
    safety: float
    back: bool
    beyond: float = 0.0

    @classmethod
    def of(cls, config: RunConfig) -> "Simulator":
        """The SNNs a configuration asks for."""
        controllers, light = Controllers.of(config), config.light
        sine = light.bearing == "sine"
        return cls(
            controllers=controllers,
            scales=Scales.of(controllers, light.cycle),
            motion=_shape(config.snn, MOTION_INPUTS, MOTION_OUTPUTS),
            sensors=_shape(config.snn, 3 if sine else 2, SENSORS),
            sine=sine,
            goal=light.goal,
            safety=light.safety,
            back=light.charge_stopped != "stand",
            beyond=light.goal if light.charge_stopped == "far" else 0.0,
        )

    def views(self, ahead: Tensor, left: Tensor) -> Tensor:
        """Inputs of the sensor SNNs for a lamp at some place, ``(..., I, N)``."""
        distance = (ahead.square() + left.square()).sqrt().clamp(min=1e-3)
        if self.sine:
            bearing = [left / distance, ahead / distance]
        else:
            bearing = [torch.atan2(left, ahead) / torch.pi]
        return torch.stack([*bearing, distance / FAR], dim=-2)

    def begin(self, ahead: Tensor, left: Tensor) -> State:
        """Robots at rest, the lamp at a place in their frames [m], ``(R, S, P)``."""
        runs, starts, count = ahead.shape
        still = torch.zeros(runs, 2, starts, count, device=ahead.device)
        begun = (ahead.square() + left.square()).sqrt()
        return State(ahead, left, still, still, begun, torch.zeros_like(ahead))

    def step(
        self,
        thetas: Thetas,
        layers: tuple[Tensor, ...],
        state: State,
        noise: Noise | None = None,
    ) -> tuple[State, NetOutputs]:
        """One cycle of all robots.

        Args:
            thetas: weights of the SNNs.
            layers: weights of the controllers, see `Controllers.layers`.
            state: before.
            noise: of this cycle; None = what the SNNs say holds.
        """
        runs, starts, count = state.ahead.shape
        bright = self.look(thetas, state, noise)
        seen = self.controllers.see(bright)
        inputs = [seen[:, 0], seen[:, 1]]
        if self.controllers.recurrent:
            inputs += [state.memory[:, 0], state.memory[:, 1]]
        outputs = self.controllers.act(layers, inputs)
        speeds = torch.stack([self.controllers.speed(o) for o in outputs], dim=1)
        told = speeds / self.scales.speed
        pair = torch.cat([state.before, told], dim=1).flatten(2)
        said = predict(self.motion, thetas.motion, pair, fused=True)
        moved = said.view(runs, MOTION_OUTPUTS, starts, count)
        if noise is not None:
            moved = moved + noise.motion
        near = (state.ahead.square() + state.left.square()).sqrt() < self.safety
        forward, left, turn = (
            torch.where(near, 0.0, moved[:, axis] * self.scales.moved[axis])
            for axis in range(MOTION_OUTPUTS)
        )
        cos, sin = turn.cos(), turn.sin()
        x, y = state.ahead - forward, state.left - left
        ahead, left_of = cos * x + sin * y, cos * y - sin * x
        distance = (x.square() + y.square()).sqrt()
        if self.back:
            distance = torch.where(near, state.begun + self.beyond, distance)
        error = state.error + (distance - self.goal).abs()
        memory = torch.stack(outputs, dim=1)
        after = State(ahead, left_of, told, memory, state.begun, error)
        return after, NetOutputs(
            torch.stack([forward, left, turn], dim=1), bright, speeds
        )

    def look(self, thetas: Thetas, state: State, noise: Noise | None = None) -> Tensor:
        """Brightness that the robots see now, ``(R, 2, S, P)``.

        Args:
            thetas: weights of the SNNs.
            state: robots at the start of a cycle.
            noise: added to the brightness; None = none.

        Returns:
            0 to 1, left and right.
        """
        runs, starts, count = state.ahead.shape
        views = self.views(state.ahead.flatten(1), state.left.flatten(1))
        said = predict(self.sensors, thetas.sensors, views, fused=True)
        bright = said.view(runs, SENSORS, starts, count)
        if noise is not None:
            bright = bright + noise.sensors
        return bright.clamp(0.0, 1.0)

    def disagreement(self, thetas: Thetas, state: State, after: State) -> Tensor:
        """How far ensembles disagree on a cycle, ``(R, S, P)``.

        Variance over the members, summed over the scaled outputs of all SNNs; needs
        SNNs of kind "ensemble".

        Args:
            thetas: weights of the SNNs.
            state, after: before and after the cycle.
        """
        runs, starts, count = state.ahead.shape
        told = torch.cat([state.before, after.before], dim=1).flatten(2)
        views = self.views(state.ahead.flatten(1), state.left.flatten(1))
        parts = (
            forward(shape, theta, inputs).var(1, unbiased=False).sum(1)
            for shape, theta, inputs in (
                (self.motion, thetas.motion, told),
                (self.sensors, thetas.sensors, views),
            )
        )
        motion, sensors = parts
        return (motion + sensors).view(runs, starts, count)

    def advance(
        self,
        thetas: Thetas,
        layers: tuple[Tensor, ...],
        state: State,
        noise: Noise | None = None,
    ) -> State:
        """`step` without what was seen: the form to compile.

        Args:
            thetas: weights of the SNNs.
            layers: weights of the controllers, see `Controllers.layers`.
            state: before the cycle.
            noise: added to the SNNs' outputs; None = none.
        """
        return self.step(thetas, layers, state, noise)[0]


def _shape(config: SnnConfig, inputs: int, outputs: int) -> Shape:
    """A network an output, or an ensemble with all outputs (`SnnConfig.kind`)."""
    if config.kind == "three":
        return Shape(outputs, config.hidden, 1, inputs)
    return Shape(config.members, config.hidden, outputs, inputs)


def motion_patterns(trial: Trial, scales: Scales) -> Patterns:
    """What each cycle was and did, scaled: ``(N, 4)`` and ``(N, 3)``.

    Cycles in which the robot was stopped or turned are left out, and so are those
    with a lost pose; a robot that was turned goes on from rest.
    """
    speeds = trial.commands.values[:, :2] / scales.speed
    rested = np.append(True, trial.handled[:-1])
    before = np.vstack([np.zeros((1, 2)), speeds[:-1]])
    before[rested] = 0.0
    moved = body_displacements(trial.command_poses_world) / np.asarray(scales.moved)
    good = np.isfinite(moved).all(1) & ~trial.handled & trial.outcome.usable
    return Patterns(np.hstack([before, speeds])[good], moved[good])


def sensor_patterns(trial: Trial, lamp: tuple[float, float]) -> Patterns:
    """What was read where: the lamp in the robot's frame [m] and its brightness.

    Returns:
        ``(N, 2)`` ahead and left, ``(N, 2)`` left and right sensor; without those of
        a robot that was stopped for good.
    """
    poses = trial.command_poses_world
    read = readings(trial)
    good = np.isfinite(poses).all(1) & np.isfinite(read).all(1)
    good[1:] &= ~lost([trial])[0]
    good &= trial.outcome.usable
    return Patterns(in_body(poses, lamp)[good], brightness(read)[good])


def in_body(poses: np.ndarray, lamp: tuple[float, float]) -> np.ndarray:
    """Where the lamp is in the frames of robots, ``(..., 2)`` ahead and left [m]."""
    east, north = np.moveaxis(np.asarray(lamp) - poses[..., :2], -1, 0)
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return np.stack([cos * east + sin * north, cos * north - sin * east], axis=-1)


def mirrored_motion(patterns: Patterns) -> Patterns:
    """The same with left and right exchanged (data augmentation)."""
    return Patterns(
        patterns.inputs[:, [1, 0, 3, 2]],
        patterns.targets * np.array([1.0, -1.0, -1.0]),
    )


def mirrored_sensors(patterns: Patterns) -> Patterns:
    """The same with left and right exchanged (data augmentation)."""
    return Patterns(
        patterns.inputs * np.array([1.0, -1.0]), patterns.targets[:, [1, 0]]
    )


CHANNELS = ("left wheel", "right wheel", "left sensor", "right sensor")


def innovations(
    motion: Memory,
    moved: Patterns,
    sensors: Memory,
    light: Patterns,
    run: int,
    config: WatchConfig,
) -> np.ndarray:
    """Innovation of each of `CHANNELS` in one trial of a run, ``(4,)``.

    Args:
        motion, sensors: before they are trained on the trial.
        moved, light: the trial's patterns.
        run: which.
        config: thresholds.
    """
    turned = motion.spread[run].cpu().numpy()
    variance = motion.variance(run, moved)
    wheels = Misses(
        _ways(motion.error(run, moved)),
        (variance[:, 0] + variance[:, 2])[:, None].repeat(2, axis=1),
        _ways(motion.error(run, motion.patterns(run))),
        np.full(2, np.hypot(turned[0], turned[2])),
    )
    eyes = Misses(
        sensors.error(run, light),
        sensors.variance(run, light),
        sensors.error(run, sensors.patterns(run)),
        sensors.spread[run].cpu().numpy(),
    )
    rolled = Ground.of(moved.inputs, motion.buffer.inputs[run], config)
    seen = Ground.of(_places(light.inputs), _places(sensors.buffer.inputs[run]), config)
    return np.concatenate(
        [innovation(wheels, rolled, config), innovation(eyes, seen, config)]
    )


def _ways(miss: np.ndarray) -> np.ndarray:
    """Misses of the left and the right wheel's way."""
    return np.stack([miss[:, 0] - miss[:, 2], miss[:, 0] + miss[:, 2]], axis=1)


def _places(views: np.ndarray) -> np.ndarray:
    """Inputs of the sensor SNNs with the logarithm of the lamp's distance.

    Light falls off with the square of the distance: a step towards the lamp changes a
    reading by the share of the way that is left.
    """
    return np.column_stack([views[:, :-1], np.log(views[:, -1])])
