"""The configuration of a run: one frozen tree, from TOML or the command line.

Device units appear here, at the edge, where the dissertation gives them (Khepera
speed units, 144.01 to the mm/s, firmware < 3); everything inside is SI.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from bns.experiment.config_light import LightConfig
from bns.experiment.config_walk import WalkConfig
from bns.experiment.config_watch import WatchConfig

Selection = Literal["tournament", "best", "roulette", "random"]
Crossover = Literal["single-point", "n-point", "uniform", "sbx"]
Mutation = Literal["uniform-range", "bounded-uniform", "gaussian"]
RealChoice = Literal[
    "tournament", "best", "random", "best-worst-random", "disagreement"
]


@dataclass(frozen=True, kw_only=True)
class TaskConfig:
    """What the robot has to do, and how it is scored."""

    name: str = "simple"
    """simple: A,B,C,D,A; infinity: A,B,E,D,C,E,A; light: drive to a lamp; walk: get
    far on legs; a file in bns/tasks adds one. What follows is of navigation"""
    corner_x: float = 0.30
    """objectives A-D at (+-corner_x, +-corner_y) from the centre E [m] (silent)"""
    corner_y: float = 0.30
    """see corner_x [m]"""
    radius: float = 0.09
    """an objective is reached within this distance [m] (thesis, Algorithm 5)"""
    penalty: float = 10000.0
    """cost per objective not reached (thesis, Algorithm 5)"""
    squared: bool = False
    """sum squared distances [cm2] (the prose) or distances [cm] (Algorithm 5)"""
    command_cost: float = 5.0
    """cost per command used; the prose asks for few commands [cm]"""
    charge_unused: bool = True
    """charge the distance to the open objective for commands not used, too; the
    printed form (False) rewards giving up"""
    start_yaw: float = 0.0
    """heading at the start [deg], counter-clockwise from the board's x axis (silent)"""


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """Open-loop controllers: variable-length lists of (left, right, duration)."""

    max_commands: int = 36
    """longest list"""
    initial_min: int = 4
    """shortest list in a random population"""
    initial_max: int = 24
    """longest list in a random population"""
    speed_low: float = 5000.0
    """smallest speed gene [speed units]; below `dead_band` it means stop"""
    speed_high: float = 17500.0
    """largest speed gene [speed units]"""
    dead_band: float = 8000.0
    """speeds of a smaller magnitude count as a stop [speed units]"""
    duration_low: float = 0.3
    """shortest command [s]"""
    duration_high: float = 3.1
    """longest command [s]"""
    fixed_length: bool = False
    """all lists of `max_commands` (a reading of the thesis that never solved)"""


@dataclass(frozen=True, kw_only=True)
class EvolutionConfig:
    """The evolutionary algorithm that runs inside the SNN."""

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
    the SNN, bns/evolution/elites.py); 0 = children replace their parents"""


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
    """adaptations from bns/adaptations by name: population_reset_every:trials=10"""
    mutation_rate_after: float = 0.0
    """mutation rate after damage; 0 = unchanged"""
    mutation_magnitude_after: float = 0.0
    """mutation magnitude after damage [speed units]; 0 = unchanged"""


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
    """which controller is tried in the world"""
    choose_tournament: float = 0.1
    """tournament for that choice, as a share of the population"""
    deploy: Literal["population", "seen"] = "population"
    """what a user would run if trials ended now. population: the best of the population
    inside the SNN; seen (own): the best one seen to work since the robot last changed,
    tried again in doubt (bns/learners/bns/deployed.py)"""
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
    """torch.compile the learner's inner loops: auto = where a compiler exists and
    the run is long enough to pay"""
    device: str = "cpu"
    """torch device of the learner"""
    threads: int = 2
    """threads of the learner and of the physics"""

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
