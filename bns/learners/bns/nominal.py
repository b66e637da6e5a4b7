"""What a legged robot's commands would do if its feet alone decided: a model to begin
with, without physics.

Between two poses of the legs the body moves so that the feet that bear it stay where
they are. Which bear it is statics: of all triples of feet and corners of the belly
whose triangle holds the middle of the body, the one that is lowest there, and each
bears its share of the weight. Where what bears moves against each other, all slip, and
the body moves as friction asks: so that the ways that they slip, each times its load,
are least. A lost leg bears nothing, and a body that its feet do not hold lies on its
belly.

A network is trained on this model once for each set of lost legs, since generations ask
for it often.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import combinations

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import pad

from bns.draws import Draws, whole_below
from bns.evolution.goals import reaches
from bns.experiment import robots
from bns.experiment.config import RunConfig
from bns.snn.network import Shape, forward
from bns.snn.training import AdamState, Patterns, adam, gradient

GIVEN = 55.0  # patterns: five trials
PIECES = 8  # of a command
SOFT = 0.004  # [m] triples that are so much higher bear a third as much
LYING = 0.01  # [m] that a belly counts as higher, or where two feet hold the middle its
# corners would make further ways to stand
SLIPS = 3  # turns of reweighting: the sum of slips for that of their squares
LEAST = 0.001  # [m] of slip, so that weights stay finite
SAMPLES, STEPS, BATCH, RATE, HIDDEN = 20_000, 3_000, 256, 0.002, 300
FEET = 6
Contacts = Callable[[np.ndarray], np.ndarray]
Lost = frozenset[int]  # legs, by their place in `bns.models.legs.LEGS`
NONE: Lost = frozenset()


def moved(
    before: np.ndarray,
    after: np.ndarray,
    contacts: Contacts,
    accounts: Sequence[Lost] = (NONE,),
) -> np.ndarray:
    """Motion of the body by commands, in its frame.

    Args:
        before: goals in force, ``(N, 18)`` [rad].
        after: the next ones.
        contacts: where feet and the belly's corners are for goals ``(N, 18)``:
            ``(N, C, 3)`` [m], see `robots.contacts`.
        accounts: A sets of legs that bear nothing.

    Returns:
        ``(A, N, 3)`` [m, m, rad].
    """
    change = after - before
    longest = np.abs(change).max(-1, keepdims=True)
    x, y, yaw = np.zeros((3, len(accounts), len(before)))
    here = contacts(before)
    for piece in range(1, PIECES + 1):
        way = np.minimum(np.abs(change), longest * piece / PIECES)
        there = contacts(before + np.sign(change) * way)
        middle, moves = (here + there) / 2, (there - here)[..., :2]
        ahead, left, turn = _rigid(middle[..., :2], moves, loads(middle, accounts))
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        yaw, here = yaw + turn, there
    return np.stack([x, y, yaw], axis=-1)


def loads(contacts: np.ndarray, accounts: Sequence[Lost] = (NONE,)) -> np.ndarray:
    """Share of the weight on each contact, ``(A, N, C)``.

    Args:
        contacts: their places, feet first, ``(N, C, 3)`` [m]; three of those that bear
            hold the middle, as the corners of the belly do.
        accounts: A sets of legs that bear nothing.
    """
    triples = np.array(list(combinations(range(contacts.shape[1]), 3)))
    places = contacts[:, triples]
    a, b, c = np.moveaxis(places[..., :2], 2, 0)
    share = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
    total = share.sum(-1, keepdims=True)
    share = share / np.where(np.abs(total) < 1e-6, 1e-6, total)
    height = (share * places[..., 2]).sum(-1) + LYING * (triples >= FEET).any(1)
    gone = np.zeros((len(accounts), contacts.shape[1]), bool)
    for account, lost in zip(gone, accounts, strict=True):
        account[list(lost)] = True
    bears = ~gone[:, None, triples].max(-1)
    height = np.where(bears & (share.min(-1) > -0.02), height, np.inf)
    likely = np.exp(-(height - height.min(-1, keepdims=True)) / SOFT)
    likely = likely / likely.sum(-1, keepdims=True)
    found = np.zeros((len(accounts), *contacts.shape[:2]))
    for column, triple in enumerate(triples):
        found[..., triple] += likely[..., [column]] * share[:, column].clip(0, 1)
    return found


def _rigid(
    places: np.ndarray, moves: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forward, left and turn of a body whose contacts slip least, each ``(A, N)``."""
    weight = load
    for _ in range(SLIPS + 1):
        total = weight.sum(-1)[..., None] + 1e-9
        centre, mean = (
            (weight[..., None] * part).sum(-2) / total for part in (places, moves)
        )
        around, own = places - centre[..., None, :], moves - mean[..., None, :]
        inertia = (weight * (around**2).sum(-1)).sum(-1) + 1e-6
        turn = -(weight * _cross(around, own)).sum(-1) / inertia
        ahead = -mean[..., 0] + turn * centre[..., 1]
        left = -mean[..., 1] - turn * centre[..., 0]
        slip = np.hypot(
            moves[..., 0] + ahead[..., None] - turn[..., None] * places[..., 1],
            moves[..., 1] + left[..., None] + turn[..., None] * places[..., 0],
        )
        weight = load / (slip + LEAST)
    return ahead, left, turn


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def drawn(
    rng: np.random.Generator, count: int, reach: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of goals as walks have them: near, far and at the bounds; some stay.

    Args:
        rng: the only source of randomness.
        count: N.
        reach: farthest that goals are from half-way, of all or of each ``(18,)`` [rad].

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
        lost: legs that bear nothing, of each run.
        theta: weights of `network`, ``(R, D)``.
        moving: 1 for inputs, goals in force and next ones, of legs that are not lost, 0
            for the others, ``(R, 36, 1)``: what those are told moves nothing.
        trust: what the model's forward, left and turn are multiplied by, ``(R, 3, 1)``.

    Raises:
        BnsError: a robot whose legs are not known.
    """

    def __init__(self, config: RunConfig, runs: int):
        self.robot = config.world.robot
        channels = robots.told(self.robot).channels
        self.reach = tuple(reaches(config.walk, channels).tolist())
        self.device = torch.device(config.device)
        self.lost = [NONE] * runs
        self.theta = self._network(NONE).repeat(runs, 1)
        self.trust = torch.ones(runs, 3, 1, device=self.device)
        self.moving = torch.ones(runs, SHAPE.inputs, 1, device=self.device)

    def _network(self, lost: Lost) -> Tensor:
        return network(self.robot, self.reach, lost).to(self.device)

    def without(self, run: int, lost: Lost) -> None:
        """Legs of a run bear nothing from now on."""
        if lost == self.lost[run]:
            return
        self.lost[run] = lost
        self.theta[run] = self._network(lost)[0]
        moving = torch.ones_like(self.moving[run]).view(2, FEET, -1)
        moving[:, list(lost)] = 0.0
        self.moving[run] = moving.view(-1, 1)

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

    def anchored(
        self, patterns: Patterns, share: float, rng: np.random.Generator
    ) -> Patterns:
        """Patterns of what the model leaves, with some in which it leaves nothing.

        Args:
            patterns: of all runs, padded behind.
            share: of each run's own number that are added.
            rng: of their goals.
        """
        from bns.learners.bns.walking import GOAL

        counts = patterns.weight.sum((1, 2, 3)).long().tolist()
        more = [int(share * count) for count in counts]
        longest = max(both[0] + both[1] for both in zip(counts, more, strict=True))
        room = max(longest - patterns.inputs.shape[2], 0)
        inputs, targets, weight = (pad(part, (0, room)).clone() for part in patterns)
        for run, (count, added) in enumerate(zip(counts, more, strict=True)):
            goals = np.concatenate(drawn(rng, added, np.array(self.reach)), axis=1)
            new = slice(count, count + added)
            seen = _tensor(goals / GOAL)[0].to(inputs.device)
            inputs[run, :, new] = seen * self.moving[run]
            targets[run, :, new], weight[run, ..., new] = 0.0, 1.0
        return Patterns(inputs, targets, weight)

    def state(self) -> dict[str, np.ndarray]:
        """How far each run trusts the model, and which legs it takes for lost."""
        lost = np.zeros((len(self.lost), FEET), bool)
        for run, legs in enumerate(self.lost):
            lost[run, list(legs)] = True
        return {"nominal.trust": self.trust.cpu().numpy(), "nominal.lost": lost}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`."""
        trust = torch.from_numpy(arrays["nominal.trust"].copy())
        self.trust = trust.to(self.device)
        for run, legs in enumerate(arrays["nominal.lost"]):
            self.without(run, frozenset(np.flatnonzero(legs).tolist()))


@cache
def network(robot: str, reach: float | tuple[float, ...], lost: Lost = NONE) -> Tensor:
    """Weights of a network of `SHAPE` that says what `moved` says, ``(1, D)``.

    The same each time, so no run has to keep them.

    Args:
        robot: its name.
        reach: farthest that goals are from half-way, of all or of each of 18 [rad].
        lost: legs that bear nothing; their goals are 0 in its inputs.

    Raises:
        BnsError: a robot whose legs are not known.
    """
    from bns.learners.bns.walking import GOAL, MOVED

    rng, draws = np.random.default_rng(0), Draws(0)
    before, after = drawn(rng, SAMPLES, np.array(reach))
    for goals in (before, after):
        goals.reshape(SAMPLES, FEET, -1)[:, list(lost)] = 0.0
    inputs = _tensor(np.concatenate([before, after], axis=1) / GOAL)
    told = moved(before, after, robots.contacts(robot), (lost,))[0]
    targets = _tensor(told / np.array(MOVED))
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
    """What such networks ``(R, D)`` say of inputs ``(R, 36, N)``: ``(R, 3, N)``."""
    pairs = zip(theta.split(1), seen.split(1), strict=True)
    return torch.cat([forward(SHAPE, own, part)[:, 0] for own, part in pairs])
