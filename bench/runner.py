"""Find the benches, run one, keep its result."""

import ast
import json
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path

from bench.result import Result
from bench.versions import commit, machine, versions
from bns.errors import BnsError, UnknownNameError

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A bench as its source describes it; nothing of it is imported for this.

    Attributes:
        name: as given on the command line, with dashes.
        module: importable name of the module that has its function.
        doc: what is measured.
        bar: the bar as text.
    """

    name: str
    module: str
    doc: str
    bar: str

    @property
    def subject(self) -> str:
        """Folder of this package that it lies in, where its row is kept, too."""
        return self.module.split(".")[1] if self.module.count(".") > 1 else "other"

    def run(self, *, quick: bool) -> Result:
        """Measure."""
        function = getattr(import_module(self.module), self.name.replace("-", "_"))
        return function(quick=quick)


def discover(directory: Path = HERE) -> dict[str, Bench]:
    """All benches by name: the functions that `bench.result.bench` marks."""
    found = [each for path in directory.rglob("*.py") for each in _read(path)]
    return {each.name: each for each in sorted(found, key=lambda each: each.name)}


def find(name: str) -> Bench:
    """The bench `name`.

    Raises:
        UnknownNameError: there is none.
    """
    benches = discover()
    if name not in benches:
        raise UnknownNameError("bench", name, benches)
    return benches[name]


def measure(bench: Bench, *, quick: bool) -> dict[str, object]:
    """Run a bench and return its row, ready for JSON."""
    made_with, at = versions(), commit()
    started = time.perf_counter()
    with redirect_stdout(sys.stderr):
        result = bench.run(quick=quick)
    seconds = time.perf_counter() - started
    if result.commits:
        at = ", ".join(
            each[:12] + "-dirty" * each.endswith("+") for each in result.commits
        )
    if result.seconds is not None:
        seconds = result.seconds
    if not math.isfinite(result.figure):
        raise BnsError(f"Bench {bench.name} measured {result.figure}, not a number.")
    return {
        "name": bench.name,
        "figure": float(result.figure),
        "unit": result.unit,
        "bar": bench.bar,
        "holds": None if result.holds is None else bool(result.holds),
        "n": int(result.n),
        "seconds": round(seconds, 2),
        "command": f"python -m bench {bench.name}{' --quick' if quick else ''}",
        "versions": made_with,
        "machine": machine(),
        "commit": at,
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "quick": quick,
        "details": plain(result.details),
    }


def keeps(row: Mapping[str, object]) -> bool:
    """Whether a row is one to keep: quick, or of code that a commit has."""
    return bool(row["quick"]) or "-dirty" not in str(row["commit"])


def store(row: Mapping[str, object], subject: str, directory: Path = RESULTS) -> Path:
    """Write a row; a quick one goes to `quick/` and never replaces a full one.

    Args:
        row: as `measure` returns it.
        subject: folder that it belongs to, `Bench.subject`.
        directory: of all rows.

    Raises:
        BnsError: a full row of code that no commit has.
    """
    if not keeps(row):
        raise BnsError(
            f"{row['name']} was measured with files that differ from the commit: it "
            "is not kept. Commit them and measure again, or give --quick."
        )
    folder = (directory / "quick" if row["quick"] else directory) / subject
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{row['name']}.json"
    write(path, json.dumps(row, indent=1, allow_nan=False) + "\n")
    return path


def stored(*, quick: bool = False, directory: Path = RESULTS) -> dict[str, dict]:
    """Rows kept so far, by name."""
    folder = directory / "quick" if quick else directory
    found = [json.loads(path.read_text()) for path in folder.glob("*/*.json")]
    rows = [row for row in found if row["quick"] == quick]
    return {row["name"]: row for row in sorted(rows, key=lambda row: row["name"])}


def write(path: Path, text: str) -> None:
    """Replace a file in one step, so that a kill leaves the old or the new one."""
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    os.replace(part, path)


def plain(value: object) -> object:
    """A value as JSON can hold it: arrays to lists, what is not finite to null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    return value


def _read(path: Path) -> Iterator[Bench]:
    tree = ast.parse(path.read_text(), filename=str(path))
    module = ".".join(path.relative_to(HERE.parent).with_suffix("").parts)
    for function in tree.body:
        if not isinstance(function, ast.FunctionDef):
            continue
        for mark in function.decorator_list:
            match mark:
                case ast.Call(
                    func=ast.Name("bench"),
                    args=[ast.Constant(doc)],
                    keywords=[ast.keyword("bar", ast.Constant(bar))],
                ):
                    name = function.name.replace("_", "-")
                    yield Bench(name=name, module=module, doc=str(doc), bar=str(bar))


HEAD = """# Results of the benches

Each row is one bench: `python -m bench NAME` measures it again, `python -m bench list`
says what each measures. The figures behind a row are in `SUBJECT/NAME.json` beside this
file.
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
