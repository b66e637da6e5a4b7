"""What the standings compare: tasks, damages, priors and learners.

Each run is damaged once, at the same trial for all that have the same prior, and is
followed for the same number of trials from there on. Learners without a prior have
learned for as long as the dissertation lets BNS; with one they need less. What a prior
is, is the same for all that have it:

P0: none. P1: the exact undamaged robot. P2: the nominal model, while the robot differs
from it everywhere by a little (`bns.prior.mismatch`). PG: where feet are and what they
bear, without physics (`bns.learners.bns.nominal`), which is a learner's own.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from bns import presets
from bns.campaign.file import Member
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.prior import mismatch

PRIORS = {
    "P0": "no prior",
    "P1": "an exact model of the undamaged robot",
    "P2": "a nominal model of a robot that differs from it by a fixed gap",
    "PG": "the geometry and statics of the legs, no physics",
}
SETS = ("inside", "outside")
"""damages of the kinds that BNS was tuned on, and others"""


@dataclass(frozen=True, kw_only=True)
class Design:
    """A task of the standings.

    Attributes:
        preset: that it starts from.
        onset: of the damage, without a prior and with one.
        after: trials from the damage on.
        damages: set -> name -> effects.
        ceilings: farthest that is known to be possible on a damage [m].
        model: settings of the prior of those that think in a model.
        repertoire: settings of the prior of those that start from one.
        robot: whose gap P2 is; "" = P2 is not offered.
    """

    preset: str
    onset: tuple[int, int]
    after: int
    damages: Mapping[str, Mapping[str, str]]
    ceilings: Mapping[str, float] = field(default_factory=dict)
    model: Mapping[str, Any] = field(default_factory=dict)
    repertoire: Mapping[str, Any] = field(default_factory=dict)
    robot: str = ""


def _raised(number: int) -> str:
    return f"leg_raised:legs=type{number},blend=1"


DESIGNS = {
    "walk": Design(
        preset="hexapod-walk",
        onset=(100, 10),
        after=50,
        damages={
            "inside": {
                **{f"type{n}": _raised(n) for n in (0, 1, 3, 5, 2, 14)},
                "missing": "leg_missing:legs=1,loss=1",
                "weak": "joint_weak:joint=left_front_femur,factor=0.1",
            },
            "outside": {
                "loose-horn": "loose_horn:joint=left_middle_femur,angle=0.4",
                "slippery": "foot_slippery:legs=1,factor=0.1",
                "servo-offset": "servo_offset:servo=left_middle_femur,angle=0.35",
            },
        },
        ceilings={
            "none": 2.7088,
            "type0": 2.4423,
            "type1": 3.0412,
            "type2": 1.8494,
            "type3": 2.6491,
            "type5": 2.6233,
            "type14": 1.2454,
        },  # python -m bench hexapod-ceiling
        model={"world": "hexapod", "step": 0.008, "evaluations": 4000},
        repertoire={"repertoire": "phantomx-1"},
        robot="phantomx",
    ),
    "navigate": Design(
        preset="khepera-simple",
        onset=(30, 10),
        after=50,
        damages={
            "inside": {
                f"{side}-{lost}": f"wheel_gain:wheel={side},factor={1 - lost / 100:g}"
                for side in ("left", "right")
                for lost in (20, 50)
            },
            "outside": {
                "axle": "axle_length:factor=1.2",
                "latency": "command_latency:delay=0.3",
                "intermittent": "wheel_intermittent:wheel=left,every=5,speed=0",
            },
        },
        model={"world": "mujoco", "evaluations": 4000},
    ),
    "light": Design(
        preset="khepera-light-recover",
        onset=(20, 10),
        after=50,
        damages={
            "inside": {
                "slow-wheel": "wheel_gain:wheel=left,factor=0.5",
                "noisy": "sensor_noise:factor=2",
                "minimum": "sensor_stuck_min:sensor=left,blend=1",
                "maximum": "sensor_stuck_max:sensor=left,blend=1",
            },
            "outside": {"swapped": "sensor_swapped:blend=1"},
        },
        model={"world": "light", "evaluations": 4000},
    ),
}


@dataclass(frozen=True, kw_only=True)
class Rival:
    """A learner as it takes part.

    Attributes:
        learner: by name.
        priors: with which of `PRIORS`.
        presets: task -> preset instead of the design's, where BNS has its own.
        settings: changed, by dotted name.
        tasks: those that it knows.
        repertoire: whether its prior is a repertoire where the task has one.
    """

    learner: str
    priors: tuple[str, ...] = ("P0",)
    presets: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    tasks: tuple[str, ...] = tuple(DESIGNS)
    repertoire: bool = False


_SEEN = {"deploy": "seen"}
_OWN = {"walk": "hexapod-recover"}
_MODELS = ("P1", "P2")
_LISTS = ("walk", "navigate")
"""tasks in which controllers are lists of commands, to be replayed in a model"""
RIVALS = {
    "bns": Rival(learner="bns", presets=_OWN, settings=_SEEN),
    "hybrid": Rival(
        learner="bns",
        presets={"walk": "hexapod-hybrid"},
        settings=_SEEN | {"evolution.cells": 3},
        tasks=("walk", "navigate"),
    ),
    "nominal": Rival(
        learner="bns",
        priors=("PG",),
        presets={"walk": "hexapod-nominal"},
        settings=_SEEN,
        tasks=("walk",),
    ),
    "pets": Rival(learner="pets", presets=_OWN, settings=_SEEN, tasks=_LISTS),
    "static_snn": Rival(learner="static_snn"),
    "random": Rival(learner="random"),
    "cma": Rival(learner="cma", priors=("P0", "P1", "P2")),
    "ite": Rival(learner="ite", priors=("P0", "P1", "P2"), repertoire=True),
    "neat": Rival(
        learner="neat",
        priors=("P0", "P1"),
        settings=_SEEN | {"light.islands": 1, "light.renewed": 0},
        tasks=("light",),
    ),
    "safe_ite": Rival(learner="safe_ite", priors=("P1", "P2"), repertoire=True),
    "t_resilience": Rival(learner="t_resilience", priors=_MODELS),
    "transferability": Rival(learner="transferability", priors=_MODELS),
    "anytime": Rival(learner="anytime", priors=_MODELS, tasks=_LISTS),
    "self_modelling": Rival(learner="self_modelling", priors=_MODELS, tasks=_LISTS),
    "back_to_reality": Rival(learner="back_to_reality", priors=_MODELS, tasks=_LISTS),
    "rte": Rival(learner="rte", priors=("P0", "P1"), tasks=("navigate",)),
    "domain_randomised": Rival(
        learner="domain_randomised", priors=("P1",), tasks=("light",)
    ),
    "rma": Rival(learner="rma", priors=("P1",), tasks=("light",)),
}
"""those that are there; any other learner takes part by its own name"""


@dataclass(frozen=True)
class Entry:
    """One cell of the standings.

    Attributes:
        task, rival, prior, kind, damage: what it is; `kind` is of `SETS`.
        member: its configuration.
    """

    task: str
    rival: str
    prior: str
    kind: str
    damage: str
    member: Member


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A part of the standings.

    Attributes:
        tasks, rivals, priors, kinds, damages: by name; none of them = all.
        runs: of each cell.
    """

    tasks: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    priors: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    damages: tuple[str, ...] = ()
    runs: int = 30


