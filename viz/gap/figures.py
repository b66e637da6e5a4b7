"""Figures of a diagnosis: how far the gap closes, where it is, and the motion.

A `View` holds what they show: recorded, nominal and corrected motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.gap import store
from bns.gap.models.base import GapModel
from bns.gap.recordings import check, trial_conditions
from bns.gap.records import Diagnosis, Residuals
from bns.gap.where.compared import Compared, terms
from bns.gap.where.horizons import residuals
from bns.viz import style
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 6
"""features that a figure has room for"""


@dataclass(frozen=True, eq=False)
class View:
    """A recording beside its predictions.

    Attributes:
        problem: the recording beside the nominal model.
        effects: of the corrected model; empty where nothing explains the gap.
        nominal, corrected: predicted samples of each trial, ``(T, n_channels)``.
        left: features of recorded minus corrected motion of each trial, ``(W, C)``.
        shown: which trial is drawn: of those that count, the one with the largest gap.
        after: residuals of the corrected model by horizon.
    """

    problem: Compared
    effects: tuple[Effect, ...]
    nominal: tuple[np.ndarray, ...]
    corrected: tuple[np.ndarray, ...]
    left: tuple[np.ndarray, ...]
    shown: int
    after: Residuals

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The trials that were used."""
        return self.problem.trials

    def gap(self, trial: int) -> np.ndarray:
        """Features of recorded minus nominal motion of a trial, ``(W, C)``."""
        return self.problem.recorded[trial] - self.problem.nominal[trial]

    def scatter(self, trial: int) -> np.ndarray:
        """Standard deviation of the floor in each window of a trial, ``(W, C)``."""
        return self.problem.scatter[trial]

    def largest(self, most: int = MOST) -> list[int]:
        """The features with the largest gaps, by the floor; all where there are few.

        Returns:
            Their numbers, in order.
        """
        sizes = [gap**2 for gap in self.problem.gap]
        size = np.nanmean(np.concatenate(sizes), axis=0)
        return sorted(np.argsort(-size, kind="stable")[:most].tolist())

    def energy(self, trial: int) -> np.ndarray:
        """Loss of the nominal model in each window of a trial; 1 = the floor."""
        return terms(self.problem.gap[trial]).mean(axis=1)


def view(found: Diagnosis, trials: Sequence[Trial], model: GapModel) -> View:
    """Simulate what a diagnosis found.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model.
    """
    usable, _ = check.check(trials, model)
    effects = tuple(store.parse(text, model) for text in corrections(found))
    problem = Compared.diagnosed(found, usable, model)
    nominal, corrected = model.simulate(usable, [(), effects])
    left = tuple(
        recorded - model.compare(trial, made, windows)
        for recorded, trial, made, windows in zip(
            problem.recorded, usable, corrected, problem.windows, strict=True
        )
    )
    apart = found.decomposition.get("left_out", ())
    losses = [
        -1.0 if number in apart else terms(gap).mean()
        for number, gap in zip(
            trial_conditions.numbers(usable), problem.gap, strict=True
        )
    ]
    return View(
        problem,
        effects,
        tuple(nominal),
        tuple(corrected),
        left,
        int(np.argmax(losses)),
        residuals(problem, effects, seed=found.seed),
    )


def corrections(found: Diagnosis) -> tuple[str, ...]:
    """Effects of the model that is drawn as corrected.

    Where nothing of the library explains the gap it is the best attempt.
    """
    if found.verdict.kind == "none of the library":
        return tuple(found.signatures.get("best", ()))
    return tuple(found.best.effects)


RECORDED, NOMINAL, CORRECTED = style.BLACK, style.VERMILION, style.BLUE
LISTED = 7  # single effects in the figure of what closes the gap
FEW = 3  # effects from which on a bar's label counts them
ROUND = {"m": ("mm", 1e3), "rad": ("mrad", 1e3)}
"""units in which small residuals are read"""

SIDE = 4  # features that fit side by side


