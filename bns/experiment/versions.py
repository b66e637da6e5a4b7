"""What made a result: versions of the packages, machine, commit."""

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("mujoco", "numpy", "scipy", "torch", "rerun-sdk", "pyarrow")
"""packages whose version can move a result or a file"""

UNKNOWN = "unknown"

REVISION = 1
"""of the code: raised by hand when runs of the same settings come out otherwise than
before, so that what was found then is known to be of other code"""


def package(name: str) -> str:
    """The installed version of a package, empty if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def processor() -> str:
    """The processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.machine()


def commit() -> str:
    """The commit of the checkout this package runs from, with `+` if it was changed."""
    here = str(Path(__file__).parent)

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", "-C", here, *arguments], capture_output=True, text=True, timeout=10
        )
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        if not git("ls-files", __file__):
            return UNKNOWN
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.TimeoutExpired):
        return UNKNOWN


def collect() -> dict[str, str]:
    """All of it, one text per entry."""
    from bns import __version__

    found = {"bns": __version__, "python": platform.python_version()}
    found |= {name: package(name) or "not installed" for name in PACKAGES}
    found["machine"] = f"{platform.system()} {platform.machine()}, {processor()}"
    found["cores"] = str(os.cpu_count() or 1)
    found["commit"] = commit()
    found["revision"] = str(REVISION)
    return found
