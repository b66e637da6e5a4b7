"""BNS for walking (thesis chapter 7): servo goals -> predicted path -> cost.

Inputs of the networks (7.2.5): the servos' present goals and their next ones, at the
start all half-way. Outputs: forward, left [m] and turn [rad] of the command in the body
frame at its start.

Inside the SNN lower is better, as everywhere here. The dissertation's fitness (7.1)
divides the ensemble's variance (7.2) by the distance. A controller whose commands all
members agree upon scores next to nothing, however short the way, so evolution goes
where the SNN is sure, not where the robot gets far. The repaired form is a distance:
the mean end point's, less the members' spread around it. Standing still costs 0 at
best, and any walk that is longer than its spread beats it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from bns.draws import whole_below
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.evolution.generation import Rates
from bns.evolution.goals import TICK, GoalBreeder, Goals, reaches
from bns.experiment.config import RunConfig
from bns.experiment.robots import told
from bns.experiment.task_settings import WalkConfig
from bns.learners.bns import change_detection
from bns.learners.bns.bearing import Bearing
from bns.learners.bns.memory import Memory
from bns.learners.bns.navigation import OpenLoopProblem
from bns.learners.bns.nominal import Nominal, said
from bns.snn import training
from bns.snn.network import OUTPUTS, Shape, forward, integrate, predict
from bns.tasks import walk as walking
from bns.worlds.trial import Trial, body_displacements

GOAL = 0.5  # [rad] that is scaled to 1; assumed
MOVED = (0.05, 0.05, 0.25)  # [m, m, rad] of a command that are scaled to 1; assumed
SHORTEST = 1e-6  # [m] so that the printed form stays finite
START = (0.0, 0.0, 0.0)
SEEDS = 2**24  # of motions drawn by NumPy: as many as a float32 tells apart
CHUNK = 1100  # patterns predicted at once on a CPU: activations stay in its cache


@dataclass(frozen=True)
class WalkEvaluator:
    """What a population is worth according to an ensemble; as `Evaluator`.

    Attributes:
        shape: of the ensemble.
        config: which fitness.
        nominal: the model that the ensemble adds to; None = to nothing.
    """

    shape: Shape
    config: WalkConfig
    nominal: Nominal | None = None

    def inputs(self, population: Population) -> Tensor:
        """Network inputs, ``(R, 2 C, K * P)``, the individual varying fastest."""
        scaled = goal_inputs(population.genes)
        found = scaled.permute(0, 3, 2, 1).flatten(2).contiguous()
        return found if self.nominal is None else found * self.nominal.moving

    def members(self, theta: Tensor, seen: Tensor) -> Tensor:
        """Scaled outputs of every member, ``(R, G, 3, N)``, piece by piece."""
        if seen.device.type != "cpu":
            own = forward(self.shape, theta, seen)
        else:
            own = torch.cat(
                [
                    torch.cat([forward(self.shape, row, part) for part in parts], dim=3)
                    for row, parts in zip(
                        theta.split(1), map(_pieces, seen.split(1)), strict=True
                    )
                ]
            )
        if self.nominal is None:
            return own
        told = [said(self.nominal.theta, part) for part in _pieces(seen)]
        return own + (self.nominal.trust * torch.cat(told, dim=2))[:, None]

    def judge(
        self, theta: Tensor, seen: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """See `PathEvaluator.judge`; `fused` changes nothing here."""
        del fused
        return self.worth(self.members(theta, seen), lengths.shape[1])

    def worth(self, outputs: Tensor, count: int) -> Tensor:
        """Cost ``(R, P)`` of P = `count` individuals from the members' outputs."""
        if self.config.fitness == "repaired":
            x, y, _ = path(outputs, count)
            return repaired(x[:, :, -1], y[:, :, -1], self.config.doubt)
        x, y, _ = path(outputs.mean(1, keepdim=True), count)
        distance = (x[:, 0, -1].square() + y[:, 0, -1].square()).sqrt()
        return printed(distance, variance(outputs, count))

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost of a population, ``(R, P)``."""
        return self.judge(theta, self.inputs(population), population.lengths)

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Pose at the start and after each command as the members' mean foresees it.

        Returns:
            ``(R, P, K + 1, 3)`` [m, m, rad].
        """
        outputs = self.members(theta, self.inputs(population))
        x, y, yaw = path(outputs.mean(1, keepdim=True), population.lengths.shape[1])
        after = torch.stack([x[:, 0], y[:, 0], yaw[:, 0]], dim=-1).transpose(1, 2)
        return torch.nn.functional.pad(after, (0, 0, 1, 0))

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """V of equation 7.2 for a population, ``(R, P)``."""
        outputs = self.members(theta, self.inputs(population))
        return variance(outputs, population.lengths.shape[1])


