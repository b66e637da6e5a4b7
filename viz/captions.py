"""What stands beside the figures of a report: only what is true of the runs drawn."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.learners import registry as learners
from bns.learners.base import Curves
from bns.viz import scene
from bns.viz.facts import foresees, who
from bns.viz.figures.trials import onsets

CAPTIONS = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went. {foreseen}"
        "{discs} Paths are cut at the board's edge.{parted}"
    ),
    "fitness": (
        "{curve} of the controller tried in each trial{logarithmic}.{mean} {band}"
    ),
    "solved": (
        "First: {reached}. Then: share of runs whose trial solved the task: {solved}. "
        "{band}"
    ),
    "waits": (
        "Share of runs that had solved the task{again}. A curve that ends below 100 % "
        "tells of runs that never did. The dotted line drops from the median."
    ),
    "displacement": (
        "Each dot is one command: the motion {who} predicted against the motion that "
        "came. On the diagonal {who} is right; a cloud off the diagonal shows what "
        "{who} has not learned{changed}. Dots beyond the frame are drawn at its edge."
    ),
}
"""of tasks that have none of their own (`Picture.captions`); what is in braces is one
of `words`"""

TITLES = {
    "readings": "What the light sensors read",
    "starts": "Paths by start",
    "path": "Where the robot went",
    "fitness": "Fitness",
    "waits": "Trials needed",
    "displacement": "Predicted against real motion",
}

MEAN = " The dotted line is the mean, which a few failing runs dominate."
BAND = "The line is the median over runs, the band holds the middle half of them"


def band(runs: Mapping[str, RunRecord]) -> str:
    """What line and band of a figure over trials are."""
    if not onsets(runs):
        return f"{BAND}."
    return f"{BAND}; the dashed orange line marks the onset of damage."


def words(runs: Mapping[str, RunRecord]) -> dict[str, object]:
    """What captions may say in braces, "" where it is not so.

    Args:
        runs: label -> record, as drawn in one figure; the first says which task it is.
    """
    record = next(iter(runs.values()))
    config, shown, by = record.config, scene.picture(record.config), who(record)
    damaged, foreseen = bool(onsets(runs)), foresees(record)
    label, log = shown.curve.label, shown.curve.log
    named = "simulator network (SNN)" if by == "SNN" else by
    again = " before the damage, and then, counted from the first damaged trial, again"
    read = "readings_predicted" in record.extra
    return {
        "band": band(runs),
        "who": f"the {by}",
        "foreseen": f"Dashed: where the {named} had said it would go. " * foreseen,
        "parted": f" Where solid and dashed part, the {by} is wrong about the robot."
        * foreseen,
        "read": f", and what the {by} had said they would read" * read,
        "again": again * damaged,
        "changed": ", after the damage what that changed" * damaged,
        "discs": shown.discs,
        "curve": label[:1].upper() + label[1:],
        "logarithmic": ", on a logarithmic axis" * log,
        "mean": MEAN * log,
        "reached": shown.reached[:1].lower() + shown.reached[1:],
        "solved": shown.solved.rstrip(","),
        "order": ", ".join(shown.order),
        "goals": len(shown.order),
        "penalty": config.task.penalty,
        "adequate": config.walk.adequate,
    }  # fmt: skip


def caption(figure: Curves | str, runs: Mapping[str, RunRecord]) -> str:
    """The caption of a figure: the task's, else the learner's, else the usual one."""
    shown = scene.picture(next(iter(runs.values())).config)
    if isinstance(figure, Curves):
        return shown.captions.get(figure.name, figure.caption).format(**words(runs))
    return (CAPTIONS | dict(shown.captions))[figure].format(**words(runs))


def title(figure: str, record: RunRecord) -> str:
    """The title of a figure."""
    shown = scene.picture(record.config)
    return (TITLES | {"solved": shown.reached} | dict(shown.titles))[figure]


def notes(runs: Mapping[str, RunRecord]) -> list[str]:
    """What each learner is, and what it is told, a sentence or two each."""
    found = [_learner(record.config.learner) for record in runs.values()]
    if onsets(runs):
        found.append(
            "Damage is never announced to a learner unless its settings say so."
        )
    return list(dict.fromkeys(found))


def _learner(name: str) -> str:
    if name == "bns":
        return (
            "Bootstrapped neuro-simulation: a robot learns a simulator of itself (the "
            "simulator neural network, SNN) while it uses it. Controllers are evolved "
            "inside the SNN, one is tried in the world in each trial, and what "
            "happened trains the SNN."
        )
    return f"The learner {name}: {learners.describe(name).rstrip('.')}."
