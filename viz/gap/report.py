"""One self-contained HTML page about a diagnosis of the sim-to-real gap."""

from collections.abc import Sequence
from pathlib import Path

from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis
from bns.storage import files
from bns.viz.gap import figures, view
from bns.viz.gap import words as gap_words
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
        "Loss on trials that were not fitted: of the nominal model, with each effect "
        "alone, with what the verdict names, and of a flexible model that explains "
        "nothing but shows how much is predictable at all.",
    ),
    "horizons": (
        "Where the gap is",
        "Root mean square of recorded minus predicted motion, by channel and by how "
        "far ahead was predicted. For a robot that drives, an error that grows is one "
        "of motion, one that stays is one of a sensor. Bars are 90 % intervals over "
        "trials.",
    ),
    "over_time": (
        "Residuals over time",
        "The same trial, window by window; inside the band there is nothing to "
        "explain.",
    ),
}


def write(
    found: Diagnosis, trials: Sequence[Trial], model: GapModel | None, path: str | Path
) -> Path:
    """Write the report.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model; None = none that can be simulated (no figures of
            motion).
        path: file to write; no other is needed to read it.
    """
    page = render("gap_report.html", _context(found, trials, model))
    files.write_bytes(Path(path), page)
    return Path(path)


def _context(found: Diagnosis, trials: Sequence[Trial], model: GapModel | None) -> dict:
    about = found.provenance
    rows = model.rows(trials) if model is not None else ()
    return {
        "found": found,
        "title": gap_words.title(found),
        "answers": gap_words.answers(found),
        "explanations": gap_words.explanations(found),
        "detectable": gap_words.detectable(found, rows),
        "steps": gap_words.next_steps(found, rows),
        "figures": _figures(found, trials, model),
        "data": about.get("data", ()),
        "command": _command(found),
        "versions": sorted(dict(about.get("versions", {})).items()),
    }


def _command(found: Diagnosis) -> str:
    about = found.provenance
    words = ["bns gap diagnose", *about.get("data", ("DATA",))]
    words.append(f"--model {about.get('model', found.model)}")
    for key in ("importer", "columns"):
        if about.get(key):
            words.append(f"--{key} {about[key]}")
    for key in ("only", "reference"):
        if about.get(key):
            words.append(f"--{key} " + " ".join(about[key]))
    return " ".join([*words, f"--seed {found.seed}", "--out DIR"])


def _figures(
    found: Diagnosis, trials: Sequence[Trial], model: GapModel | None
) -> list[dict]:
    made = {}
    if found.decomposition.get("parts"):
        made["shares"] = figures.shares(found)
    if model is not None and found.where:
        made |= _drawn(found, trials, model)
    return [
        {
            "name": name,
            "title": CAPTIONS[name][0],
            "caption": CAPTIONS[name][1],
            "image": picture(figure),
        }
        for name, figure in made.items()
    ]


def _drawn(found: Diagnosis, trials: Sequence[Trial], model: GapModel) -> dict:
    """Figures that need the simulation."""
    seen = view.view(found, trials, model)
    return {
        "motion": figures.motion(seen),
        "horizons": figures.horizons(found, seen),
        "closing": figures.closing(found),
        "over_time": figures.over_time(seen),
    }
