"""Tree search where actions are many and outcomes uncertain: UCT with widening.

UCT (Kocsis and Szepesvari 2006) with simple progressive widening of actions and double
progressive widening of outcomes (Couetoux et al. 2011): after n visits a state has had
n ** `actions` actions tried, and an action n ** `outcomes` outcomes drawn.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np


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