def path(outputs: Tensor, count: int) -> tuple[Tensor, Tensor, Tensor]:
    """Compose each member's own path.

    Args:
        outputs: scaled, ``(R, G, 3, K * P)``.
        count: P.

    Returns:
        x, y [m] and yaw [rad] after each command, each ``(R, G, K, P)``.
    """
    runs, members = outputs.shape[:2]
    moved = outputs.view(runs, members, 3, -1, count)
    ahead, left, turn = (moved[:, :, axis] * MOVED[axis] for axis in range(3))
    return integrate(ahead, left, turn, START, dim=2)


def variance(outputs: Tensor, count: int) -> Tensor:
    """Equation 7.2: the members' variance of the scaled outputs, summed over these
    and over commands, ``(R, P)``; members along axis 1."""
    spread = outputs.var(1, unbiased=False).sum(1)
    return spread.view(len(outputs), -1, count).sum(1)


def _pieces(seen: Tensor) -> tuple[Tensor, ...]:
    return tuple(part.contiguous() for part in seen.split(CHUNK, dim=2))


def printed(distance: Tensor, variance: Tensor) -> Tensor:
    """Equations 7.1 and 7.2, the sign turned.

    Args:
        distance: from start to end of the predicted path [m].
        variance: of the members' predictions, summed over outputs and commands.
    """
    return variance / distance.clamp(min=SHORTEST)


def repaired(x: Tensor, y: Tensor, doubt: float) -> Tensor:
    """Spread less distance of the members' end points [m].

    Args:
        x, y: end points from the start, the members along axis 1, ``(R, G, P)`` [m].
        doubt: weight of the spread.

    Returns:
        ``(R, P)``.
    """
    spread = (x.var(1, unbiased=False) + y.var(1, unbiased=False)).sqrt()
    return doubt * spread - (x.mean(1).square() + y.mean(1).square()).sqrt()


def goal_inputs(goals: Tensor) -> Tensor:
    """Network inputs of command lists, goals ``(..., K, C)`` [rad].

    Returns:
        ``(..., K, 2 C)``, scaled.
    """
    before = torch.nn.functional.pad(goals, (0, 0, 1, 0))[..., :-1, :]
    return torch.cat([before, goals], dim=-1) / GOAL


