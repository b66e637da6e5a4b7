"""Rivals that evolve controllers in a model: whether they do what their originals do.

Anytime learning, back to reality and self-modelling are to find what is wrong with the
robot where it is a number of their model, and to fail where it is not; the
transferability approach is to differ less from its model than what the model alone
likes best; T-Resilience is to recover. Compared are these facts, not the originals'
metres.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from bench.result import Result, bench
from bench.rivals import batches
from bns import presets
from bns.experiment.batch import Batch
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.prior import mismatch

SLOW, WIDE = "wheel_gain:wheel=left,factor=0.8", "axle_length:factor=1.2"
FOUND, TESTS = 0.03, 10
RUNS = 9
"""of learners that look for numbers: one in seven ends in another valley, of which the
median of three runs says too little"""
EACH = {"settings.first": 100, "settings.each": 150, "prior.evaluations": 2000}
"""evaluations of the benches on wheels; those of the standings are spread thinner"""


def _config(preset: str, learner: str, runs: int, **told: Any) -> RunConfig:
    base = replace(presets.load(preset), replicates=runs, threads=1)
    legged = preset.startswith("hexapod")
    model = {"prior.world": "hexapod", "prior.step": 0.008}
    model = model if legged else {"prior.world": "mujoco"}
    return with_learner(base, learner).with_({**model, **told})


def _numbers(batch: Batch, trials: int) -> tuple[np.ndarray, np.ndarray]:
    """What is wrong by the best guess of each run, ``(R, T, P)``, and its misses."""
    numbers, misses = [], []
    for trial in range(trials):
        step, _ = batch.advance(trial)
        misses.append(step.columns["model_miss"])
        numbers.append([batch.learner.best_guess(m) for m in batch.learner.memories])
    return np.array(numbers).swapaxes(0, 1), np.array(misses).T


@bench(
    "error of the wheel's gain that anytime learning finds in ten trials, median",
    bar="<= 0.03; with a wider axle, which its model does not know, it fits half as "
    "well at best",
)
def faithful_anytime(quick: bool) -> Result:
    """Left wheel 20 % slower, then an axle 20 % wider; `RUNS` each; quick: one."""
    return _found("anytime", quick=quick)


@bench(
    "error of the wheel's gain that back to reality finds in ten trials, median",
    bar="<= 0.03; with a wider axle it fits half as well at best",
)
def faithful_back_to_reality(quick: bool) -> Result:
    """As `faithful_anytime`, from what was achieved alone."""
    return _found("back_to_reality", quick=quick)


def _found(learner: str, *, quick: bool) -> Result:
    runs, details = 1 if quick else RUNS, {}
    for damage in (SLOW, WIDE):
        told = {**EACH, "world.damage": [damage]}
        batch = batches.batch(_config("khepera-simple", learner, runs, **told))
        numbers, misses = _numbers(batch, TESTS + 1)
        details[damage] = {
            "numbers": numbers[:, -1].round(4).tolist(),
            "miss by trial": np.median(misses[:, 1:], 0).round(5).tolist(),
            "last miss": float(np.median(misses[:, -1])),
        }
    off = np.abs(np.array(details[SLOW]["numbers"]) - [0.8, 1.0]).max(1)
    inside, outside = (details[name]["last miss"] for name in (SLOW, WIDE))
    holds = np.median(off) <= FOUND and outside >= 2 * inside
    return Result(
        figure=float(np.median(off)),
        unit="1",
        holds=None if quick else bool(holds),
        n=runs,
        details=details,
    )


LEGS, ROUNDS = (1, 3, 6), 16


@bench(
    "legs raised that self-modelling names within 16 tests, share",
    bar="1; models miss less than those whose tests are any controllers",
)
def faithful_self_modelling(quick: bool) -> Result:
    """Legs 1, 3 and 6, one at a time, `ROUNDS` tests each; quick: leg 1."""
    legs, details = LEGS[: 1 if quick else None], {}
    for way, candidates in (("disputed", 4), ("any", 1)):
        named, off = [], []
        for leg in legs:
            told = {
                "world.damage": [f"leg_raised:legs={leg},blend=1"],
                "settings.candidates": candidates,
                "settings.first": 30,
                "settings.rounds": ROUNDS + 1,
            }
            batch = batches.batch(_config("hexapod-walk", "self_modelling", 1, **told))
            numbers, _ = _numbers(batch, ROUNDS + 1)
            truth = np.arange(1, 7) == leg
            named.append(bool(numbers[0, -1].argmax() == leg - 1))
            off.append(float(np.abs(numbers[0, -1] - truth).mean()))
        details[way] = {"named": named, "error": np.round(off, 4).tolist()}
    share = float(np.mean(details["disputed"]["named"]))
    errors = {way: np.mean(row["error"]) for way, row in details.items()}
    return Result(
        figure=share,
        unit="1",
        holds=None if quick else share == 1 and errors["disputed"] < errors["any"],
        n=len(legs),
        details=details,
    )


@bench(
    "disparity of what the transferability approach chooses, as a share of the model's "
    "best's, in the world of the prior P2",
    bar="< 1 (median of three runs, after ten tests)",
)
def faithful_transferability(quick: bool) -> Result:
    """Walking, 12 trials, 900 evaluations; quick: one run."""
    runs = 1 if quick else 3
    told = {"settings.first": 400, "world.reality": mismatch.reality("phantomx")}
    config = _config("hexapod-walk", "transferability", runs, **told)
    batch = batches.batch(config)
    for trial in range(12):
        batch.advance(trial)
    learner, rows = batch.learner, []
    for memory in learner.memories:
        both = [learner.likeliest(memory, np.arange(len(memory.worth)))]
        both.append(int(memory.worth.argmax()))
        tried = learner.controllers(memory.genes[both])
        seen = batch.task.execute(batch.worlds[0], tried, trial=12, seeds=[0, 1])
        differ = [
            float(np.linalg.norm(learner.does([trial])[0] - memory.done[row]))
            for trial, row in zip(seen, both, strict=True)
        ]
        worth = batch.task.worth(seen).round(3).tolist()
        rows.append({"disparity": differ, "worth [m]": worth})
    shares = [row["disparity"][0] / row["disparity"][1] for row in rows]
    figure = float(np.median(shares))
    return Result(
        figure=figure,
        unit="x",
        holds=None if quick else figure < 1,
        n=runs,
        details={"chosen, model's best": rows},
    )


ONSET = 5


@bench(
    "what T-Resilience gets to after 25 tests, over what the same robot does unadapted",
    bar=">= 2, and 0.7 of intact (medians of a missing leg, a raised one and a pair)",
)
def faithful_t_resilience(quick: bool) -> Result:
    """Walking, the legs from trial `ONSET` on; quick: one leg, fewer tests."""
    damages = ("leg_raised:legs=1,blend=1", "leg_missing:legs=5,loss=1",
               "leg_raised:legs=1,4,blend=1")  # fmt: skip
    rows = {}
    for damage in damages[: 1 if quick else None]:
        told = {"world.damage": [f"{damage}@{ONSET}"]}
        batch = batches.batch(_config("hexapod-walk", "t_resilience", 1, **told))
        steps = [
            batch.advance(trial)[0].columns
            for trial in range(ONSET + (8 if quick else 30))
        ]
        ways = np.array([np.sqrt(-row["fitness_best"][0]) / 100 for row in steps])
        before, after = ways[ONSET - 1], ways[ONSET]
        rows[damage] = {"intact": before, "unadapted": after, "adapted": ways[-1]}
    gain = float(np.median([r["adapted"] / r["unadapted"] for r in rows.values()]))
    share = float(np.median([r["adapted"] / r["intact"] for r in rows.values()]))
    return Result(
        figure=gain,
        unit="x",
        holds=None if quick else gain >= 2 and share >= 0.7,
        n=len(rows),
        details={"share of intact": round(share, 3), "m": rows},
    )
