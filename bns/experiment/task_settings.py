"""Settings of tasks: the sections `task`, `controller`, `light` and `walk`.

`light` and `walk` have what the learner `bns` does on these tasks, too. Speeds are in
Khepera speed units, as the dissertation gives them: a command of 17500 asks for 0.1215
m/s with a firmware older than 3.0 (Khepera III manual 2.2, p. 14: 144.01 units to the
mm/s).
"""

from dataclasses import dataclass
from typing import Literal

SPEED_UNITS_PER_METRE_PER_SECOND = 144.01e3  # [units / (m/s)], manual 2.2, p. 14


def metres_per_second(speed_units: float) -> float:
    """A speed in Khepera speed units as m/s."""
    return speed_units / SPEED_UNITS_PER_METRE_PER_SECOND


Topology = Literal["ring", "random"]
Migrant = Literal["best", "tournament", "random"]
Replaced = Literal["random", "worst"]


@dataclass(frozen=True, kw_only=True)
class TaskConfig:
    """What the robot has to do, and how it is scored."""

    name: str = "simple"
    """simple: A,B,C,D,A; infinity: A,B,E,D,C,E,A; light: drive to a lamp; walk: get
    far on legs; other packages add theirs. What follows is of navigation"""
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
class LightConfig:
    """Closed-loop light following: lamp, task, controllers, adaptations B1 to B4."""

    lamps: tuple[str, ...] = ("x=0,y=0",)
    """lamps by the fields of `bns.worlds.light.law.Lamp`; the first is the goal"""
    ambient: float = 0.02
    """light that is everywhere [W/m2]"""
    goal: float = 0.40
    """radius at which the robot is to stay, r_g of equation 5.2 [m] (silent)"""
    safety: float = 0.15
    """nearer to a lamp than this the robot is stopped [m] (silent)"""
    at_lamp: Literal["stop", "turn"] = "stop"
    """a robot at the safety boundary stays, or is turned away and goes on"""
    charge_stopped: Literal["start", "stand", "far"] = "start"
    """a stopped robot's lost cycles cost as if it were back at its start, or as where
    it stands; the latter (the printed sum) rewards running into the boundary, and so
    does the former from near starts; far: as much as its whole way to the lamp"""
    start_nearest: float = 0.5
    """simulated trials start no nearer to the lamp than this [m]; as in the world"""
    starts: int = 10
    """random starts a controller is judged from inside the SNNs (eq 5.2)"""
    cycles: int = 100
    """command cycles of a trial (5.2.2)"""
    cycle: float = 0.4
    """duration of each [s] (5.2.2)"""
    circle_cycles: int = 50
    """last cycles in which a robot has to circle the lamp to have solved the task"""
    circle_within: float = 0.15
    """mean distance from the goal radius allowed in these cycles [m]"""
    circle_sweep: float = 180.0
    """how far the robot has to get round the lamp in these cycles [deg]"""
    readings: Literal["brightness", "balanced"] = "brightness"
    """controllers see 0 in the dark to 1 in full light, or -1 to 1 (silent)"""
    recurrent: bool = True
    """the outputs are fed back as inputs of the next cycle (table 5.1)"""
    hidden: int = 5
    """hidden neurons of a controller (table 5.1)"""
    weights: float = 5.0
    """random weights lie between - and + this (table 5.1)"""
    weight_limit: float = 20.0
    """weights stay between - and + this (silent); SBX spreads them without end"""
    mutation_magnitude: float = 0.05
    """standard deviation of a weight's mutation (table 5.1); the rate is
    evolution.mutation_rate"""
    mirror: bool = False
    """every pattern is learned mirrored, too (data augmentation, B4)"""
    bearing: Literal["sine", "angle"] = "sine"
    """the sensor SNN takes sine and cosine of the light's bearing, or the angle"""
    noise: float = 0.0
    """noise inside the SNNs, as a share of what they err by on their patterns; 0 =
    none, 1 = a noise-aware simulator (silent)"""
    batch: int = 0
    """patterns trained on after a trial, drawn from all there are; 0 = all"""
    islands: int = 1
    """populations apart from each other that share the population's size"""
    migration_every: int = 10
    """trials from one migration to the next (table 5.4)"""
    migrants: int = 1
    """individuals that each island sends (table 5.4)"""
    topology: Topology = "ring"
    """migrants go to the next island, or all islands to others at random"""
    migrant: Migrant = "best"
    """which individuals go: the best, winners of tournaments, or any"""
    replaced: Replaced = "random"
    """which individuals they take the place of"""
    renewed: int = 0
    """islands that start anew before each trial, those whose best is the worst (own)"""
    reset_every: int = 0
    """fresh random population every so many trials (B2); 0 = never"""
    reset_elitists: int = 5
    """best individuals that survive such a reset (table 5.9)"""