def of_trial(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """What the commands of a trial were and did.

    Returns:
        scaled inputs ``(K, 2 C)`` and displacements ``(K, 3)`` [m, m, rad]; commands
        whose pose was lost at either end, and diverged trials, are left out.
    """
    seen = goal_inputs(torch.from_numpy(trial.commands.values.copy())).numpy()
    moved = body_displacements(trial.command_poses_world)
    good = np.isfinite(moved).all(1) & trial.outcome.usable
    return seen[good], moved[good]


def check_walker(config: RunConfig) -> None:
    """Refuse a robot, or networks, that the task cannot be learned with.

    Raises:
        BnsError: says all that has to be changed.
    """
    wrong, give, kind = [], [], told(config.world.robot).kind
    if kind != "legged":
        robot, world = config.world.robot, config.world.name
        wrong.append(f"a robot with legs (world.robot = {robot!r} is {kind} and cannot "
                     f"walk; world.name = {world!r})")  # fmt: skip
        give.append("--world.robot phantomx --world.name hexapod")
    if config.snn.kind != "ensemble":
        wrong.append(f"networks that can disagree (snn.kind = {config.snn.kind!r})")
        give.append("--snn.kind ensemble")
    if wrong:
        raise BnsError(
            f"task.name = {config.task.name!r} needs {' and '.join(wrong)}: start from "
            f"the preset hexapod-walk, or give {' '.join(give)}."
        )


class WalkProblem(OpenLoopProblem):
    """BNS for lists of servo goals (investigation D).

    No generation is compiled. A compiled one took 4.5 times as long as an eager one
    (30 runs of 400 lists of 198 goals, one thread: 0.38 s against 0.085 s), since the
    compiler has no vectorised inverse error function, which normal mutations need; what
    the networks foresee is a matter of large matrix products, as fast without.
    """

    encoding: Goals
    stream = "walk-learner"
    relative_cost = 0.0
    bucket = 256
    has_behaviours = True
    columns: ClassVar[Mapping[str, str]] = {
        "distance_predicted": "from start to end as the SNN foresaw it [m]",
        "disagreement": "of the ensemble on the controller tried (equation 7.2)",
        "worth_predicted": "what it was worth inside the SNN",
        "legs_lost": "numbers of the legs taken for lost before it: 15 = legs 1 and 5",
    }

    def set_up(self) -> None:
        """See `Problem.set_up`."""
        config = self.config
        check_walker(config)
        self.encoding = Goals.of(config)
        self.shape = Shape(
            groups=config.snn.members,
            hidden=config.snn.hidden,
            outputs=OUTPUTS,
            inputs=2 * len(self.encoding.channels),
            activation=config.walk.activation,
        )
        self.output = torch.tensor(MOVED)
        names = [channel.name for channel in self.encoding.channels]
        self._femurs = [i for i, name in enumerate(names) if name.endswith("_femur")]
        self.nominal = Nominal(config, self.runs) if config.walk.nominal else None
        self.bearing = None
        if config.walk.lost_legs:
            if self.nominal is None or not config.watch.forget:
                raise BnsError(
                    "walk.lost_legs asks the model of the legs when the robot has "
                    "changed; set walk.nominal = true and watch.forget = true as well."
                )
            self.bearing = Bearing(self.nominal)
        if config.walk.anchors and self.nominal is None:
            raise BnsError(
                "walk.anchors are motions in which the model of the legs is right; set "
                "walk.nominal = true as well."
            )
        self.evaluator = WalkEvaluator(self.shape, config.walk, self.nominal)
        self.breeder = GoalBreeder(config.evolution, self.encoding, True)
        self._compile()

    def choosing(self, trial: int) -> RunConfig:
        """Before evolution starts, any: an SNN that has seen next to nothing would
        choose what it has seen."""
        if trial < self.config.evolve_from:
            return replace(self.config, choose="random")
        return self.config

    def rates(self, trial: int) -> Rates:
        """See `Problem.rates`."""
        rate, _ = self.adaptations.mutation(trial)
        usual = [config.walk.mutation_magnitude for config in self.configs]
        size = self.adaptations.magnitudes(trial, usual)
        each = torch.tensor(size, dtype=torch.float32)[:, None] * TICK
        servos = len(self.encoding.channels)
        return Rates(
            torch.from_numpy(rate).to(self.device),
            each.expand(-1, servos).to(self.device),
            repeat=self._repeat(trial),
            reach=self._reach(trial),
        )

    def _reach(self, trial: int) -> Tensor | None:
        """How far goals may be from half-way now, ``(C,)`` [rad]; None = as ever."""
        walk = self.config.walk
        if trial >= walk.grow_until:
            return None
        share = (trial - walk.grow_from) / max(walk.grow_until - walk.grow_from, 1)
        found = reaches(walk, self.encoding.channels, max(share, 0.0))
        return torch.from_numpy(found).to(self.encoding.low)

    def _repeat(self, trial: int) -> Tensor | None:
        """Chance that a child repeats its commands, of each run; None = of no run."""
        walk = self.config.walk
        chance = self.adaptations.since_damage(trial, walk.repeat, walk.repeat_after)
        if not chance.any():
            return None
        return torch.from_numpy(chance.astype(np.float32)).to(self.device)

    def predicted(
        self, memories: Sequence[Memory], chosen: Population, tried: Sequence[Trial]
    ) -> dict[str, np.ndarray]:
        """See `Problem.predicted`; beside, `columns`."""
        theta = memories[0].theta
        poses = self.evaluator.poses(theta, chosen)[:, 0].double().cpu().numpy()
        far = walking.distance(poses)
        spread = self.evaluator.disagreement(theta, chosen)[:, 0]
        worth = self.evaluator.cost(theta, chosen)[:, 0]
        legs = {} if self.bearing is None else {"legs_lost": self.bearing.numbers()}
        return {
            **legs,
            "predicted": poses,
            "distance_predicted": far,
            "disagreement": spread.double().cpu().numpy(),
            "worth_predicted": worth.double().cpu().numpy(),
            "fitness_predicted": walking.cost(far),
        }

    def behaviours(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """See `Problem.behaviours`: what `WalkTask.behaviour` says of commands."""
        del memories
        return (population.genes[..., self._femurs] <= 0).float().mean(2)

    def inputs_and_motion(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """See `OpenLoopProblem.inputs_and_motion`."""
        return of_trial(trial)

    def foreseen(self, memory: Memory, run: int, inputs: np.ndarray) -> np.ndarray:
        """See `OpenLoopProblem.foreseen`; with what the ensemble adds to."""
        model = self.nominal
        if model is None:
            return super().foreseen(memory, run, inputs)
        inputs = inputs * model.moving[run, :, 0].cpu().numpy()
        found = super().foreseen(memory, run, inputs)
        seen = torch.from_numpy(inputs.T.astype(np.float32))[None].to(self.device)
        told = model.trust[run] * said(model.theta[run : run + 1], seen)[0]
        total: np.ndarray = found + told.cpu().numpy().T
        return total

    def forget(self, run: int, memories: Sequence[Memory]) -> int:
        """See `Problem.forget`; by `bearing` and `change_detection`."""
        memory, size = memories[0], self.config.walk.commands
        inputs, targets = memory.patterns(run)
        newest = self.bearing.ask(run, inputs, targets, size) if self.bearing else 0
        newest = newest or change_detection.changed(inputs, targets, size)
        if not newest:
            return 0
        memory.keep(run, newest)
        return (len(inputs) - newest) // size

    def train(
        self, shape: Shape, theta: Tensor, patterns: training.Patterns
    ) -> tuple[Tensor, Tensor]:
        """See `Problem.train`; by Adam on parts of the patterns (walk.batch > 0)."""
        walk, model = self.config.walk, self.nominal
        if model is not None:
            patterns = patterns._replace(inputs=patterns.inputs * model.moving)
            rest = patterns.targets - model.weigh(patterns)
            patterns = patterns._replace(targets=rest)
        if walk.batch == 0:
            return super().train(shape, theta, patterns)
        if walk.pull:
            foreseen = predict(shape, theta, patterns.inputs)
            away = (patterns.targets - foreseen).clamp(-walk.pull, walk.pull)
            patterns = patterns._replace(targets=foreseen + away)
        if walk.anchors and model is not None:
            seed = int(whole_below(self.draws.uniform(1), SEEDS))
            rng = np.random.default_rng(seed)
            patterns = model.anchored(patterns, walk.anchors, rng)
        return training.fit_adam(shape, self.config, theta, patterns, self.draws)

    def state(self) -> dict[str, np.ndarray]:
        """See `Problem.state`; that of the model of the legs."""
        return {} if self.nominal is None else self.nominal.state()

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Problem.restore`."""
        if self.nominal is not None:
            self.nominal.restore(arrays)