def shares(found: Diagnosis) -> "Figure":
    """What the gap is made of: the share that each explanation closes, alone and when
    it is added last, and what is left."""
    parts = found.decomposition["parts"]
    names = [part["name"] for part in parts] + ["what is left"]
    last = [100 * part["last"] for part in parts]
    alone = [100 * part["alone"] for part in parts]
    left = 100 * found.decomposition["left"]
    place = np.arange(len(parts))
    with style.plotting() as figure_class:
        figure = figure_class(
            figsize=(7.0, 1.2 + 0.42 * len(names)), layout="constrained"
        )
        axes = figure.subplots()
        axes.barh(place - 0.18, alone, height=0.34, color=style.GREY, label="alone")
        axes.barh(place + 0.18, last, height=0.34, color=CORRECTED, label="added last")
        axes.barh(len(parts), left, height=0.34, color=NOMINAL, label="left")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(left=min(0.0, *last, *alone))
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("share of the gap that goes, or is left [%]")
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def closing(found: Diagnosis) -> "Figure":
    """How far the gap shrinks: nominal, each effect alone, the chosen set, all."""
    closed = found.closed
    singles = sorted(closed["singles"].items(), key=lambda row: row[1])[:LISTED]
    rows = [("nominal model", closed["before"], NOMINAL)]
    names = found.best.names if found.verdict.named else ()
    named = (
        " + ".join(names) if len(names) < FEW else f"all {len(names)} that are named"
    )
    rows += [(f"with {n}", value, style.GREY) for n, value in reversed(singles)]
    rows.append(("with all explanations at once", closed["ceiling"], style.ORANGE))
    if names:
        rows = [row for row in rows if row[0] != f"with {named}"]
        rows.append((f"with {named}", closed["after"], CORRECTED))
    rows = [(name, max(value, 1e-3), colour) for name, value, colour in rows]
    with style.plotting() as figure_class:
        figure = figure_class(
            figsize=(7.0, 0.9 + 0.28 * len(rows)), layout="constrained"
        )
        axes = figure.subplots()
        labels, values, colours = zip(*rows, strict=True)
        axes.scatter(values, range(len(rows)), color=colours, s=44, zorder=3)
        axes.set_yticks(range(len(rows)), labels)
        axes.axvline(closed["floor"], color=style.GREEN, ls="--", lw=1.4)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        style.logarithmic(axes.xaxis, axes.set_xscale)
        axes.set_xlim(0.7 * min(closed["floor"], *values), 1.4 * max(values))
        axes.text(
            closed["floor"],
            1.01,
            "least that is left",
            color=style.GREEN,
            ha="center",
            va="bottom",
            transform=axes.get_xaxis_transform(),
        )
        axes.grid(axis="y", visible=True)
        axes.set_xlabel("held-out loss per residual (1 = noise alone), log scale")
    return figure


def horizons(found: Diagnosis, view: View) -> "Figure":
    """Root mean square of the residuals against how far ahead was predicted."""
    rms = [np.array(found.where[key], dtype=float) for key in ("rms", "rms_floor")]
    low, high = (np.array(found.where[k], dtype=float) for k in ("rms_low", "rms_high"))
    labels = [_horizon(value) for value in found.where["horizons"]]
    place = np.arange(len(labels))
    features, columns = view.problem.model.features, view.largest(SIDE)
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 2.7), layout="constrained")
        panels = figure.subplots(1, len(columns), squeeze=False)[0]
        for axes, column in zip(panels, columns, strict=True):
            feature = features[column]
            unit, factor = ROUND.get(feature.unit, (feature.unit, 1.0))
            before = factor * rms[0][:, column]
            spread = factor * np.array([low[:, column], high[:, column]])
            axes.errorbar(
                place,
                before,
                yerr=np.abs(spread - before),
                color=NOMINAL,
                marker="o",
                capsize=3,
                label="nominal",
            )
            if view.effects:
                axes.plot(
                    place,
                    factor * view.after.rms[:, column],
                    color=CORRECTED,
                    marker="s",
                    label="corrected",
                )
            axes.plot(
                place,
                factor * rms[1][:, column],
                color=style.GREEN,
                ls="--",
                label="noise floor",
            )
            axes.set_xticks(place, labels)
            style.logarithmic(axes.yaxis, axes.set_yscale)
            axes.set_title(f"{feature.name} [{unit}]")
            axes.set_xlabel("predicted over")
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=3)
    return figure


