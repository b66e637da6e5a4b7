"""BNS that practises in a model of the robot, and has the diagnosis mend that model.

Before a trial on the robot some are run in the model (`prior.world`): evolved in the
SNN and learned from as trials of BNS are, but counted as evaluations of the model. So a
robot that the model is right about has learned before its first trial.

After each trial on the robot the model runs what was tried. Where it moves otherwise,
the robot is another one than the model: what was learned before is forgotten, and the
model is not practised in. The trials from then on go through the diagnosis
(`bns.gap.diagnose`), and the effects that it names are put into the model, where that
makes it right about these trials. Nobody is told of a damage.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.experiment import diagnosing
from bns.experiment.config import LearnerSettings
from bns.experiment.record import Step, under
from bns.learners.base import Curves, Panel, Proposal
from bns.learners.bns.learner import Bns
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial

MOST = 12
"""trials that a diagnosis is given at most: it costs time with each"""


@dataclass(frozen=True, kw_only=True)
class PractisingSettings(LearnerSettings):
    """Settings of BNS that practises."""

    first: int = 20
    """trials in the model before the first one on the robot"""
    each: int = 2
    """trials in the model before every other one"""
    anew: int = 20
    """trials in the model once it was mended"""
    wrong: float = 0.2
    """the robot is not the model where that misses its motion by more than this share
    of it, and by more than twice what it missed before"""
    diagnose: bool = True
    """whether the diagnosis mends the model; else it is not practised in any more"""
    needed: int = 3
    """trials of a robot that is not the model before it is diagnosed; where that is of
    no use, again after twice as many"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "first": (0, 100_000, "trials"),
        "each": (0, 100_000, "trials"),
        "anew": (0, 100_000, "trials"),
        "wrong": (0, 100, "1"),
        "needed": (2, MOST, "trials"),
    }


