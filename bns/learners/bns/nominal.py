"""What a legged robot's commands would do if its feet alone decided: a model to begin
with, without physics.

Between two poses of the legs the body moves so that the feet that bear it stay where
they are. Which bear it is statics: of all triples of feet whose triangle holds the
middle of the body, the one that is lowest there, and each foot bears its share of the
weight. Where feet that bear move against each other, all slip, and the body moves as
friction asks: so that the ways that feet slip, each times its load, are least.

A network is trained on this model once, since generations ask for it often.
"""

from collections.abc import Callable
from functools import cache
from itertools import combinations

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.experiment import robots
from bns.experiment.config import RunConfig
from bns.snn.network import Shape, forward
from bns.snn.training import AdamState, Patterns, adam, gradient

GIVEN = 55.0  # patterns: five trials
PIECES = 8  # of a command
SOFT = 0.004  # [m] triples that are so much higher bear a third as much
SLIPS = 3  # turns of reweighting: the sum of slips for that of their squares
LEAST = 0.001  # [m] of slip, so that weights stay finite
SAMPLES, STEPS, BATCH, RATE, HIDDEN = 20_000, 3_000, 256, 0.002, 300
Feet = Callable[[np.ndarray], np.ndarray]
TRIPLES = np.array(list(combinations(range(6), 3)))


def moved(before: np.ndarray, after: np.ndarray, feet: Feet) -> np.ndarray:
    """Motion of the body by commands, ``(N, 3)`` [m, m, rad] in its frame.

    Args:
        before: goals in force, ``(N, 18)`` [rad].
        after: the next ones.
        feet: where feet are for goals ``(N, 18)``: ``(N, 6, 3)`` [m].
    """
    change = after - before
    longest = np.abs(change).max(-1, keepdims=True)
    x, y, yaw = np.zeros((3, len(before)))
    here = feet(before)
    for piece in range(1, PIECES + 1):
        way = np.minimum(np.abs(change), longest * piece / PIECES)
        there = feet(before + np.sign(change) * way)
        middle = (here + there) / 2
        change_of_feet = (there - here)[..., :2]
        ahead, left, turn = _rigid(middle[..., :2], change_of_feet, loads(middle))
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        yaw, here = yaw + turn, there
    return np.stack([x, y, yaw], axis=-1)


def loads(feet: np.ndarray) -> np.ndarray:
    """Share of the weight on each foot, ``(N, 6)``, from their places ``(N, 6, 3)``."""
    places = feet[:, TRIPLES]
    a, b, c = np.moveaxis(places[..., :2], 2, 0)
    share = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
    total = share.sum(-1, keepdims=True)
    share = share / np.where(np.abs(total) < 1e-6, 1e-6, total)
    height = (share * places[..., 2]).sum(-1)
    # where none holds the middle, the one that does so best
    height = np.where(share.min(-1) > -0.02, height, 10.0 - share.min(-1))
    likely = np.exp(-(height - height.min(1, keepdims=True)) / SOFT)
    borne = (likely / likely.sum(1, keepdims=True))[..., None] * share.clip(0, 1)
    found = np.zeros(feet.shape[:2])
    for column, triple in enumerate(TRIPLES):
        found[:, triple] += borne[:, column]
    return found


