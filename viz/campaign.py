"""Pictures of a campaign: recovery curves, and how a measure depends on settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.campaign.identity import shortened, text
from bns.campaign.results import Results
from bns.errors import BnsError
from bns.stats.compare import MEASURES, values
from bns.stats.measures import bootstrap_median, median_band
from bns.storage import files
from bns.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MOST_CURVES = 7
"""curves in one picture; more cannot be told apart"""


def write(found: Results, folder: Path, measure: str) -> list[Path]:
    """Write curves.png and sensitivity.png; gives the files.

    Args:
        found: results of a campaign.
        folder: where to; made if it is not there.
        measure: that sensitivity.png shows.

    Raises:
        BnsError: there are no runs yet.
    """
    files.make_directory(folder)
    made = []
    for name, figure in (
        ("curves.png", curves(found)),
        ("sensitivity.png", sensitivity(found, measure)),
    ):
        if figure is not None:
            with style.plotting():
                style.fit(figure)
                files.replace(folder / name, figure.savefig)
            made.append(folder / name)
    if not made:
        raise BnsError(f"{found.store.directory} has no runs yet: let it run.")
    return made


def curves(found: Results) -> "Figure | None":
    """Cost of the population's best over trials: median and 95 % bootstrap interval.

    None without runs. Of many members the first ones are drawn.
    """
    have = [(m, r) for m in found.campaign.members if (r := found.of(m)) is not None]
    shown = have[:MOST_CURVES]
    if not shown:
        return None
    with style.plotting() as figure_class:
        height = style.SQUARE.height
        figure = figure_class(figsize=(style.WIDE.width, height), layout="constrained")
        axes = figure.subplots()
        for (member, record), colour in zip(shown, style.CYCLE, strict=False):
            middle, low, high = median_band(record["fitness_best"])
            trial = np.arange(len(middle))
            axes.fill_between(trial, low, high, color=colour, alpha=0.18, linewidth=0)
            said = f"{member.label} ({record.replicates} runs)"
            axes.plot(trial, middle, color=colour, label=said)
        onsets = {int(r.damage_onset[0]) for _, r in shown if r.damage_onset[0] >= 0}
        for onset in onsets:
            axes.axvline(onset - 0.5, color=style.DAMAGE, ls="--", linewidth=1.2)
        if all((record["fitness_best"] > 0).all() for _, record in shown):
            axes.set_yscale("log")
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set_xlabel("trial in the world")
        axes.set_ylabel("cost of the best (lower is better)")
        more = (
            f"; {len(shown)} of {len(have)} members" if len(have) > len(shown) else ""
        )
        axes.set_title(f"{found.campaign.name}: median, 95 % interval{more}", pad=14)
        figure.legend(loc="outside lower left", ncols=1)
    return figure


def sensitivity(found: Results, measure: str) -> "Figure | None":
    """A panel per setting that is varied: the measure of every member over its values.

    Dots: medians of members. Line: median of all runs with that value, with its 95 %
    bootstrap interval (not where values are a random sample). None where nothing
    varies or nothing ran.
    """
    rows = [
        (member.varied, values(record, measure))
        for member in found.campaign.members
        if (record := found.of(member)) is not None
    ]
    rows = [(varied, sample) for varied, sample in rows if len(sample)]
    names = _varied(rows)
    if not names:
        return None
    with style.plotting() as figure_class:
        across = min(3, len(names))
        down = -(-len(names) // across)
        size = (max(4.2, 3.1 * across), 2.9 * down + 0.3)
        figure = figure_class(figsize=size, layout="constrained")
        panels = figure.subplots(down, across, squeeze=False, sharey=True)
        for axes, name in zip(panels.flat, names, strict=False):
            _panel(axes, name, rows, found.campaign.sampled)
            axes.set_xlabel(shortened(names)[name])
        for axes in panels.flat[len(names) :]:
            axes.set_visible(False)
        for axes in panels[:, 0]:
            axes.set_ylabel(measure)
        figure.suptitle(
            f"{found.campaign.name}: {MEASURES[measure].partition(',')[0]}",
            x=0.01,
            ha="left",
            fontsize=10.5,
            fontweight="bold",
        )
    return figure


def _varied(rows: list[tuple[Mapping[str, Any], np.ndarray]]) -> list[str]:
    names = dict.fromkeys(name for varied, _ in rows for name in varied)
    return [n for n in names if len({text(v.get(n, "")) for v, _ in rows}) > 1]


def _panel(
    axes: "Axes",
    name: str,
    rows: list[tuple[Mapping[str, Any], np.ndarray]],
    sampled: bool,
) -> None:
    pairs = [(varied[name], sample) for varied, sample in rows if name in varied]
    number = all(type(value) in (int, float) for value, _ in pairs)
    if number and sampled:
        places = [float(value) for value, _ in pairs]
    else:
        distinct = list(dict.fromkeys(text(value) for value, _ in pairs))
        if number:
            distinct.sort(key=float)
        places = [distinct.index(text(value)) for value, _ in pairs]
        ticks = [word if len(word) <= 14 else f"{word[:13]}…" for word in distinct]
        tilt: Any = {"rotation": 20, "ha": "right"} if max(map(len, ticks)) > 6 else {}
        axes.set_xticks(range(len(distinct)), ticks, **tilt)
        _line(axes, places, pairs)
    finite = [(x, np.median(s)) for x, (_, s) in zip(places, pairs, strict=True)]
    finite = [(x, y) for x, y in finite if np.isfinite(y)]
    if finite:
        axes.plot(*zip(*finite, strict=True), "o", color=style.BLUE, ms=4, alpha=0.6)


def _line(
    axes: "Axes", places: list[float], pairs: list[tuple[object, np.ndarray]]
) -> None:
    for place in sorted(set(places)):
        at = [s for x, (_, s) in zip(places, pairs, strict=True) if x == place]
        middle, low, high = bootstrap_median(np.concatenate(at))
        if np.isfinite(middle):
            axes.plot([place - 0.18, place + 0.18], [middle] * 2, color=style.BLACK)
            high = min(high, 10 * middle) if np.isinf(high) else high
            axes.plot([place, place], [low, high], color=style.BLACK, linewidth=1)
