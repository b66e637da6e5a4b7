"""Settings of the learner `bns`: its sections of a configuration.

Those of light following and of walking lie with the tasks,
see `bns.experiment.task_settings`.
"""

from dataclasses import dataclass, fields
from typing import Literal

Selection = Literal["tournament", "best", "roulette", "random"]
Crossover = Literal["single-point", "n-point", "uniform", "sbx"]
Mutation = Literal["uniform-range", "bounded-uniform", "gaussian"]

BNS_SECTIONS = (
    "evolution",
    "snn",
    "adaptation",
    "watch",
    "choose",
    "choose_tournament",
    "deploy",
    "evolve_from",
    "compiled",
)
"""sections and settings of the learner `bns`; other learners have `settings`"""


@dataclass(frozen=True, kw_only=True)
class EvolutionConfig:
    """Evolution inside the SNN."""

    population: int = 100
    """individuals"""
    generations: int = 60
    """generations between two trials in the world (silent)"""
    selection: Selection = "tournament"
    """parents"""
    tournament: int = 3
    """tournament size for parents"""
    crossover: Crossover = "single-point"
    """how two parents make a child; cuts fall between commands, independently"""
    crossover_points: int = 2
    """cuts of n-point crossover"""
    sbx_eta: float = 1.0
    """distribution index of simulated binary crossover (eq 2.17)"""
    mutation: Mutation = "bounded-uniform"
    """uniform-range eq 2.18, bounded-uniform eq 2.19, gaussian eq 2.20"""
    mutation_rate: float = 0.1
    """probability per gene"""
    mutation_magnitude: float = 2000.0
    """speed genes [speed units]"""
    duration_magnitude: float = 0.35
    """duration genes [s] (silent)"""
    elitism: int = 1
    """best individuals copied unchanged"""
    headless_chicken: float = 0.1
    """probability that the second parent is a fresh random one"""
    cells: int = 0
    """bins along each behaviour of a grid whose elites survive (own; MAP-Elites inside
    the SNN, bns/evolution/selection.py); 0 = children replace their parents"""


@dataclass(frozen=True, kw_only=True)
class SnnConfig:
    """The simulator neural network."""

    kind: Literal["three", "ensemble"] = "three"
    """three: one 5-20-1 net each for forward, left, turn (thesis Fig 4.4);
    ensemble: several single networks with dropout and three outputs"""
    hidden: int = 20
    """hidden neurons"""
    members: int = 5
    """networks in the ensemble (kind = ensemble)"""
    dropout: float = 0.1
    """dropout rate after the hidden layer (kind = ensemble)"""
    epochs: int = 400
    """Rprop epochs after each trial (silent)"""
    weight_decay: float = 0.001
    """weight of the squared weights in the training loss (silent); 0 = none"""
    warm_start: bool = True
    """go on from the previous weights"""


@dataclass(frozen=True, kw_only=True)
class AdaptationConfig:
    """What is changed to recover from damage. "On damage" means: told when it came."""

    window: int = 0
    """train on the newest patterns only; 0 = all"""
    population_reset: bool = False
    """fresh random population on damage"""
    simulator_reset: bool = False
    """fresh random SNN on damage (data kept)"""
    simulator_reset_untrained: bool = False
    """the SNN of simulator_reset is trained after the next trial only, and evolution
    goes on in it untrained until then (4.3.5 may be read so); else at once"""
    simulator_reset_every: int = 0
    """fresh random SNN every so many trials; 0 = never"""
    data_reset: bool = False
    """forget all patterns on damage"""
    restart: bool = False
    """population, SNN and patterns all reset on damage"""
    extra: tuple[str, ...] = ()
    """further adaptations by name: population_reset_every:trials=10"""
    mutation_rate_after: float = 0.0
    """mutation rate after damage; 0 = unchanged"""
    mutation_magnitude_after: float = 0.0
    """mutation magnitude after damage [speed units]; 0 = unchanged"""


@dataclass(frozen=True, kw_only=True)
class WatchConfig:
    """Damage detection (navigation, light following), and forgetting by evidence."""

    detect: bool = False
    """watch for damage; the adaptations to damage then follow what is detected
    instead of being told"""
    threshold: float = 6.0
    """an alarm is an innovation so many times what is usual in its run"""
    warmup: int = 6
    """trials that are seen before the first alarm, and after each before the next"""
    history: int = 12
    """trials before this one that an innovation is compared with"""
    floor: float = 0.03
    """an SNN is believed no better than this share of the largest motion or reading;
    what a damage changes less is not looked for"""
    grow: float = 0.3
    """by this share more for each unit of distance to the `near` nearest learned
    patterns (scaled inputs)"""
    reach: float = 0.4
    """a pattern is on known ground where a learned one lies no further away"""
    near: int = 5
    """what an SNN errs by at some place is its error on so many learned patterns; a
    trial with fewer patterns on known ground is not judged"""
    largest: int = 5
    """a trial is judged by so many of its patterns, those that stand out most"""
    forget: bool = False
    """drop all that came before a change of the robot: the last trial that the newest
    one contradicts, and those before it; for a walker the settings below do nothing
    (bns/learners/bns/forgetting.py)"""
    forget_factor: float = 4.0
    """an old trial is contradicted when it differs from the newest one by so many
    times what either differs from itself (navigation: by which the SNNs err)"""
    forget_floor: float = 0.02
    """what differs by less of the largest motion or reading is no contradiction"""
    forget_reach: float = 0.2
    """patterns are compared where their scaled inputs lie no further apart"""
    forget_least: int = 8
    """patterns of an old trial that have to be comparable before it is judged"""

    def idle(self, task: str) -> set[str]:
        """The settings that do nothing as `detect` and `forget` are.

        Args:
            task: kind of the task.
        """
        names = {field.name for field in fields(self)} - {"detect", "forget"}
        forgetting = {name for name in names if name.startswith("forget_")}
        forgets = self.forget and task != "walk"
        detecting = names - forgetting
        return (set() if forgets else forgetting) | (
            set() if self.detect else detecting
        )
