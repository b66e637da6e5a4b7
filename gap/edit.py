"""The edit test: take an effect out of the corrected model and predict without it.

A model that moves like the robot for the wrong reason fails it: whatever stood in for
the true effect does not go away with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bns.errors import UnknownNameError
from bns.gap import store
from bns.gap.decomposition import descent
from bns.gap.decomposition.problem import Problem
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.gap.records import Diagnosis
from bns.gap.where import horizons
from bns.gap.where.compared import Compared, terms
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Channel, Trial

HORIZON = 1.0  # [s]
RIGHT = 1.5  # of the floor: up to here an edited model counts as right


@dataclass(frozen=True, eq=False)
class Edited:
    """How well a recording without the effect is predicted.

    Attributes:
        removed: names of what was taken away.
        left: effects that stay, as text.
        losses: whitened loss per residual (1 = the floor) of the model `edited`, with
            the effect `kept`, and `nominal`.
        plain: root mean square over `horizon` of each, and of the floor, by channel.
        channels: of these.
        horizon: [s].
        sentence: in words.
    """

    removed: tuple[str, ...]
    left: tuple[str, ...]
    losses: Mapping[str, float]
    plain: Mapping[str, tuple[float, ...]]
    channels: tuple[Channel, ...]
    horizon: float
    sentence: str


def edit(
    found: Diagnosis,
    trials: Sequence[Trial],
    model: GapModel,
    *,
    remove: str,
    effect: str = "",
) -> Edited:
    """Predict a recording with an effect of a diagnosis taken away.

    Args:
        found: the diagnosis.
        trials: a recording in which the effect was not there.
        model: nominal model of the diagnosis.
        remove: name of a candidate or of an effect; "*" = all.
        effect: fitted effects to start from; "" = those that the verdict names.

    Raises:
        BnsError: the verdict names nothing, or the recording is not sound.
        UnknownNameError: the corrected model has no such effect.
    """
    fit = store.chosen(found, effect)
    gone = [n for n in fit.names if remove in ("*", n, n.partition("[")[0])]
    if not gone:
        raise UnknownNameError("effect of the corrected model", remove, fit.names)
    usable, _ = check.check(trials, model)
    pairs = list(zip(fit.names, fit.effects, strict=True))
    kept = tuple(store.parse(text, model) for _, text in pairs)
    left = tuple(store.parse(text, model) for name, text in pairs if name not in gone)
    sets: dict[str, tuple[Effect, ...]] = {"edited": left, "kept": kept, "nominal": ()}
    losses = errors(usable, model, sets)
    compared = Compared.diagnosed(found, usable, model)
    return Edited(
        tuple(gone),
        tuple(str(item) for item in left),
        losses,
        {name: _rms(compared, items) for name, items in sets.items()},
        tuple(model.features),
        HORIZON,
        _sentence(gone, left, losses),
    )


def errors(
    trials: Sequence[Trial], model: GapModel, sets: Mapping[str, Sequence[Effect]]
) -> dict[str, float]:
    """Loss per residual of sets of effects; 1 = what no row of the model explains.

    Args:
        trials: a checked recording.
        model: nominal model.
        sets: of effects, by name.
    """
    problem = Problem.of(trials, model)
    start = descent.nothing(problem)
    made = {}
    paths = model.simulate(problem.trials, list(sets.values()))
    for name, predicted in zip(sets, paths, strict=True):
        left = np.nan_to_num(problem.recorded - problem.features(predicted))
        linear = start.linear
        linear = linear.moved(linear.target - start.noise.innovations(left))
        rest = linear.rest(linear.solve((), slack=False))  # but for the nuisances
        made[name] = float(terms((rest / start.noise.sd)[problem.seen]).mean())
    return made


def _rms(compared: Compared, effects: Sequence[Effect]) -> tuple[float, ...]:
    squares = horizons.by_trial(compared, effects, HORIZON)
    return tuple(np.sqrt(np.nanmean(squares, axis=0)).tolist())


def _sentence(
    gone: Sequence[str], left: Sequence[Effect], losses: Mapping[str, float]
) -> str:
    what = " and ".join(gone)
    rest = "leaves the nominal model" if not left else "leaves the other effects"
    error = losses["edited"]
    if error <= RIGHT:
        said = "stays right"
    elif error < losses["kept"]:
        said = "is better than with it, but not right"
    else:
        said = "is no better than with it: the effect is still there, or is another one"
    return (
        f"Taking {what} away {rest}: the prediction {said} "
        f"({error:.2f} of the noise floor; with it {losses['kept']:.2f})."
    )
