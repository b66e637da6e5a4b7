"""Short drives of a wheeled robot, where each takes it, and their composition.

A behaviour is one command from rest to rest, in the robot's own frame: forward [m],
left [m], turn [rad]. A route is planned objective by objective, behaviour by
behaviour, each by a tree search from where the ones before it are expected to end.

The tree search is for many actions and uncertain outcomes: UCT (Kocsis and Szepesvari
2006) with simple progressive widening of actions and double progressive widening of
outcomes (Couetoux et al. 2011). After n visits a state has had n ** `actions` actions
tried, and an action n ** `outcomes` outcomes drawn.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from bns.prior.archive import Archive
from bns.tasks.base import BOARD
from bns.worlds.trial import Trial, body_displacements


class Problem(Protocol):
    """What is searched: states and actions are whatever it takes them for."""

    def proposed(self, state: Any, rng: np.random.Generator) -> Any:
        """An action that may be worth trying; actions are compared by ``==``."""
        ...

    def outcome(
        self, state: Any, action: Any, rng: np.random.Generator
    ) -> tuple[Any, float, bool]:
        """One drawn outcome.

        Args:
            state: before the action.
            action: as `proposed` gives them.
            rng: the only source of randomness.

        Returns:
            the next state, the reward, whether it ends there.
        """
        ...

    def rollout(self, state: Any, rng: np.random.Generator) -> float:
        """What a state may be worth, by playing on from it once."""
        ...


@dataclass(frozen=True, kw_only=True)
class Rule:
    """How a tree is searched.

    Attributes:
        iterations: ways from the root down.
        bonus: weight of what is little known, c of UCT, in units of the reward.
        actions, outcomes: exponents of the widening.
        discount: of a reward, for each action before it.
    """

    iterations: int = 1000
    bonus: float = 50.0
    actions: float = 0.5
    outcomes: float = 0.6
    discount: float = 0.9


@dataclass(eq=False)
class _Node:
    """A state, or an end."""

    state: Any
    reward: float = 0.0
    over: bool = False
    visits: int = 0
    choices: "list[_Choice]" = field(default_factory=list)


@dataclass(eq=False)
class _Choice:
    """An action in a state, and what came of it so far."""

    action: Any
    visits: int = 0
    total: float = 0.0
    drawn: list[_Node] = field(default_factory=list)

    @property
    def mean(self) -> float:
        return self.total / self.visits


def best(
    problem: Problem, state: Any, rule: Rule, rng: np.random.Generator
) -> tuple[Any, float]:
    """The action of the highest mean value that a search found.

    Args:
        problem: what is searched.
        state: at the root.
        rule: how.
        rng: the only source of randomness.

    Returns:
        action and its mean discounted reward.
    """
    root = _Node(state)
    for _ in range(max(rule.iterations, 1)):
        _descend(problem, root, rule, rng)
    found = max(root.choices, key=lambda choice: choice.mean)
    return found.action, found.mean


def _descend(
    problem: Problem, root: _Node, rule: Rule, rng: np.random.Generator
) -> None:
    """One way down to a state that is new, and its worth back up."""
    way: list[tuple[_Node, _Choice, _Node]] = []
    node, fresh = root, False
    while not (fresh or node.over):
        choice = _chosen(problem, node, rule, rng)
        after, fresh = _drawn(problem, node, choice, rule, rng)
        way.append((node, choice, after))
        node = after
    value = 0.0 if node.over else problem.rollout(node.state, rng)
    for before, choice, after in reversed(way):
        value = after.reward + rule.discount * value
        before.visits += 1
        choice.visits += 1
        choice.total += value


def _chosen(
    problem: Problem, node: _Node, rule: Rule, rng: np.random.Generator
) -> _Choice:
    """A new action where there is room for one, else the one of the highest bound."""
    if not node.choices or node.visits**rule.actions >= len(node.choices):
        action = problem.proposed(node.state, rng)
        if all(choice.action != action for choice in node.choices):
            node.choices.append(_Choice(action))
            return node.choices[-1]
    known = math.log(max(node.visits, 1))
    return max(
        node.choices,
        key=lambda choice: choice.mean + rule.bonus * math.sqrt(known / choice.visits),
    )


def _drawn(
    problem: Problem, node: _Node, choice: _Choice, rule: Rule, rng: np.random.Generator
) -> tuple[_Node, bool]:
    """An outcome of an action, and whether it is a new one."""
    if not choice.drawn or choice.visits**rule.outcomes >= len(choice.drawn):
        choice.drawn.append(_Node(*problem.outcome(node.state, choice.action, rng)))
        return choice.drawn[-1], True
    return choice.drawn[int(rng.integers(len(choice.drawn)))], False


REACHED, OUTSIDE = 100.0, -1000.0
"""rewards, as in Chatzilygeroudis et al. 2018"""
CANDIDATES = 100
"""behaviours drawn where the one that ends nearest is wanted, as there"""
HORIZON = 4
"""behaviours that a way is played on for"""

Pose = tuple[float, float, float]


def displacements(trials: Sequence[Trial], each: int) -> tuple[np.ndarray, np.ndarray]:
    """What each behaviour of some trials did.

    Args:
        trials: N, whose lists have `each` commands a behaviour.
        each: commands of a behaviour.

    Returns:
        forward, left, turn ``(B, 3)``, of all behaviours one after another, and which
        of them were seen and left alone, ``(B,)`` bool.
    """
    moved, good = [], []
    for trial in trials:
        found = body_displacements(trial.command_poses_world[::each])
        alone = ~trial.handled.reshape(-1, each).any(1)
        moved.append(found)
        good.append(np.isfinite(found).all(1) & alone & trial.outcome.usable)
    return np.concatenate(moved), np.concatenate(good)


def targets(moved: np.ndarray) -> np.ndarray:
    """Displacements ``(B, 3)`` as what is learned: x, y, cosine, sine, ``(B, 4)``."""
    x, y, turn = moved.T
    return np.stack([x, y, np.cos(turn), np.sin(turn)], axis=1)


def selected(genes: np.ndarray, moved: np.ndarray, bins: int) -> np.ndarray:
    """Rows of the quickest behaviour for each place and heading at the end, ``(N,)``.

    Args:
        genes: (left speed, right speed, duration) ``(B, 3)`` [m/s, m/s, s].
        moved: ``(B, 3)``.
        bins: of the grid along each of forward, left and turn.
    """
    grid = Archive(1, 3, bins)
    rows = np.arange(len(genes), dtype=float)[:, None]
    grid.add(rows, scaled(moved, moved), -genes[:, 2])
    return np.sort(grid.genes[:, 0].astype(np.int64))


def scaled(values: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Columns as shares of the range that those of `of` have; shape like `values`."""
    low, high = of.min(axis=0), of.max(axis=0)
    found: np.ndarray = (values - low) / np.maximum(high - low, 1e-9)
    return found


