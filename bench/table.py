"""All results as one Markdown table."""

from collections.abc import Mapping

from bench.runner import Bench

HEAD = """# Results of the benches

Each row is one bench: `python -m bench NAME` measures it again, `python -m bench list`
says what each measures. The figures behind a row are in `NAME.json` beside this file.
"""
COLUMNS = ("bench", "figure", "bar", "holds", "n", "seconds", "commit")
HOLDS = {True: "yes", False: "**no**", None: "-"}


def table(benches: Mapping[str, Bench], rows: Mapping[str, Mapping]) -> str:
    """The table, a row for every bench and for every result without a bench.

    Args:
        benches: what exists.
        rows: what was measured, as `bench.runner.measure` returns it.
    """
    lines = [_line(COLUMNS), _line(["---"] * len(COLUMNS))]
    for name in sorted({*benches, *rows}):
        if name in rows:
            lines.append(_line(_cells(rows[name])))
        else:
            bar = benches[name].bar
            lines.append(_line([f"`{name}`", "not measured yet", bar, "", "", "", ""]))
    return "\n".join(lines) + "\n"


def machines(rows: Mapping[str, Mapping]) -> str:
    """One line per kind of machine and set of versions the rows were made with."""
    lines: dict[str, list[str]] = {}
    for name, row in sorted(rows.items()):
        lines.setdefault(_made_with(row), []).append(f"`{name}`")
    return "".join(f"- {text}: {', '.join(n)}\n" for text, n in lines.items())


def page(benches: Mapping[str, Bench], rows: Mapping[str, Mapping]) -> str:
    """The page kept at `bench/results/README.md`."""
    docs = "".join(f"- `{b.name}`: {b.doc}\n" for b in benches.values())
    made = f"\n## Made with\n\n{machines(rows)}" if rows else ""
    return f"{HEAD}\n{table(benches, rows)}\n## What is measured\n\n{docs}{made}"


def _cells(row: Mapping) -> list[str]:
    return [
        f"`{row['name']}`" + (" (quick)" if row["quick"] else ""),
        f"{row['figure']:.4g} {row['unit']}".strip(),
        row["bar"],
        HOLDS[row["holds"]],
        str(row["n"]),
        f"{row['seconds']:.0f}",
        row["commit"],
    ]


def _made_with(row: Mapping) -> str:
    on, using = row["machine"], row["versions"]
    names = ("python", "mujoco", "torch", "numpy")
    packages = ", ".join(f"{name} {using[name]}" for name in names if name in using)
    return f"{on['processor']}, {on['cores']} cores; {packages}"


def _line(cells) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"
