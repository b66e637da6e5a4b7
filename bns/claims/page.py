"""docs/claims.md, generated from what has been run."""

from collections.abc import Mapping, Sequence

from bns.claims import verdict
from bns.claims.claim import INVESTIGATIONS, claims, content
from bns.claims.measures import MEASURES
from bns.claims.report import HEAD, Judged, cells, counts, kind

TITLES = {
    "A": "A: open-loop Khepera",
    "B": "B: closed-loop Khepera, undamaged",
    "C": "C: closed-loop Khepera, damaged",
    "D": "D: hexapod",
}
PICTURE = "images/claims.png"
INTRO = """# Claims

The dissertation's 157 claims, and what runs in this testbed say of them: in MuJoCo, and
in the dissertation's own kind of world, fixed networks (static-snn), which so far there
is for navigation and walking.

![Claims by verdict, investigation and world](images/claims.png)

"""
HOW = """
*Settled* claims have all their comparisons at the number of runs that the design asks
for. A *stale* finding is of other settings or other code than today's and counts as not
run. Picture, table and page are made by `bns claims table --write docs/claims.md`. What
is compared with what is data, in `bns/claims/data/`, with the section and table that
say so, and so is what was found, with settings, commit, seeds and dates.
`bns claims plan` says what all of it costs, `bns claims run ID ...` and
`bns claims run --all` run what is missing; how, and how findings are published, is in
[Campaigns](campaigns.md#claims).
"""
RULE = """## The rule

```
{rule}
```

p is Mann-Whitney's, or that of the sign test where one side is held against a number.
Where two measures of the same runs are compared, their pairing is not used; nor is it
where sides share their trials before the damage. Either makes the test careful where
pairs are alike. `python -m bench sequential-design` simulates the design. What is
measured, where it is not the cost after the damage (lower is better), stands in
brackets:

| measure | what it is |
| --- | --- |
{measures}
"""


def page(worlds: Mapping[str, Sequence[Judged]]) -> str:
    """The page.

    Args:
        worlds: name of the world -> all claims, judged.
    """
    rule = (verdict.__doc__ or "").partition("\n\n")[2].strip()
    told = RULE.replace("{rule}", rule).replace("{measures}", _measures())
    parts = [INTRO + _summary(worlds) + HOW, told]
    for letter in INVESTIGATIONS:
        parts += [f"## {TITLES[letter]}\n", _departures(letter)]
        parts.append(_overview(worlds, letter))
        parts += [
            _details(row, world)
            for number in range(len(next(iter(worlds.values()))))
            for world, rows in worlds.items()
            if (row := rows[number]).findings or row.stale
            if row.claim.investigation == letter
        ]
    return "\n".join(parts).rstrip() + "\n"


def _measures() -> str:
    used = {
        name
        for claim in claims().values()
        for cell in claim.cells
        for name in (cell.measure, cell.measure_b)
    }
    known = ((name, each.doc) for name, each in MEASURES.items() if name in used)
    return "\n".join(f"| {name} | {doc} |" for name, doc in known)


def _departures(letter: str) -> str:
    """Where the settings of an investigation are not the dissertation's."""
    lines = ["Departures from the dissertation, and what it leaves silent:", ""]
    lines += [f"- {each['says']}" for each in content(letter)["departures"]]
    beside = [
        f"- beside {', '.join(each['claims'])}: {each['says']}"
        for each in content(letter).get("variants", ())
    ]
    if beside:
        lines += ["", "Variants, which count for nothing in a verdict:", "", *beside]
    return "\n".join(lines) + "\n"


def _summary(worlds: Mapping[str, Sequence[Judged]]) -> str:
    heads = ["investigation", "world", "claims", *counts([]), "settled", "runs"]
    lines = [f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)]
    for letter in INVESTIGATIONS:
        for name, rows in worlds.items():
            part = [row for row in rows if row.claim.investigation == letter]
            lines.append(_counted(letter, name, part))
    for name, rows in worlds.items():
        lines.append(_counted("all", name, rows))
    return "\n".join([*lines, *_provisional(worlds)]) + "\n"


def _counted(letter: str, world: str, rows: Sequence[Judged]) -> str:
    settled = sum(row.settled for row in rows)
    words = [letter, world, len(rows), *counts(rows).values(), settled, _runs(rows)]
    return f"| {' | '.join(map(str, words))} |"


def _provisional(worlds: Mapping[str, Sequence[Judged]]) -> list[str]:
    lines = []
    for name, rows in worlds.items():
        found = [row.claim.id for row in rows if row.provisional]
        if found:
            lines += ["", f"Provisional in {name}: {', '.join(found)}."]
    return lines


def _runs(rows: Sequence[Judged]) -> int:
    """Runs that findings rest on, each side counted once."""
    found: dict[str, int] = {}
    for row in rows:
        for finding in row.findings:
            for side, runs in zip(finding.cell.sides, finding.runs, strict=False):
                side = f"{row.claim.investigation} {side}"
                found[side] = max(runs, found.get(side, 0))
    return sum(found.values())


def _overview(worlds: Mapping[str, Sequence[Judged]], letter: str) -> str:
    """A line for each claim of an investigation."""
    lines = [
        f"| claim | where | the dissertation says | kind | {' | '.join(worlds)} |",
        "| --- |" + " --- |" * (3 + len(worlds)),
    ]
    for rows in zip(*worlds.values(), strict=True):
        claim = rows[0].claim
        if claim.investigation == letter:
            first, *others = rows
            said = " | ".join([_short(first), *(_short(row, first) for row in others)])
            words = f"{claim.where} | {_plain(claim.says)} | {kind(claim)}"
            lines.append(f"| {claim.id} | {words} | {said} |")
    return "\n".join(lines) + "\n"


def _short(row: Judged, first: Judged | None = None) -> str:
    """A verdict in a few words; a reason that the first world gave is not repeated."""
    if not row.own:
        told = first is not None and row.note == first.note
        return row.verdict if told else f"{row.verdict}: {_plain(row.note)}"
    said = ["provisional"] if row.provisional else []
    said += [f"{row.fewest} runs", *([row.note] if row.note else [])]
    return f"**{row.verdict}** ({', '.join(said)})"


def _details(row: Judged, world: str) -> str:
    """The comparisons of a claim in a world."""
    claim = row.claim
    read = f" Read as: {claim.reading}." if claim.reading else ""
    lines = [
        f"**{claim.id}** in {world}: {row.verdict}. {_plain(claim.says)}.{read}",
        "",
        f"| {' | '.join(HEAD)} |",
        "|" + " --- |" * len(HEAD),
    ]
    lines += [f"| {' | '.join(_plain(w) for w in each)} |" for each in cells(row)]
    return "\n".join(lines) + "\n"


def _plain(word: str) -> str:
    return word.replace("|", "\\|").replace("*", "\\*").replace("<", "&lt;")
