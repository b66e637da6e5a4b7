"""docs/standings.md, generated from what has been run."""

import re
from collections.abc import Sequence

import numpy as np

from bns.prior import repertoire
from bns.standings import figures
from bns.standings.design import DESIGNS, PRIORS
from bns.standings.figures import Cell, Row
from bns.stats import Interval

INTRO = """# Standings

All learners on the same robots, with the same damages and budgets: which of them
recovers, and how soon. What each of them is, and when it counts as the method that it
is named after, is on the page [Rivals](rivals.md).

Counted is the controller *deployed*, the one that a user would run if trials ended
then, trial by trial from the damage on; the first damaged trial is 1. *Tried* is what
the learner tried in the same trials. Runs that never got there count as infinite in the
median. Shares of the ceiling are of the damages whose ceiling is known (walking:
`python -m bench hexapod-ceiling`, the undamaged world's physics); in light following
and navigation they are shares of trials in which the task is done.

**Few runs say little.** n stands in every table; thirty runs a cell are wanted, and
with fewer than six an exact 95 % interval of a median is infinite. IT&E on one map, in
a world without noise, does the same in every run: there n is the number of maps, and
the table says how many runs differ. Nothing counts as won or lost with fewer than four
of these on either side.
"""
EMPTY = """
Nothing has been run for this page yet: `bns standings plan`, then `bns standings run`
and `bns standings table --write docs/standings.md`.
"""
HOW = """
## How

`bns standings plan` prints what it costs in processor hours, `bns standings run` runs
what is missing, and `bns standings table --write docs/standings.md` makes this page
from it. `--rivals NAME` takes any learner into the table, one of your own as well.
"""
SECTION = re.compile(r"\n!\[(\w+): what is deployed.*?(?=\n!\[|\n## How)", re.DOTALL)
"""what the page says of a task, which it begins with"""
PICTURES = "images"
"""folder of the pictures, beside the page"""


def page(cells: Sequence[Cell], before: str = "") -> str:
    """The page of some cells, none of them = that nothing was run.

    Args:
        cells: what has been run.
        before: the page as it was; what it says of tasks without a cell is kept.
    """
    parts = {found[1]: found[0] for found in SECTION.finditer(before)}
    for task in dict.fromkeys(task for task, *_ in figures.groups(cells)):
        title = f"{task}: what is deployed over the trials after the damage"
        parts[task] = f"\n![{title}]({PICTURES}/standings-{task}.png)\n"
    for (task, prior, kind), held in figures.groups(cells).items():
        parts[task] += _group(task, prior, kind, held)
    told = [parts[task] for task in DESIGNS if task in parts]
    return "".join([INTRO, *(told or [EMPTY]), HOW])


def _group(task: str, prior: str, kind: str, cells: Sequence[Cell]) -> str:
    rows = [figures.row(n, held) for n, held in figures.by_rival(cells).items()]
    names = list(dict.fromkeys(each.entry.damage for each in cells))
    wanted = DESIGNS[task].damages[kind]
    missing = [name for name in wanted if name not in names]
    left = f"; not run: {', '.join(missing)}" if missing else ""
    lines = [
        f"\n## {task}, {prior}: {PRIORS[prior]}; damages {kind}\n",
        f"{', '.join(names)}{left}.\n",
        *_repertoires(cells),
        *table(rows, figures.measure(task, kind)),
        "",
        *duels(cells),
    ]
    return "\n".join(lines) + "\n"


def _repertoires(cells: Sequence[Cell]) -> list[str]:
    """What the repertoires of some cells hold, and whether that can do the task."""
    lines = []
    for name in sorted({c.entry.member.config.prior.repertoire for c in cells} - {""}):
        found = repertoire.read(name)
        best, bar = found.worth.max(), min(cell.bar for cell in cells)
        short = (
            f", less than the {bar:.2f} m of the task: nobody who keeps to it can do it"
            if best < bar
            else ""
        )
        lines.append(
            f"Repertoire `{name}`: {len(found)} controllers of "
            f"{found.head.evaluations} evaluations; the best does {best:.2f} m in the "
            f"undamaged model{short}.\n"
        )
    return lines


def table(rows: Sequence[Row], measure: str) -> list[str]:
    """Lines of the table of learners, best first.

    Args:
        rows: of one task, prior and set of damages.
        measure: what their means are of, see `figures.measure`.
    """
    bars = list(dict.fromkeys(bar for row in rows for bar in row.waits))
    heads = ["learner", "n"]
    heads += [f"trials to {bar}: median [95 %], never" for bar in bars]
    heads += [
        f"mean {measure}: deployed",
        "last five",
        "tried",
        "harmed",
        "evaluations",
    ]
    lines = [_line(heads), _line(["---"] * len(heads))]
    for row in sorted(rows, key=lambda each: -each.deployed):
        runs, damages, distinct = row.runs
        alike = f", {distinct} that differ" if distinct < runs else ""
        texts = [row.rival, f"{runs} x {damages}{alike}"]
        texts += [_waits(row.waits.get(bar)) for bar in bars]
        shares = (row.deployed, row.last, row.tried, row.harmed)
        texts += [f"{value:.2f}" for value in shares]
        lines.append(_line([*texts, f"{row.evaluations:.0f}"]))
    return lines


def _waits(found: tuple[Interval, int, int] | None) -> str:
    if found is None:
        return ""
    middle, never, runs = found
    span = f"[{_number(middle.low)}, {_number(middle.high)}]"
    return f"{_number(middle.value)} {span}, {never} of {runs}"


def _number(value: float) -> str:
    return f"{value:g}" if np.isfinite(value) else ("-" if value < 0 else "never")


def duels(cells: Sequence[Cell]) -> list[str]:
    """Lines of the table of wins, ties and losses; none with one learner."""
    found = figures.matches(cells)
    if not found:
        return []
    names = list(figures.by_rival(cells))
    score = {(m.a, m.b): m for m in found}
    lines = [
        "Wins, ties and losses of the row against the column over the damages "
        f"(Mann-Whitney on what is deployed, p below {figures.LEVEL} by Holm), and the "
        "share of pairs of runs in which the row gets farther:\n",
        _line(["", *names]),
        _line(["---"] * (len(names) + 1)),
    ]
    for one in names:
        texts = []
        for other in names:
            if match := score.get((one, other)):
                won, lost, better = match.won, match.lost, match.better
            elif match := score.get((other, one)):
                won, lost, better = match.lost, match.won, 1 - match.better
            texts.append(f"{won}-{match.tied}-{lost} ({better:.2f})" if match else "")
        lines.append(_line([one, *texts]))
    return lines


def _line(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"
