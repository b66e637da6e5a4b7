"""Withheld-effect cases with light: recordings of robots that see, one effect hidden.

Robots drive by what they see, and at random, in the light world. The sensors of the
"real" robot differ a little from the nominal ones, the tracker is noisy, and how strong
the hidden effect is, is drawn relative to what the recording can show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bns import seeding
from bns.gap.bench import cases
from bns.gap.bench.cases import Answer, Case
from bns.gap.core import signatures
from bns.gap.core.aliases import ALIKE, likeness
from bns.gap.core.fit import Term
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves
from bns.gap.models.base import GapModel
from bns.gap.models.light.diagnosis import unhandled
from bns.gap.models.light.model import SightModel
from bns.gap.models.light.weighing import apart
from bns.gap.models.wheeled import WheeledModel
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.effects.sensors import SINGLE
from bns.worlds.light.world import LightWorld
from bns.worlds.trial import Trial

KINDS = ("single", "motion", "none", "off-library")
TRIALS, CYCLES = 3, 40  # recordings of a case, and commands of 0.4 s in each
SIZES = 0.5, 8.0  # of an effect over what is detected, drawn evenly in the logarithm
LEAST = 0.4  # size below which an effect counts as not excited, and is drawn again
TRIES = 100
NEAREST = 16  # candidates whose likelihood is compared with an effect's


class Wanderer:
    """A policy: towards or past the light, with a turn that changes at random.

    Args:
        rng: of the robots' habits.
        count: robots.
    """

    def __init__(self, rng: np.random.Generator, count: int):
        self.speed = rng.uniform(0.03, 0.1, (count, 1))
        self.turning = rng.uniform(-0.06, 0.06, (count, 1))
        held = rng.integers(4, 12)
        wander = rng.uniform(-0.05, 0.05, (count, CYCLES // held + 1))
        self.wander = np.repeat(wander, held, axis=1)

    def memory(self, n: int) -> np.ndarray:
        """How many commands each has given."""
        return np.zeros((n, 1))

    def act(
        self, readings: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wheel speeds from the virtual sensors, ``(n, 2)`` [m/s]."""
        at = int(memory[0, 0])
        turn = self.turning[:, 0] * (readings[:, 1] - readings[:, 0]) / 4095
        turn = turn + self.wander[:, at]
        told = self.speed + turn[:, None] * np.array([-1.0, 1.0])
        return np.clip(told, -0.14, 0.14), memory + 1


def imperfection(rng: np.random.Generator) -> list[Effect]:
    """How real sensors and lamps depart from the nominal ones; assumed."""
    made = [registry.make("light_dimmed", factor=float(rng.normal(1, 0.01)))]
    for sensor in SINGLE:
        bent, lost = float(rng.normal(0, 0.01)), abs(float(rng.normal(0, 0.01)))
        made.append(registry.make("sensor_misaligned", sensor=sensor, angle=bent))
        made.append(registry.make("sensor_dead", sensor=sensor, loss=lost))
    return made


def pose_sd(effects: Sequence[Effect]) -> tuple[float, float, float]:
    """Noise of the tracker among some effects [m, m, rad]."""
    noise = next(effect for effect in effects if effect.name == "tracker_noise")
    return (noise["position_sd"], noise["position_sd"], noise["heading_sd"])


def record(seed: int, effects: Sequence[Effect], *, singles: bool) -> tuple[Trial, ...]:
    """Drive the robots; the same habits and starts for the same seed.

    Args:
        seed: of habits, starts and the world.
        effects: what robot, light and tracker depart by, in any order.
        singles: as of `LightWorld`.
    """
    order = {"command": 0, "actuator": 1, "body": 2, "sensor": 3, "tracking": 4}
    world = LightWorld(
        singles=singles,
        supervisor={"at_lamp": "turn"},
        reality=sorted(effects, key=lambda effect: order[effect.stage]),
        name="real",
    )
    policy = Wanderer(seeding.generator(seed, "light case", "habits"), TRIALS)
    seeds = [seeding.integer(seed, "light case", n) for n in range(TRIALS)]
    trials = world.drive(policy, cycles=CYCLES, seeds=seeds)
    return tuple(trial.replace(conditions={}) for trial in trials)


