"""Check types: of all packages, and of the Python in README and the documentation; of
benches, that what they import and name is there.

usage: python .ci/check_types.py
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FENCE = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
ABSENT = re.compile(
    r"\[(name-defined|import-not-found)\]|Module .* has no attribute|"
    r"Unexpected keyword|Missing positional"
)
MYPY = (sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"))


def snippets(folder: Path) -> list[str]:
    """Write the Python of each page into a file; gives their paths."""
    made = []
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        blocks = FENCE.findall(page.read_text(encoding="utf-8"))
        if blocks:
            path = folder / f"{page.stem.replace('-', '_')}_page.py"
            path.write_text("\n".join(blocks), encoding="utf-8")
            made.append(str(path))
    return made


def absent() -> list[str]:
    """What benches import, name or hand over that is not there."""
    made = subprocess.run(
        [*MYPY, "-p", "bench"], cwd=ROOT, capture_output=True, text=True
    )
    return [line for line in made.stdout.splitlines() if ABSENT.search(line)]


def main() -> int:
    """Run mypy over all; 0 = nothing to say."""
    with tempfile.TemporaryDirectory(prefix="snippets-") as folder:
        runs = (["-p", "bns"], snippets(Path(folder)))
        codes = [subprocess.run([*MYPY, *what], cwd=ROOT).returncode for what in runs]
    broken = absent()
    print("\n".join(broken or ["Benches name what there is."]))
    return max(*codes, len(broken) > 0)


if __name__ == "__main__":
    sys.exit(main())
