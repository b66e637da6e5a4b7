"""Command line: compare with what is kept, or keep what comes out, see `check`."""

import argparse
import sys
import tempfile
from pathlib import Path

from bench.goldens.check import KEPT, compared, computed, key, record, stored


def main() -> int:
    """Compare or record; 0 all the same or recorded, 1 something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--record", action="store_true", help="keep what comes out")
    parser.add_argument("--only", nargs="+", default=["*"], help="names of items")
    parser.add_argument("--keep", type=Path, help="leave what was made in DIR")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="goldens-") as temporary:
        place = (given.keep or Path(temporary)).resolve()
        place.mkdir(parents=True, exist_ok=True)
        found = computed(place, given.only)
    if given.record:
        record(KEPT, {name: files for name, files in found.items() if files})
        return int(not all(found.values()))
    return int(bool(compared(found, stored(KEPT).get(key(), {}).get("items", {}))))


if __name__ == "__main__":
    sys.exit(main())