def _rigid(
    feet: np.ndarray, change: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forward, left and turn of a body whose feet slip least, each ``(N,)``."""
    weight = load
    for _ in range(SLIPS + 1):
        total = weight.sum(-1)[:, None] + 1e-9
        centre, mean = (
            (weight[..., None] * part).sum(1) / total for part in (feet, change)
        )
        around, own = feet - centre[:, None], change - mean[:, None]
        inertia = (weight * (around**2).sum(-1)).sum(1) + 1e-6
        turn = -(weight * _cross(around, own)).sum(1) / inertia
        ahead = -mean[:, 0] + turn * centre[:, 1]
        left = -mean[:, 1] - turn * centre[:, 0]
        slip = np.hypot(
            change[..., 0] + ahead[:, None] - turn[:, None] * feet[..., 1],
            change[..., 1] + left[:, None] + turn[:, None] * feet[..., 0],
        )
        weight = load / (slip + LEAST)
    return ahead, left, turn


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def drawn(
    rng: np.random.Generator, count: int, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of goals as walks have them: near, far and at the bounds; some stay.

    Args:
        rng: the only source of randomness.
        count: N.
        reach: farthest that goals are from half-way [rad].

    Returns:
        goals in force and the next ones, each ``(N, 18)`` [rad].
    """

    def pose() -> np.ndarray:
        goals = rng.uniform(-1, 1, (count, 18))
        share = rng.choice([0.0, 0.3, 0.6], (count, 1))
        ends = np.where(rng.random(goals.shape) < share, np.sign(goals), goals)
        return ends * rng.uniform(0.2, 1, (count, 1)) * reach

    before, after = pose(), pose()
    before[rng.random(count) < 0.1] = 0.0
    stay = rng.random(before.shape) < rng.choice([0.0, 0.3, 0.6], (count, 1))
    return before, np.where(stay, before, after)


SHAPE = Shape(groups=1, hidden=HIDDEN, outputs=3, inputs=36, activation="relu")


class Nominal:
    """The model as R runs use it, each as far as its patterns bear it out.

    Args:
        config: of the runs.
        runs: R.

    Attributes:
        theta: weights of `network`.
        trust: what the model's forward, left and turn are multiplied by, ``(R, 3, 1)``.

    Raises:
        BnsError: a robot whose legs are not known.
    """

    def __init__(self, config: RunConfig, runs: int):
        made = network(config.world.robot, config.walk.reach)
        self.theta = made.to(config.device)
        self.trust = torch.ones(runs, 3, 1, device=config.device)

    def weigh(self, patterns: Patterns) -> Tensor:
        """Trust the model by its least squares share in patterns, from 0 to 1.

        `GIVEN` further patterns, in which it is right, keep few from speaking too loud.

        Returns:
            what it says of them then, ``(R, 3, N)``.
        """
        told = said(self.theta, patterns.inputs)
        weighed = told * patterns.weight[:, 0]
        count = patterns.weight.sum((2, 3))[..., None].clamp(min=1.0)
        square = (weighed * told).sum(2, keepdim=True)
        right = GIVEN * square / count
        share = (weighed * patterns.targets).sum(2, keepdim=True) + right
        share = (share / (square + right)).clamp(0, 1)
        self.trust = torch.where(square > 0, share, 1.0)
        return self.trust * told


@cache
def network(robot: str, reach: float) -> Tensor:
    """Weights of a network of `SHAPE` that says what `moved` says, ``(1, D)``.

    The same each time, so no run has to keep them.

    Args:
        robot: its name.
        reach: farthest that goals are from half-way [rad].

    Raises:
        BnsError: a robot whose legs are not known.
    """
    from bns.learners.bns.walking import GOAL, MOVED

    rng, draws = np.random.default_rng(0), Draws(0)
    before, after = drawn(rng, SAMPLES, reach)
    inputs = _tensor(np.concatenate([before, after], axis=1) / GOAL)
    targets = _tensor(moved(before, after, robots.feet(robot)) / np.array(MOVED))
    theta = SHAPE.random(1, draws)
    state, every = AdamState.fresh(theta), torch.ones(1, 1, 1, BATCH)
    for number in range(STEPS):
        index = whole_below(draws.uniform(BATCH), SAMPLES)
        shown, wanted = inputs[..., index], targets[:, None, :, index]
        grad = gradient(SHAPE, theta, shown, wanted, every) / BATCH
        rate = RATE * (1 + np.cos(np.pi * number / STEPS)) / 2
        step = torch.tensor(number + 1.0)
        theta, state = adam(theta, grad, state, torch.tensor(rate), step)
    return theta


def _tensor(rows: np.ndarray) -> Tensor:
    return torch.from_numpy(rows.T.astype(np.float32))[None]


def said(theta: Tensor, seen: Tensor) -> Tensor:
    """What such a network says of inputs ``(R, 36, N)``: ``(R, 3, N)``."""
    return torch.cat([forward(SHAPE, theta, part[None])[:, 0] for part in seen])
