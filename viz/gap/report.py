"""One self-contained HTML page about one diagnosis, in words and tables."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from bns.gap.decomposition import words
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis, Fit
from bns.progress import Each, uncounted
from bns.storage import files
from bns.viz.gap import figures
from bns.viz.page import picture, render
from bns.worlds.trial import Trial

CAPTIONS = {
    "shares": (
        "What the gap is made of",
        "The share of the gap that each explanation closes: by itself, and when it is "
        "added to the others. What is left is beyond what measuring scatters.",
    ),
    "motion": (
        "The robot and its models",
        "The trial with the largest gap: what was recorded, and what the nominal and "
        "the corrected model make of the same commands from the same start.",
    ),
    "closing": (
        "How far the gap closes",
        "Loss on motion that was not fitted: of the nominal model, with each effect "
        "alone, with what the verdict names, and with all explanations of the library "
        "at once, which describe a recording but foretell seldom better.",
    ),
    "horizons": (
        "Where the gap is",
        "Root mean square of recorded minus predicted motion, by channel and by how "
        "far ahead was predicted. Of a robot on wheels or legs an error that grows is "
        "one of motion, one that stays is one of a sensor. Bars are 90 % intervals "
        "over trials.",
    ),
    "over_time": (
        "Residuals over time",
        "The same trial, window by window; inside the band there is nothing to "
        "explain.",
    ),
}


def write(
    found: Diagnosis,
    trials: Sequence[Trial],
    model: GapModel | None,
    path: str | Path,
    *,
    each: Each = uncounted,
) -> Path:
    """Write the report.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model; None = none that can be simulated (no figures of
            motion).
        path: file to write; no other is needed to read it.
        each: goes through the figures, and may count them.
    """
    page = render("gap_report.html", _context(found, trials, model, each))
    files.write_bytes(Path(path), page)
    return Path(path)


def _context(
    found: Diagnosis,
    trials: Sequence[Trial],
    model: GapModel | None,
    each: Each = uncounted,
) -> dict:
    about = found.provenance
    rows = model.rows(trials) if model is not None else ()
    return {
        "found": found,
        "title": title(found),
        "answers": answers(found),
        "explanations": explanations(found),
        "detectable": detectable(found, rows),
        "steps": next_steps(found, rows),
        "figures": _figures(found, trials, model, each),
        "data": about.get("data", ()),
        "command": _command(found),
        "versions": sorted(dict(about.get("versions", {})).items()),
    }


def _command(found: Diagnosis) -> str:
    about = found.provenance
    parts = ["bns gap diagnose", *about.get("data", ("DATA",))]
    parts.append(f"--model {about.get('model', found.model)}")
    for key in ("importer", "columns", "trials"):
        if about.get(key):
            parts.append(f"--{key} {about[key]}")
    for key in ("only", "reference"):
        if about.get(key):
            parts.append(f"--{key} " + " ".join(about[key]))
    return " ".join([*parts, f"--seed {found.seed}", "--out DIR"])


def _figures(
    found: Diagnosis,
    trials: Sequence[Trial],
    model: GapModel | None,
    each: Each,
) -> list[dict]:
    drawn: dict[str, Callable[[], Any]] = {}
    if found.decomposition.get("parts"):
        drawn["shares"] = lambda: figures.shares(found)
    if model is not None and found.where:
        drawn |= _simulated(found, trials, model)
    return [
        {
            "name": name,
            "title": CAPTIONS[name][0],
            "caption": CAPTIONS[name][1],
            "image": picture(draw()),
        }
        for name, draw in each(list(drawn.items()))
    ]


def _simulated(
    found: Diagnosis, trials: Sequence[Trial], model: GapModel
) -> dict[str, Callable[[], Any]]:
    """What draws the figures that need the simulation; the first one simulates."""
    seen = cache(lambda: figures.view(found, trials, model))
    return {
        "motion": lambda: figures.motion(seen()),
        "horizons": lambda: figures.horizons(found, seen()),
        "closing": lambda: figures.closing(found),
        "over_time": lambda: figures.over_time(seen()),
    }


LISTED = 12  # rows of the table of explanations
ROUND = {"m": ("mm", 1e3), "rad": ("mrad", 1e3)}


def title(found: Diagnosis) -> str:
    """The verdict in a few words."""
    verdict = found.verdict
    named = " + ".join(verdict.named[0]) if verdict.named else ""
    unlisted = " + ".join(found.decomposition.get("unlisted", ()))
    if unlisted and verdict.kind == "none of the library":
        return f"Not listed in [effects]: {unlisted}"
    return {
        "effect": f"One effect: {named}",
        "together": f"Together: {named}",
        "either": f"{len(verdict.named)} explanations are tied",
        "no gap": "No gap",
    }.get(verdict.kind, "A gap that no effect of the library explains")


def answers(found: Diagnosis) -> list[tuple[str, str]]:
    """The three questions, each with its answer in a sentence or two; of a joint fit
    the three statements come first."""
    said = list(found.decomposition.get("statements", ()))
    asked = ("How large is it?", "What explains it?", "What is left?")
    first = list(zip(asked, said, strict=True)) if len(said) == len(asked) else []
    if first:
        return [*first, ("Where is it?", where(found))]
    return [
        ("Where is it?", where(found)),
        ("Which effect?", which(found)),
        ("How far does it close?", how_far(found)),
    ]


def where(found: Diagnosis) -> str:
    """Channel, wheel, nature, moment and regime of the gap."""
    if not found.where:
        return found.partial.get("where, closed", "Not looked at.").capitalize() + "."
    if found.verdict.kind == "no gap":
        return "Nowhere beyond what the recording scatters by itself."
    said = [_largest(found.where["shares"], "channels")]
    if found.where.get("wheels"):
        said.append(_largest(found.where["wheels"], "wheels"))
    nature = found.where["nature"]["verdict"]
    if found.where.get("wheels") and not nature.startswith("too "):
        said.append(f"its growth with time says {nature}")
    text = "; ".join(said)
    text = text[0].upper() + text[1:] + "."
    regime = found.where.get("regime") or {}
    if regime.get("words") and regime.get("explained", 0.0) > 0.02:
        text += f" It is largest when {regime['words']}."
    if change := found.change:
        text += (
            f" It {change['direction']} at trial {change['trial']}, "
            f"{change['time']:.1f} s."
        )
    return text


def _largest(shares: Mapping[str, Any], key: str) -> str:
    share, name = max(zip(shares["share"], shares[key], strict=True))
    at = list(shares[key]).index(name)
    low, high = shares["low"][at], shares["high"][at]
    return (
        f"{100 * share:.0f} % [{100 * low:.0f}, {100 * high:.0f}] of it in "
        f"{name}{' wheel' if key == 'wheels' else ''}"
    )


def which(found: Diagnosis) -> str:
    """The verdict and what comes next after it."""
    verdict = found.verdict
    if verdict.kind == "no gap":
        return "None: there is no gap."
    if verdict.kind == "none of the library":
        best = " + ".join(found.signatures.get("best", ())) or "nothing"
        return f"None of the library. The best attempt is {best}."
    if verdict.kind == "either":
        named = " or ".join(" + ".join(names) for names in verdict.named)
        return f"{named}: these data can not tell."
    fit = found.best
    return " and ".join(
        f"{name} = {_number(value)} {_unit(unit)} "
        f"[{_number(low)}, {_number(high)}]".replace("  ", " ")
        for name, value, unit, (low, high) in zip(
            fit.names, fit.magnitudes, fit.units, fit.intervals, strict=True
        )
    )


def how_far(found: Diagnosis) -> str:
    """The share closed on held-out trials and errors in plain units."""
    closed = found.closed
    if not closed:
        return found.partial.get("where, closed", "Not looked at.").capitalize() + "."
    if not found.verdict.named:
        share = 100 * closed["closed_by_flexible"]
        if found.verdict.kind == "no gap":
            return "There is nothing to close."
        return f"All explanations at once would close {share:.0f} % of it."
    low, high = closed["closed_interval"]
    text = (
        f"{100 * closed['closed']:.0f} % [{100 * low:.0f}, {100 * high:.0f}] of it is "
        "closed on trials that were not fitted."
    )
    plain = closed["plain"]
    rows = zip(
        plain["channels"], plain["before"], plain["after"], plain["floor"], strict=True
    )
    name, before, after, least = max(rows, key=lambda row: row[1] / max(row[3], 1e-12))
    channel, _, unit = name.partition(" [")
    shown, factor = ROUND.get(unit.rstrip("]"), (unit.rstrip("]"), 1.0))
    return (
        f"{text} Over {plain['horizon']:g} s the error of {channel} falls from "
        f"{factor * before:.3g} to {factor * after:.3g} {shown} (noise "
        f"floor {factor * least:.3g})."
    )


def explanations(found: Diagnosis) -> dict[str, Any]:
    """The table of what was fitted, best first."""
    count = max(_residuals(found), 1.0)
    order = sorted(found.fits, key=lambda fit: fit.held_out)
    nothing = next((fit for fit in order if not fit.names), None)
    kept = [fit for fit in order[:LISTED] if fit.names] + ([nothing] if nothing else [])
    rows = [_row(found, fit, nothing, count) for fit in kept]
    head = ["explanation", "magnitude [90 %]", "held-out loss", "closes", "remarks"]
    return {"header": head, "rows": rows}


def _residuals(found: Diagnosis) -> float:
    """How many residuals there are, from the nominal model's two losses."""
    nothing = next((fit for fit in found.fits if not fit.names), None)
    if nothing is None or not found.closed or not found.closed.get("before"):
        return 1.0
    return nothing.held_out / found.closed["before"]