def moved_by(pose: Pose, x: float, y: float, turn: float) -> Pose:
    """A pose in the world after a displacement in the frame of the robot there.

    Args:
        pose: before it.
        x: forward [m].
        y: left [m].
        turn: counter-clockwise [rad].
    """
    east, north, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return east + cos * x - sin * y, north + sin * x + cos * y, yaw + turn


@dataclass(frozen=True, eq=False)
class Leg:
    """The way to one objective, a `Problem`: states are poses, actions rows.

    Attributes:
        means: expected x, y, cosine, sine of each behaviour, ``(N, 4)``.
        spread: standard deviation of each of these, ``(N,)``.
        goal: the objective [m].
        within: distance at which it counts as reached [m].
        discount: as in `Rule`.
    """

    means: np.ndarray
    spread: np.ndarray
    goal: tuple[float, float]
    within: float
    discount: float

    def proposed(self, state: Pose, rng: np.random.Generator) -> int:
        """Of some behaviours the one expected to end nearest to the objective."""
        rows = rng.integers(len(self.means), size=CANDIDATES)
        x, y, yaw = state
        cos, sin = math.cos(yaw), math.sin(yaw)
        east, north = self.goal[0] - x, self.goal[1] - y
        ahead, aside = cos * east + sin * north, cos * north - sin * east
        away = (self.means[rows, 0] - ahead) ** 2 + (self.means[rows, 1] - aside) ** 2
        return int(rows[away.argmin()])

    def expected(self, state: Pose, action: int) -> Pose:
        """Where a behaviour is expected to end."""
        x, y, cos, sin = self.means[action].tolist()
        return moved_by(state, x, y, math.atan2(sin, cos))

    def reached(self, state: Pose) -> bool:
        """Whether a pose counts as at the objective."""
        return math.dist(state[:2], self.goal) < self.within

    def outcome(
        self, state: Pose, action: int, rng: np.random.Generator
    ) -> tuple[Pose, float, bool]:
        """See `Problem`: as likely as the process takes it to be."""
        drawn = self.means[action] + self.spread[action] * rng.standard_normal(4)
        x, y, cos, sin = drawn.tolist()
        after = moved_by(state, x, y, math.atan2(sin, cos))
        if abs(after[0]) > BOARD[0] or abs(after[1]) > BOARD[1]:
            return after, OUTSIDE, True
        if self.reached(after):
            return after, REACHED, True
        return after, 0.0, False

    def rollout(self, state: Pose, rng: np.random.Generator) -> float:
        """See `Problem`: straight for the objective, a few behaviours long."""
        weight = 1.0
        for _ in range(HORIZON):
            state, reward, over = self.outcome(state, self.proposed(state, rng), rng)
            if over:
                return weight * reward
            weight *= self.discount
        return 0.0


def plan(
    legs: Sequence[Leg],
    start: Pose,
    most: int,
    rule: Rule,
    rng: np.random.Generator,
) -> tuple[list[int], list[Pose]]:
    """Behaviours that are expected to reach objectives in their order.

    Args:
        legs: to each objective.
        start: pose in the world.
        most: behaviours.
        rule: of each search.
        rng: the only source of randomness.

    Returns:
        rows of the behaviours, and the poses expected at the start and after each.
    """
    rows: list[int] = []
    poses = [start]
    for leg in legs:
        while len(rows) < most:
            action, _ = best(leg, poses[-1], rule, rng)
            rows.append(action)
            poses.append(leg.expected(poses[-1], action))
            if leg.reached(poses[-1]):
                break
    return rows, poses
