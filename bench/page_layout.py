"""Pages at three widths: what is cut off in a browser, or lies on one another."""

import html
import json
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.processes import finish
from bench.result import Result, bench
from bns.errors import BnsError, MissingDependencyError

WIDTHS = (400, 800, 1400)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
MEASURE = Path(__file__).parent / "measure.html"
LIMIT = 900.0
"""time that a command may take [s]"""


@bench("pages and reports in Chromium, 400, 800 and 1400 px wide: flaws", bar="0")
def page_layout(quick: bool) -> Result:
    """Make reports and the site, and measure them; quick: a run's report alone."""
    with TemporaryDirectory() as scratch:
        made = reports(Path(scratch), quick=quick)
        if not quick:
            made += site(Path(scratch) / "site")
        rows = measured(made, Path(scratch))
    wrong = {
        f"{Path(row['url']).relative_to(scratch)} at {row['width']}": row["flaws"]
        for row in rows
        if row["flaws"]
    }
    found = sum(len(flaws) for flaws in wrong.values())
    return Result(
        figure=found,
        unit="flaws",
        holds=found == 0,
        n=len(rows),
        details={"pages": len(made), "widths": WIDTHS, "flaws": wrong},
    )


def reports(here: Path, *, quick: bool) -> list[Path]:
    """Reports of a run, of two and of a diagnosis.

    Args:
        here: directory to write to.
        quick: of a run of three trials alone.
    """
    size = ("--trials", "3" if quick else "20", "--replicates", "2", "--rerun", "off")
    _bns("run", "demo", "--out", here / "run", *size)
    made = [here / "run" / "report.html"]
    if quick:
        return made
    _bns("run", "demo", "--out", here / "plain", *size, "--adaptation.window", "0")
    _bns("report", here / "run", here / "plain", "--out", here / "two.html")
    words = ("--trials", "15-17", "--no-rerun", "--threads", "1")
    _bns("gap", "diagnose", here / "run", *words, "--out", here / "gap")
    return [*made, here / "two.html", here / "gap" / "report.html"]


def site(out: Path) -> list[Path]:
    """The pages of the documentation, built."""
    words = ["-m", "mkdocs", "build", "--quiet", "--site-dir", str(out)]
    _run([sys.executable, *words])
    return sorted(out.rglob("*.html"))


def measured(pages: Sequence[Path], scratch: Path) -> list[dict]:
    """What Chromium finds: a row of url, width and flaws a page and width.

    Raises:
        MissingDependencyError: there is no Chromium.
        BnsError: it did not come to an end.
    """
    given = f"const PAGES = {json.dumps([str(each) for each in pages])};"
    given += f"const WIDTHS = {json.dumps(WIDTHS)};"
    asking = scratch / "measure.html"
    asking.write_text(f"<script>{given}</script>{MEASURE.read_text()}")
    words = ["--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom"]
    words += ["--allow-file-access-from-files", "--virtual-time-budget=100000000"]
    said = _run([_browser(), *words, asking.as_uri()])
    found = re.search(r'<pre id="found">(.+?)</pre>', said, re.DOTALL)
    if not found:
        raise BnsError("Chromium measured nothing: it did not come to an end.")
    return [json.loads(line) for line in html.unescape(found[1]).splitlines()]


def _browser() -> str:
    for name in BROWSERS:
        if path := shutil.which(name):
            return path
    raise MissingDependencyError(
        "Measuring pages", "Chromium", "apt-get install chromium"
    )


def _bns(*words: object) -> None:
    _run([sys.executable, "-m", "bns", *map(str, words)])


def _run(words: list[str]) -> str:
    """What a command says.

    Raises:
        BnsError: it failed.
    """
    quiet = {"OMP_NUM_THREADS": "1", "RERUN_ANALYTICS": "0", "NO_MKDOCS_2_WARNING": "1"}
    done = finish(words, limit=LIMIT, environment=quiet)
    if done.code != 0:
        raise BnsError(f"{' '.join(words[:5])} failed: {done.output[-300:]}")
    return done.output
