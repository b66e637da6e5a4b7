"""Evolution and training of navigation, written for JAX: what `learner-peers` times.

A run, a child and a command list at a time, mapped by `jax.vmap`; `bench.speed.peers`
holds that the same random numbers give the same as ours.
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from bns.snn.training import FIRST_STEP, GROW, SHRINK, STEP_MAX, STEP_MIN
from bns.tasks.navigation import CENTIMETRES

if TYPE_CHECKING:
    from bench.speed.peers import Own


class Peer:
    """Navigation's evolution and training, compiled by JAX when first called.

    Args:
        jax: the package.
    """

    def __init__(self, jax: Any):
        self.jax, self.np = jax, jax.numpy
        self.key = jax.random.PRNGKey(0)
        self._made: dict[str, Any] = {}

    def arrays(self, population: Any, cost: torch.Tensor) -> tuple[Any, Any]:
        """A population of ours, and its costs, as JAX arrays."""
        lists = tuple(self.np.asarray(part.numpy()) for part in population)
        return lists, self.np.asarray(cost.numpy())

    def generation(self, own: "Own", lists: Any, cost: Any, coins: Any) -> Any:
        """One generation with the given random numbers."""
        made = self._once("generation", lambda: _runs(self.jax, own, _generation))
        given = {
            name: self.np.asarray(value.numpy())
            for name, value in coins._asdict().items()
            if value is not None
        }
        return made(self.np.asarray(own.memory.theta.numpy()), lists, cost, given)

    def evolve(self, own: "Own") -> object:
        """The generations of a trial, random numbers drawn within."""
        made = self._once("evolution", lambda: _runs(self.jax, own, _evolution))
        start = self._once("start", lambda: self._began(own))
        self.key, key = self.jax.random.split(self.key)
        keys = self.jax.random.split(key, len(own.cost))
        return self.jax.block_until_ready(made(*start, keys))

    def train(self, own: "Own") -> object:
        """The epochs of a trial."""
        return self.trained(own, own.config.snn.epochs)

    def trained(self, own: "Own", epochs: int) -> Any:
        """Weights after some epochs."""
        make = partial(_training, epochs=epochs)
        made = self._once(f"training {epochs}", lambda: _runs(self.jax, own, make))
        given = (own.memory.theta.numpy(), own.inputs, own.targets)
        put = (self.np.asarray(each, dtype=self.np.float32) for each in given)
        return self.jax.block_until_ready(made(*put))

    def _began(self, own: "Own") -> tuple[Any, ...]:
        """Weights, lists and costs from which `evolve` starts."""
        theta = self.np.asarray(own.memory.theta.numpy())
        return theta, *self.arrays(own.population, own.cost)

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]


def _runs(jax: Any, own: "Own", make: Callable[..., Any]) -> Any:
    """A function of one run as one of all runs, compiled."""
    return jax.jit(jax.vmap(make(jax, own)))


def _network(jax: Any, own: "Own") -> Callable[..., Any]:
    """Scaled outputs of one run's networks for one pattern, ``(3,)``."""
    shape, np_ = own.problem.shape, jax.numpy
    sizes = np.cumsum(
        [shape.units * shape.inputs, shape.units, shape.groups * shape.hidden]
    )

    def outputs(theta: Any, pattern: Any) -> Any:
        """Outputs from weights ``(D,)`` and inputs ``(I,)``."""
        w1, b1, w2, b2 = np_.split(theta, sizes)
        hidden = jax.nn.sigmoid(w1.reshape(shape.units, shape.inputs) @ pattern + b1)
        grouped = hidden.reshape(shape.groups, shape.hidden)
        return (grouped * w2.reshape(shape.groups, shape.hidden)).sum(1) + b2

    return outputs