def rival(name: str) -> Rival:
    """A rival by name; a learner that has no entry takes part as it is.

    Raises:
        UnknownNameError: neither.
    """
    from bns.learners import registry

    if name in RIVALS:
        return RIVALS[name]
    if name not in registry.names():
        raise UnknownNameError("rival", name, {*RIVALS, *registry.names()})
    return Rival(learner=name, priors=("P0", "P1", "P2"))


def entries(wanted: Wanted) -> list[Entry]:
    """The cells of a part of the standings.

    Raises:
        UnknownNameError: no such task, rival, prior, set or damage.
        BnsError: nothing is left, or no runs are wanted.
    """
    if wanted.runs < 1:
        raise BnsError(f"runs = {wanted.runs} is nothing to run: give 1 or more.")
    _known("task", wanted.tasks, DESIGNS)
    _known("prior", wanted.priors, PRIORS)
    _known("set of damages", wanted.kinds, SETS)
    every = {name for d in DESIGNS.values() for k in d.damages.values() for name in k}
    _known("damage", wanted.damages, every)
    found = list(_entries(wanted))
    if not found:
        raise BnsError(
            "Nothing is left of the standings: take a damage of the task and the set, "
            "and a prior that the rivals have (`bns standings plan` lists them)."
        )
    return found


def _known(kind: str, given: Sequence[str], known: Any) -> None:
    for name in given:
        if name not in known:
            raise UnknownNameError(kind, name, known)


def _entries(wanted: Wanted) -> Iterator[Entry]:
    for task in wanted.tasks or DESIGNS:
        design = DESIGNS[task]
        for name in wanted.rivals or RIVALS:
            side = rival(name)
            if task not in side.tasks:
                continue
            for prior in [p for p in side.priors if p in (wanted.priors or PRIORS)]:
                if prior == "P2" and not design.robot:
                    continue
                for kind in wanted.kinds or SETS:
                    for damage, text in design.damages[kind].items():
                        if not wanted.damages or damage in wanted.damages:
                            made = config(task, side, prior, text)
                            label = f"{task} {kind} {damage}: {name} {prior}"
                            member = Member(label, made)
                            yield Entry(task, name, prior, kind, damage, member)


def config(task: str, side: Rival, prior: str, damage: str) -> RunConfig:
    """The configuration of a cell.

    Args:
        task: key of `DESIGNS`.
        side: who learns.
        prior: key of `PRIORS`.
        damage: effects as text.
    """
    design = DESIGNS[task]
    base = presets.load(side.presets.get(task, design.preset))
    if side.learner != "bns":
        base = with_learner(base, side.learner)
    onset = design.onset[prior != "P0"]
    reality = mismatch.reality(design.robot) if prior == "P2" else ()
    world = replace(base.world, damage=(f"{damage}@{onset}",), reality=reality)
    base = replace(base, preset="", trials=onset + design.after, world=world)
    known = design.repertoire if side.repertoire else {}
    told = {f"prior.{n}": v for n, v in (known or design.model).items()}
    return base.with_({**side.settings, **(told if prior in _MODELS else {})})
