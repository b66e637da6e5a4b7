"""Settings of light following, the section `light` of a configuration."""

from dataclasses import dataclass
from typing import Literal

Topology = Literal["ring", "random"]
Migrant = Literal["best", "tournament", "random"]
Replaced = Literal["random", "worst"]


@dataclass(frozen=True, kw_only=True)
class LightConfig:
    """Closed-loop light following: lamp, task, controllers, adaptations B1 to B4."""

    lamps: tuple[str, ...] = ("x=0,y=0",)
    """lamps by the fields of `bns.worlds.light.field.Lamp`; the first is the goal"""
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