@dataclass(frozen=True, kw_only=True)
class WalkConfig:
    """Open-loop walking: lists of servo goals that carry the robot as far as they can.

    The mutation's magnitude is here, its rate is evolution.mutation_rate;
    adaptation.mutation_magnitude_after counts in ticks for this learner.
    """

    commands: int = 11
    """commands of a controller (7.2.4)"""
    limit: float = 2.0
    """longest time of a command, until servos and body rest [s] (silent)"""
    initial: float = 0.4
    """goals of random controllers lie within this of half-way [rad] (silent)"""
    reach: float = 3.0
    """no goal is farther than this from half-way [rad]; the servos' own limits hold
    besides"""
    coxa_reach: float = 0.0
    """the same of the servos that swing a leg, once it has grown (own); smaller ones
    than reach = as reach"""
    grow_from: int = 0
    """trial from which their reach grows, evenly, from reach to coxa_reach"""
    grow_until: int = 0
    """trial by which it has"""
    nominal: bool = False
    """the networks learn what is missing from a model of feet that stay where they
    stand (own; bns/learners/bns/nominal.py)"""
    lost_legs: bool = False
    """which legs bear nothing is told from the motion, and the model goes on without
    them (own; bns/learners/bns/bearing.py); needs nominal and watch.forget"""
    mutation_magnitude: float = 20.0
    """standard deviation of a goal's mutation [ticks of 300/1023 deg] (table 7.2,
    unit silent)"""
    repeat: float = 0.0
    """chance that a command of a child is copied to another place, and that its
    commands go round from some place on (own; bns/evolution/goals.py)"""
    repeat_after: float = 0.0
    """the same once damage is known; 0 = unchanged"""
    fitness: Literal["repaired", "printed"] = "repaired"
    """printed: equations 7.1 and 7.2, which reward agreement on standing still;
    repaired: distance less `doubt` times the spread of the members' end points"""
    doubt: float = 1.0
    """metres of distance that a metre of spread costs (fitness = repaired)"""
    activation: Literal["relu", "sigmoid"] = "relu"
    """of the hidden neurons (silent)"""
    batch: int = 128
    """patterns of a training step, drawn at random (Adam); 0 = all of them (Rprop).
    snn.epochs counts these steps"""
    passes: float = 0.0
    """times that a pattern is drawn in a training, on average, so that few patterns are
    learned in few steps (own; batch > 0); 0 = snn.epochs steps, however many there
    are"""
    pull: float = 0.0
    """farthest from what the networks say that a pattern counts in a training, in their
    scaled outputs of 0.05 m and 0.25 rad, so that a tumble does not undo what they know
    (own; batch > 0); 0 = however far it is"""
    anchors: float = 0.0
    """random motions in which the model is right, for each pattern of a training, so
    that networks stay near the model where nothing was seen (own; needs nominal)"""
    learning_rate: float = 0.002
    """of Adam (batch > 0)"""
    adequate: float = 0.70
    """a gait is adequate (solved) from this distance on [m]: what the tripod gait by
    hand covers in eleven commands (models/phantomx/gait.py, `hexapod-tripod`)"""
    upright: bool = False
    """an adequate gait may not fall (belly on the floor) either"""
