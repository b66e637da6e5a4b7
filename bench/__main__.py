"""Command line of the benches: `python -m bench list | table | NAME [--quick]`."""

import argparse
import json
import sys

from bench.runner import (
    RESULTS,
    discover,
    find,
    measure,
    page,
    store,
    stored,
    table,
    write,
)
from bns.errors import BnsError


def main(words: list[str] | None = None) -> int:
    """Run a command; 0 done, 1 a bar does not hold, 2 the input is wrong."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("names", nargs="+", metavar="list | table | NAME")
    parser.add_argument(
        "--quick", action="store_true", help="coarser, within 60 s on 2 cores"
    )
    given = parser.parse_args(words)
    try:
        if given.names == ["list"]:
            return _list()
        if given.names == ["table"]:
            return _table(quick=given.quick)
        return _run([find(name) for name in given.names], quick=given.quick)
    except BnsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _list() -> int:
    benches = discover()
    width = max(len(name) for name in benches)
    for bench in benches.values():
        print(f"{bench.name:{width}}  {bench.doc}  [{bench.bar}]")
    return 0


def _table(*, quick: bool) -> int:
    benches, rows = discover(), stored(quick=quick)
    print(table(benches, rows), end="")
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        write(RESULTS / "README.md", page(benches, rows))
    return 0


def _run(benches, *, quick: bool) -> int:
    broken = False
    for bench in benches:
        row = measure(bench, quick=quick)
        print(json.dumps(row, allow_nan=False), flush=True)
        store(row, bench.subject)
        broken = broken or row["holds"] is False
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