def _judge(jax: Any, own: "Own") -> Callable[..., Any]:
    """Cost of one list of commands in one run's networks."""
    np_, problem, task = jax.numpy, own.problem, own.config.task
    scaling, encoding = problem.scaling, problem.encoding
    centre, half, output = (
        np_.asarray(part.numpy())
        for part in (scaling.centre, scaling.half, scaling.output)
    )
    goals = np_.asarray(problem.evaluator.goal.goals.numpy())
    outputs, (_, _, yaw0) = _network(jax, own), problem.evaluator.goal.start
    count = len(goals)

    def judge(theta: Any, genes: Any, length: Any) -> Any:
        """Cost of genes ``(K, 3)`` of which `length` hold."""
        used = np_.arange(len(genes)) < length
        speeds = np_.where(abs(genes[:, :2]) < encoding.dead_band, 0.0, genes[:, :2])
        before = np_.pad(speeds, ((1, 0), (0, 0)))[:-1]
        raw = np_.concatenate([before, speeds, genes[:, 2:]], axis=1)
        moved = jax.vmap(outputs, (None, 0))(theta, (raw - centre) / half) * output
        ahead, left, turn = np_.where(used[:, None], moved, 0.0).T
        yaw = yaw0 + np_.cumsum(turn) - turn
        x = np_.cumsum(np_.cos(yaw) * ahead - np_.sin(yaw) * left)
        y = np_.cumsum(np_.sin(yaw) * ahead + np_.cos(yaw) * left)

        def step(carry: Any, place: Any) -> Any:
            """One command of Algorithm 5."""
            total, active = carry
            east, north, holds = place
            goal = goals[np_.minimum(active, count - 1)] * (active < count)
            square = ((np_.stack([east, north]) - goal) * CENTIMETRES) ** 2
            square = square.sum()
            distance = np_.sqrt(square)
            counts = (active < count) & (holds | task.charge_unused)
            cost = square if task.squared else distance
            near = holds & (active < count) & (distance < task.radius * CENTIMETRES)
            return (total + np_.where(counts, cost, 0.0), active + near), None

        begin = (task.command_cost * length.astype(np_.float32), np_.int32(0))
        (total, active), _ = jax.lax.scan(step, begin, (x, y, used))
        return total + task.penalty * (count - active)

    return judge


def _breeding(jax: Any, own: "Own") -> tuple[Callable[..., Any], ...]:
    """Whole numbers below a limit, the winner of a tournament, a child of two."""
    np_, encoding = jax.numpy, own.problem.encoding
    low, high = (np_.asarray(each.numpy()) for each in (encoding.low, encoding.high))
    rate = float(own.rates.rate[0])
    magnitude = np_.asarray(own.rates.magnitude[0].numpy())

    def below(coin: Any, limit: Any) -> Any:
        """A uniform number as a whole one below a limit."""
        return np_.minimum((coin * limit).astype(np_.int32), limit - 1)

    def winner(cost: Any, coins: Any) -> Any:
        """Of a tournament."""
        entrants = below(coins, len(cost))
        return entrants[np_.argmin(cost[entrants])]

    def child(mother: Any, father: Any, cuts: Any, coins: Any) -> Any:
        """Single-point crossover of two lists, cut independently; then mutation."""
        (first, own_length), (second, other_length) = mother, father
        place = np_.arange(len(first))
        begin, after = below(cuts[0], own_length + 1), below(cuts[1], other_length + 1)
        whole = begin + other_length - after
        tail = second[np_.clip(place - begin + after, 0, len(first) - 1)]
        mixed = np_.where((place < begin)[:, None], first, tail)
        genes = np_.where(whole == 0, first, mixed)
        length = np_.where(whole == 0, own_length, np_.minimum(whole, len(first)))
        share = np_.minimum(coins / rate, 1.0)
        changed = np_.clip(genes + (2 * share - 1) * magnitude, low, high)
        genes = np_.where(coins < rate, changed, genes)
        return np_.where((place < length)[:, None], genes, 0.0), length

    return below, winner, child