def _row(found: Diagnosis, fit: Fit, nothing: Fit | None, count: float) -> list[str]:
    remarks = []
    if fit.names and fit.names in found.verdict.named:
        remarks.append("tied" if found.verdict.kind == "either" else "named")
    elif fit.names in found.verdict.sets:
        remarks.append("in the 90 % set")
    elif fit.names == found.verdict.second:
        remarks.append("second best")
    remarks += [f"{name} at its bound" for name in fit.at_bound]
    if fit.condition > 1e4:
        remarks.append("magnitudes trade off")
    share = ""
    gap = found.verdict.kind != "no gap"
    if nothing is not None and found.closed and fit.names and gap:
        whole = nothing.held_out / count - found.closed["floor"]
        gone = (nothing.held_out - fit.held_out) / count
        share = f"{100 * min(max(gone / max(whole, 1e-12), -1), 1):z.0f} %"
    sizes = [
        f"{_number(v)} {_unit(u)} [{_number(low)}, {_number(high)}]".replace("  ", " ")
        for v, u, (low, high) in zip(
            fit.magnitudes, fit.units, fit.intervals, strict=True
        )
    ]
    return [
        " + ".join(fit.names) or "nothing (the nominal model)",
        "; ".join(sizes),
        f"{fit.held_out / count:.4g}",
        share,
        ", ".join(remarks),
    ]


