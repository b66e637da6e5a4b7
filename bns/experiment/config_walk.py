"""Settings of walking, the section `walk` of a configuration."""

from dataclasses import dataclass
from typing import Literal


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
    mutation_magnitude: float = 20.0
    """standard deviation of a goal's mutation [ticks of 300/1023 deg] (table 7.2,
    unit silent)"""
    repeat: float = 0.0
    """chance that a command of a child is copied to another place, and that its
    commands go round from some place on (own; bns/evolution/repetition.py)"""
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
    learning_rate: float = 0.002
    """of Adam (batch > 0)"""
    adequate: float = 0.70
    """a gait is adequate (solved) from this distance on [m]: what the tripod gait by
    hand covers in eleven commands (models/phantomx/gait.py, `hexapod-tripod`)"""
    upright: bool = False
    """an adequate gait may not fall (belly on the floor) either"""