def _generation(jax: Any, own: "Own") -> Callable[..., Any]:
    """One generation of one run: a child at a time, mapped over children."""
    np_, encoding = jax.numpy, own.problem.encoding
    evolution, judge = own.config.evolution, _judge(jax, own)
    low, high = (np_.asarray(each.numpy()) for each in (encoding.low, encoding.high))
    shortest, longest = encoding.initial
    below, winner, child = _breeding(jax, own)

    def generation(theta: Any, lists: Any, cost: Any, coins: Any) -> Any:
        """Lists and costs after one generation."""
        genes, lengths = lists
        lengths = lengths.astype(np_.int32)
        parents = jax.vmap(winner, (None, 0))(cost, coins["parents"])
        mothers, fathers = np_.split(parents, 2)
        count = shortest + below(coins["fresh_lengths"], longest + 1 - shortest)
        fresh = low + coins["fresh"] * (high - low)
        held = np_.arange(fresh.shape[1]) < count[:, None]
        fresh = np_.where(held[..., None], fresh, 0.0)
        chosen = coins["chicken"] < evolution.headless_chicken
        rank = np_.maximum(np_.cumsum(chosen) - 1, 0) % len(count)
        second = np_.where(chosen[:, None, None], fresh[rank], genes[fathers])
        length = np_.where(chosen, count[rank], lengths[fathers])
        children, sizes = jax.vmap(child)(
            (genes[mothers], lengths[mothers]),
            (second, length),
            coins["crossover"],
            coins["mutation"],
        )
        best = np_.argmin(cost)[None]
        genes = np_.concatenate([genes[best], children])
        lengths = np_.concatenate([lengths[best], sizes])
        return (genes, lengths), jax.vmap(judge, (None, 0, 0))(theta, genes, lengths)

    return generation


def _evolution(jax: Any, own: "Own") -> Callable[..., Any]:
    """All generations of a trial of one run, its random numbers drawn within."""
    generation, problem = _generation(jax, own), own.problem
    drawn = problem.breeder.draw(problem.draws, own.rates)._asdict().items()
    shapes = {name: part.shape[1:] for name, part in drawn if part is not None}

    def evolution(theta: Any, lists: Any, cost: Any, key: Any) -> Any:
        """Lists and costs after all generations."""

        def step(carry: Any, key: Any) -> Any:
            """One of them."""
            keys = jax.random.split(key, len(shapes))
            coins = {
                name: jax.random.uniform(each, shape)
                for each, (name, shape) in zip(keys, shapes.items(), strict=True)
            }
            return generation(theta, *carry, coins), None

        genes, lengths = lists
        begin = ((genes, lengths.astype(jax.numpy.int32)), cost)
        keys = jax.random.split(key, own.config.evolution.generations)
        return jax.lax.scan(step, begin, keys)[0]

    return evolution


def _training(jax: Any, own: "Own", epochs: int) -> Callable[..., Any]:
    """Rprop on all patterns of one run, gradients by JAX."""
    np_, outputs = jax.numpy, _network(jax, own)
    decay = own.config.snn.weight_decay

    def loss(theta: Any, inputs: Any, targets: Any) -> Any:
        """Half the sum of squared errors and of the decay."""
        said = jax.vmap(outputs, (None, 1), 1)(theta, inputs)
        return 0.5 * ((said - targets) ** 2).sum() + 0.5 * decay * (theta**2).sum()

    def trained(theta: Any, inputs: Any, targets: Any) -> Any:
        """Weights of one run."""

        def step(carry: Any, _: Any) -> Any:
            """One epoch."""
            theta, previous, size = carry
            grad = jax.grad(loss)(theta, inputs, targets)
            agree = grad * previous
            factor = np_.where(agree > 0, GROW, np_.where(agree < 0, SHRINK, 1.0))
            size = np_.clip(size * factor, STEP_MIN, STEP_MAX)
            grad = np_.where(agree < 0, 0.0, grad)
            return (theta - np_.sign(grad) * size, grad, size), None

        zero = np_.zeros_like(theta)
        begin = (theta, zero, np_.full_like(theta, FIRST_STEP))
        return jax.lax.scan(step, begin, None, epochs)[0][0]

    return trained