class Known:
    """What one run knows of its model.

    Attributes:
        effects: that were put into it, as text.
        right: whether it is taken for the robot.
        usual: what it missed of the trials that it was mended by; 0 = as it was made.
        asked: trials of a robot that is another one, after which it is diagnosed next.
        mended: whether it was since the run's last practice.
        trials: on the robot, while it is another one than the model.
    """

    def __init__(self) -> None:
        self.effects: tuple[str, ...] = ()
        self.right, self.usual, self.asked, self.mended = True, 0.0, 0, False
        self.trials: list[Trial] = []

    def state(self) -> dict[str, np.ndarray]:
        """All of it as plain arrays, each as `restore` takes it."""
        return {
            "effects": np.array(self.effects, dtype=np.str_),
            "numbers": np.array([self.right, self.usual, self.asked, self.mended]),
            **Step({}, {}, self.trials).to_arrays(),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.effects = tuple(str(text) for text in arrays["effects"])
        right, self.usual, asked, mended = arrays["numbers"].tolist()
        self.right, self.asked, self.mended = bool(right), int(asked), bool(mended)
        self.trials = list(Step.from_arrays(arrays, "A learner's state").trials)


class Practising(Bns):
    """R runs of BNS that practise in a model; arguments as `Learner`.

    Raises:
        BnsError: no model, a robot that steers while it drives, or a setting that it
            has in its own way.
    """

    Settings = PractisingSettings
    needs_model = True
    open_loop = True
    columns: ClassVar[Mapping[str, str]] = {
        **Bns.columns,
        "model_miss": "share of the trial's motion that the model missed (rms)",
        "practised": "trials in the model before it",
        "mended": "1 where a diagnosis mended the model after it",
    }
    figures: ClassVar[tuple[Curves | str, ...]] = (
        *Bns.figures,
        Curves(
            name="model_miss",
            title="What the model misses",
            caption="Share of a trial's motion that the model of the robot misses. It "
            "jumps when the robot changes, and falls when a diagnosis mends the model. "
            "{band}",
            label="missed by the model",
            panels=(Panel("model_miss", "share of the motion"),),
        ),
    )

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            BnsError: a setting that it has in its own way.
        """
        super().begin()
        self.rule = cast(PractisingSettings, self.config.settings)
        watch = self.config.watch
        if watch.forget or watch.detect:
            raise BnsError(
                "The learner 'practising' tells by its model that a robot has changed: "
                "leave watch.forget and watch.detect out."
            )
        if self.rule.diagnose and self.config.prior.reality:
            raise BnsError(
                "A diagnosis begins with the robot as it was made: leave prior.reality "
                "out, or give --settings.no-diagnose."
            )
        self.known = [Known() for _ in range(self.runs)]
        self._practised = np.zeros(self.runs)

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`; practises first."""
        wanted = [self._wanted(known, trial) for known in self.known]
        self._practised = np.zeros(self.runs)
        for number in range(max(wanted)):
            runs = [
                run
                for run, count in enumerate(wanted)
                if number < count and self.models[run].left
            ]
            if runs:
                self._practise(trial, number, runs)
        return super().propose(trial)

    def _wanted(self, known: Known, trial: int) -> int:
        """Trials in the model before one on the robot."""
        mended, known.mended = known.mended, False
        if not known.right:
            return 0
        if mended:
            return self.rule.anew
        return self.rule.each if trial else self.rule.first

    def _practise(self, trial: int, number: int, runs: Sequence[int]) -> None:
        """One trial of some runs in their models, and what it teaches."""
        problem = self.problem
        self.cost = problem.cost(self.memories, self.population)
        if trial + number >= self.config.evolve_from:
            self._settle(trial)
            self._evolve(trial, self.config.evolution.generations)
        best = self.cost.reshape(self.runs, -1).argmin(1)
        tried = problem.controllers(self._by_run(self.population).pick(best))
        which = np.zeros(self.runs, bool)
        for run in runs:
            names = ("practising", self.replicates[run], trial, number)
            seed = seeding.integer(self.config.seed, *names)
            seen = self._modelled(run, self.known[run].effects, [tried[run]], seed)[0]
            self._remember(run, trial, problem.patterns(run, seen))
            which[run] = True
        for memory in self.memories:
            memory.train(problem, which)
        problem.trained(self.memories)
        self._practised += which

    def _modelled(
        self, run: int, effects: Sequence[str], tried: Sequence[Any], seed: int
    ) -> list[Trial]:
        """Trials in a run's model with effects, each charged."""
        world: Any = self.models[run]
        if effects:
            world = world.having([Damage.parse(effects)] * len(tried))
        seeds = [seed + number for number in range(len(tried))]
        return self.task.execute(world, tried, trial=0, seeds=seeds)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`; before, whether the robot is still the model."""
        missed, mended = np.full(self.runs, np.nan), np.zeros(self.runs)
        self._gone = np.zeros(self.runs)
        for run, seen in enumerate(tried):
            known = self.known[run]
            if not self.models[run].left or not seen.outcome.usable:
                continue
            missed[run] = self._missed(run, known.effects, [seen], trial)[0]
            wrong = missed[run] > max(self.rule.wrong, 2 * known.usual)
            if wrong and known.right:
                known.right, known.asked = False, self.rule.needed
                self._gone[run] = max(len(m.trials[run]) for m in self.memories)
                for memory in self.memories:
                    memory.keep(run, 0)
            elif not wrong:
                known.right, known.trials = True, []
            if not known.right:
                known.trials = [*known.trials, seen][-MOST:]
                mended[run] = self._diagnosed(run, trial)
        row = super().observe(trial, tried, best)
        own = {"model_miss": missed, "practised": self._practised, "mended": mended}
        return {**row, **own}

    def _train(self, row: dict[str, np.ndarray]) -> None:
        super()._train(row)
        row["forgotten"] = self._gone

    def _missed(
        self, run: int, effects: Sequence[str], trials: Sequence[Trial], trial: int
    ) -> np.ndarray:
        """Share of the motion of trials that the model misses with effects, ``(T,)``.

        Infinite where not as many commands were seen.
        """
        names = ("model", self.replicates[run], trial)
        seed = seeding.integer(self.config.seed, *names)
        told = [seen.commands for seen in trials]
        made = self._modelled(run, effects, told, seed)
        found = np.full(len(trials), np.inf)
        for place, both in enumerate(zip(made, trials, strict=True)):
            said, seen = (self._moved(run, part) for part in both)
            if said.shape == seen.shape and len(seen):
                size = max(float(np.sqrt((seen**2).mean())), 1e-9)
                found[place] = float(np.sqrt(((said - seen) ** 2).mean())) / size
        return found

    def _moved(self, run: int, trial: Trial) -> np.ndarray:
        """Scaled motions of a trial's commands, ``(K, 3)``."""
        return self.problem.patterns(run, trial)[0][0].targets

    def _diagnosed(self, run: int, trial: int) -> bool:
        """Mend a run's model by a diagnosis; whether that was of use."""
        known, count = self.known[run], len(self.known[run].trials)
        if not self.rule.diagnose or count < known.asked:
            return False
        known.asked = min(2 * count, MOST)
        sets = self._named(known.trials)
        if not sets or self.models[run].left < count:
            return False
        before = self._missed(run, known.effects, known.trials, trial)
        enough = min(2 * self.rule.wrong, float(np.median(before)) / 2)
        for effects in sets:
            if self.models[run].left < count:
                break
            try:
                missed = self._missed(run, effects, known.trials, trial)
            except BnsError:  # an effect that the model cannot have
                continue
            if np.median(missed) < enough:
                known.effects, known.usual = effects, float(np.median(missed))
                known.right, known.mended, known.trials = True, True, []
                return True
        return False

    def _named(self, trials: Sequence[Trial]) -> list[tuple[str, ...]]:
        """Sets of effects that the diagnosis of trials names, the best first."""
        return diagnosing.named(trials, self.config.world.robot, seed=self.config.seed)

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`; with what is known of the models, and their cost."""
        arrays = super().state() | self.spent()
        for run, known in enumerate(self.known):
            own = known.state().items()
            arrays |= {f"model.{run}.{name}": array for name, array in own}
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        super().restore(arrays)
        self.restore_spent(arrays)
        for run, known in enumerate(self.known):
            known.restore(under(f"model.{run}.", arrays))


LEARNER = Practising
