"""What a figure was measured with: package versions, machine and commit."""

import os
import platform
import subprocess
from pathlib import Path

from bns import __version__
from bns.experiment.versions import PACKAGES, package, processor

ROOT = Path(__file__).resolve().parents[1]


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that can move a figure."""
    found = {"bns": __version__, "python": platform.python_version()}
    return found | {name: package(name) or "not installed" for name in PACKAGES}


def machine() -> dict[str, str | int | float]:
    """Kind of machine: nothing that names it."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(_memory_bytes() / 2**30, 1),
    }


def commit() -> str:
    """Commit of the checkout, with ``-dirty`` where tracked files differ from it.

    Results of benches do not count as a difference; "unknown" outside a checkout.
    """
    head = _git("rev-parse", "--short=12", "HEAD")
    if not head:
        return "unknown"
    changed = _git(
        "status",
        "--porcelain",
        "--untracked-files=no",
        "--",
        ".",
        ":(exclude)bench/results",
    )
    return f"{head}-dirty" if changed else head


def _memory_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _git(*words: str) -> str:
    try:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