def build(
    seed: int,
    kind: str,
    model: WheeledModel,
    *,
    singles: bool,
    off_library: Sequence[Effect] = (),
) -> Case:
    """Make a case.

    Args:
        seed: of everything in it.
        kind: one of `KINDS`; "motion" hides an effect on the wheels.
        model: nominal model of the robot's motion.
        singles: whether single sensors are recorded, else the virtual two.
        off_library: effects to draw from for "off-library"; outside the registry.
    """
    rng = seeding.generator(seed, "light case", kind)
    noise = cases.tracker(rng)[:1]
    reality = [*imperfection(rng), *cases.imperfection(rng), *noise]
    answer = Answer(kind, nominal=tuple(str(effect) for effect in reality))
    hidden: list[Effect] = []
    if kind in ("single", "motion"):
        plain = record(seed, reality, singles=singles)
        seen: GapModel = model
        if kind == "single":
            seen = SightModel(plain, pose_sd=pose_sd(noise))
            plain, _ = seen.check(plain)
        else:
            plain = tuple(unhandled(plain, model))
        answer, hidden = _hide(rng, plain, seen, answer)
    elif kind == "off-library":
        hidden = [off_library[int(rng.integers(len(off_library)))]]
        answer = replace(answer, effects=tuple(map(str, hidden)))
    trials = record(seed, [*reality, *hidden], singles=singles)
    return Case(trials, answer, tuple(reality), tuple(t.commands for t in trials))


def _hide(
    rng: np.random.Generator, plain: Sequence[Trial], model: GapModel, answer: Answer
) -> tuple[Answer, list[Effect]]:
    """An effect, drawn evenly over effects, as strong as drawn."""
    candidates = model.candidates()
    problem = Problem.of(plain, model, candidates=candidates)
    curves = signatures.trace(problem, candidates)
    seen = Null.of(problem, curves).seen
    for _ in range(TRIES):
        size = float(np.exp(rng.uniform(*np.log(SIZES))))
        term = _draw(rng, curves, size * seen)
        if term is None:
            continue
        (shown,) = problem.signatures([[term.effect()]])
        reached = float(np.linalg.norm(shown)) / seen
        if LEAST < reached < 3 * SIZES[1]:
            break
    made = replace(
        answer,
        names=(term.candidate.name,),
        effects=(str(term.effect()),),
        magnitudes=(term.magnitude,),
        sizes=(reached,),
        aliases=(_alike(problem, curves, term),),
        near=(_near(problem, curves, term),) if isinstance(model, SightModel) else (),
        detected=seen,
    )
    return made, [term.effect()]


def _alike(problem: Problem, curves: Curves, term: Term) -> tuple[str, ...]:
    """Candidates that the recording cannot tell from an effect, itself included."""
    (shown,) = problem.signatures([[term.effect()]])
    gaps, _ = signatures.nearest(curves, shown)
    near = {curves.candidates[c].name for c in np.flatnonzero(gaps < ALIKE**2)}
    near |= {other.name for other in likeness(problem, curves, term) if other.alike}
    return tuple(sorted(near | {term.candidate.name}))


def _near(
    problem: Problem, curves: Curves, term: Term
) -> tuple[tuple[str, float, float], ...]:
    """Candidates near an effect by the likelihood of readings: name, distance, angle.

    The signatures count a reading twice, as departure and as scatter, and are limited;
    they say who may be near, the likelihood how near. See `light_weighing.apart`.
    """
    (shown,) = problem.signatures([[term.effect()]])
    gaps, levels = signatures.nearest(curves, shown)
    mine = curves.candidates.index(term.candidate)
    order = [c for c in np.argsort(gaps) if c != mine and np.isfinite(gaps[c])]
    order = order[:NEAREST]
    starts = [
        Term.at(
            curves.candidates[c],
            int(curves.branch[levels[c]]),
            float(curves.magnitude[levels[c]]),
        )
        for c in order
    ]
    distances = apart(problem, term, starts)
    angles = {
        curves.candidates[c].name: signatures.angle(
            shown, curves.signature[levels[c]].astype(float)
        )
        for c in order
    }
    found = [(name, far, float(angles[name])) for name, far in distances.items()]
    return tuple(sorted(found, key=lambda item: item[1]))


def _draw(rng: np.random.Generator, curves: Curves, length: float) -> Term | None:
    """A candidate near the level whose signature has about a length, or None."""
    effects = sorted({item.effect for item in curves.candidates})
    effect = effects[int(rng.integers(len(effects)))]
    pool = [item for item in curves.candidates if item.effect == effect]
    item = pool[int(rng.integers(len(pool)))]
    branch = int(rng.integers(len(item.branches)))
    mine = np.flatnonzero(
        (curves.owner == curves.index(item.name)) & (curves.branch == branch)
    )
    if not len(mine):
        return None
    side = curves.magnitude[mine] > item.nominal
    if 0 < side.sum() < len(side):
        mine = mine[side == (rng.random() < 0.5)]
    lengths = signatures.strength(curves)[mine]
    if lengths.max() < 0.7 * length:
        return None  # not excited by these drives
    level = mine[np.abs(np.log(np.maximum(lengths, 1e-9) / length)).argmin()]
    magnitude = float(curves.magnitude[level])
    if not signatures.integer(item):
        magnitude += float(rng.uniform(-0.1, 0.1)) * (magnitude - item.nominal)
    term = Term.at(item, branch, float(np.clip(magnitude, item.low, item.high)))
    moved = tuple(value + float(rng.uniform(-0.3, 0.3)) for value in term.extras)
    return replace(term, extras=moved)