def _horizon(value: float | None) -> str:
    whole = value is None or not np.isfinite(value)
    return "trial" if whole else f"{value:g} s"


def over_time(view: View) -> "Figure":
    """Residuals of one trial over time, nominal and corrected, with the floor."""
    trial = view.shown
    times = view.problem.windows[trial].times
    gap, left, scatter = view.gap(trial), view.left[trial], view.scatter(trial)
    features = view.problem.model.features
    columns = view.largest()
    size = (7.0, 0.8 + 1.35 * len(columns))
    with style.plotting() as figure_class:
        figure = figure_class(figsize=size, layout="constrained")
        panels = figure.subplots(len(columns), 1, squeeze=False, sharex=True)[:, 0]
        for axes, column in zip(panels, columns, strict=True):
            feature = features[column]
            unit, factor = ROUND.get(feature.unit, (feature.unit, 1.0))
            band = 2 * factor * scatter[:, column]
            axes.fill_between(
                times,
                -band,
                band,
                color=style.GREEN,
                alpha=0.18,
                lw=0,
                label="noise floor",
            )
            axes.plot(times, factor * gap[:, column], color=NOMINAL, lw=1.2)
            if view.effects:
                axes.plot(times, factor * left[:, column], color=CORRECTED, lw=1.2)
            axes.set_ylabel(f"{feature.name} [{unit}]")
        panels[-1].set_xlabel("time in the trial [s]")
        _legend(figure, view, "noise floor, two deviations")
    return figure


def _legend(figure: "Figure", view: View, third: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    known = [("recorded minus nominal", NOMINAL)]
    known += [("recorded minus corrected", CORRECTED)] if view.effects else []
    lines = [Line2D([], [], color=colour, label=name) for name, colour in known]
    band = Patch(color=style.GREEN, alpha=0.18, lw=0, label=third)
    figure.legend(handles=[*lines, band], loc="outside lower center", ncols=3)


def motion(view: View) -> Any:
    """The trial with the largest gap: the path, or each channel over time."""
    trial = view.trials[view.shown]
    series: list[tuple] = [
        ("recorded", trial.observed, RECORDED, 2.2, "-"),
        ("nominal", view.nominal[view.shown], NOMINAL, 1.4, "-"),
    ]
    if view.effects:
        series.append(
            ("corrected", view.corrected[view.shown], CORRECTED, 1.4, (0, (4, 2)))
        )
    planar = [channel.name for channel in trial.channels][:2] == ["x", "y"]
    return _path(series) if planar else _channels(trial, series)


def _path(series: Any) -> "Figure":
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 4.6), layout="constrained")
        axes = figure.subplots()
        for name, values, colour, width, line in series:
            axes.plot(
                values[:, 0], values[:, 1], color=colour, lw=width, ls=line, label=name
            )
        start = series[0][1][0]
        axes.plot(start[0], start[1], "o", color=RECORDED, ms=6, label="start")
        axes.set_aspect("equal", "datalim")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        figure.legend(loc="outside lower center", ncols=4)
    return figure


def _channels(trial: Any, series: Any) -> "Figure":
    size = (7.0, 0.8 + 1.35 * len(trial.channels))
    with style.plotting() as figure_class:
        figure = figure_class(figsize=size, layout="constrained")
        panels = figure.subplots(len(trial.channels), 1, squeeze=False, sharex=True)
        for column, axes in enumerate(panels[:, 0]):
            for name, values, colour, width, line in series:
                axes.plot(
                    trial.times,
                    values[:, column],
                    color=colour,
                    lw=width,
                    ls=line,
                    label=name,
                )
            axes.set_ylabel(
                f"{trial.channels[column].name} [{trial.channels[column].unit}]"
            )
        panels[-1, 0].set_xlabel("time in the trial [s]")
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=3)
    return figure
