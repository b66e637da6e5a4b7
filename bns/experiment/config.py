"""The configuration of a run: one frozen tree, from TOML or the command line.

Device units appear here, at the edge, where the dissertation gives them (Khepera
speed units, 144.01 to the mm/s, firmware < 3); everything inside is SI.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from bns.experiment.task_settings import (
    ControllerConfig,
    LightConfig,
    TaskConfig,
    WalkConfig,
)
from bns.learners.bns.config import (
    AdaptationConfig,
    EvolutionConfig,
    SnnConfig,
    WatchConfig,
)

RealChoice = Literal[
    "tournament", "best", "random", "best-worst-random", "disagreement"
]


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """Where trials happen."""

    name: str = "mujoco"
    """world, see `bns worlds`"""
    robot: str = "khepera3"
    """robot model, see `bns robots`"""
    damage: tuple[str, ...] = ()
    """effects with onset, hidden from the learner; see `bns effects`:
    wheel_gain:wheel=left,factor=0.8@30"""
    reality: tuple[str, ...] = ()
    """effects that always hold (an imperfect reality)"""
    sample_dt: float = 0.1
    """time between two tracker samples [s]; command ends are sampled as well"""


@dataclass(frozen=True, kw_only=True)
class PriorConfig:
    """A model world for learners that think in one, counted and limited."""

    world: str = ""
    """world, see `bns worlds`; empty = no model"""
    reality: tuple[str, ...] = ()
    """effects that hold in the model: what it gets wrong, or right, about the robot"""
    evaluations: int = 4000
    """executions in the model that a run may spend"""
    step: float = 0.0
    """physics step of the model, where it is a hexapod's [s]; 0 = as the world's"""
    repertoire: str = ""
    """controllers made in a model beforehand, see `bns repertoire list`, or PATH.npz;
    empty = none"""


@dataclass(frozen=True, kw_only=True)
class LearnerSettings:
    """The section `settings`: a learner's own; bns has its own sections instead."""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {}
    """smallest and largest value allowed of each number, and its unit"""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """A batch of replicates of one experiment."""

    preset: str = ""
    """name of the preset this came from"""
    learner: str = "bns"
    """who learns; a file in bns/learners adds one"""
    task: TaskConfig = field(default_factory=TaskConfig)
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    evolution: EvolutionConfig = field(default_factory=EvolutionConfig)
    snn: SnnConfig = field(default_factory=SnnConfig)
    adaptation: AdaptationConfig = field(default_factory=AdaptationConfig)
    world: WorldConfig = field(default_factory=WorldConfig)
    light: LightConfig = field(default_factory=LightConfig)
    walk: WalkConfig = field(default_factory=WalkConfig)
    watch: WatchConfig = field(default_factory=WatchConfig)
    prior: PriorConfig = field(default_factory=PriorConfig)
    settings: LearnerSettings = field(default_factory=LearnerSettings)
    choose: RealChoice = "best"
    """controller tried in the world"""
    choose_tournament: float = 0.1
    """tournament for that choice, as a share of the population"""
    deploy: Literal["population", "seen"] = "population"
    """what a user would run now: the best in the SNN, or the best seen to work since
    the robot last changed (own)"""
    evolve_from: int = 1
    """trials with random controllers before evolution starts"""
    trials: int = 100
    """trials in the world, per run"""
    replicates: int = 30
    """runs in the batch"""
    record_replicates: int = 3
    """replicates of which all samples are kept, for pictures and datasets"""
    seed: int = 0
    """master seed"""
    compiled: Literal["auto", "yes", "no"] = "auto"
    """torch.compile the learner's inner loops; auto = where it pays"""
    device: str = "cpu"
    """torch device of the learner"""
    threads: int = 2
    """threads of learner and physics"""

    def with_(self, changes: Mapping[str, Any]) -> "RunConfig":
        """This configuration with some settings changed, checked as a file's are.

        Args:
            changes: values by dotted name, as in ``{"snn.epochs": 50}``.

        Raises:
            UnknownNameError: a name that no setting has.
            BnsError: a value that is not allowed.
        """
        from bns.experiment.loading import from_mapping, nested

        return from_mapping(nested(changes), self)