def detectable(found: Diagnosis, known: Sequence[Row]) -> dict[str, Any]:
    """The smallest effect of each kind that this recording shows.

    Args:
        found: the diagnosis.
        known: rows of its model; none = units are not said.
    """
    items = {row.term: row for row in reversed(known)}  # the first of each
    rows = []
    for name, least in found.signatures.get("detectability", {}).items():
        item = items.get(name)
        unit = f"\u00a0{_unit(item.unit)}" if item else ""
        missing = least is None or (isinstance(least, float) and math.isnan(least))
        size = "not excited" if missing else f"{_number(least)}{unit}".strip()
        rows.append([name, size, item.excite if item and missing else ""])
    rows.sort(key=lambda row: (row[1] != "not excited", row[0]))
    head = ["effect", "smallest that would be found", "what would excite it"]
    return {"header": head, "rows": rows}


def next_steps(found: Diagnosis, known: Sequence[Row]) -> list[str]:
    """What to do now, one line each; `known` as for `detectable`."""
    steps = [found.verdict.change] if found.verdict.change else []
    if found.verdict.kind == "either" and found.verdict.change != words.SAME:
        steps.append("bns gap plan DIR writes the command that separates them best.")
    if found.verdict.named:
        steps.append(
            "bns gap edit DIR --remove EFFECT --predict OTHER tests the explanation on "
            "a recording without the effect."
        )
        own = str(found.provenance.get("model", "")).endswith(".toml")
        kept = ("--world NAME", "world"), ("--xml FILE", "MJCF")
        steps.append("bns gap apply DIR {} keeps the corrected {}.".format(*kept[own]))
    quiet = [row for row in detectable(found, known)["rows"] if row[1] == "not excited"]
    for name, _, excite in quiet[:4]:
        steps.append(f"{name} could not have been seen; it would take {excite}.")
    return steps


def _number(value: float) -> str:
    return f"{value:z.4g}" if value is not None and math.isfinite(value) else "-"


def _unit(unit: str) -> str:
    """As it is written after a number, from which no line parts it."""
    return "" if unit == "1" else unit.replace(" ", "\u00a0")
