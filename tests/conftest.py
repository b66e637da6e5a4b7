"""What every test gets: no display, one thread per pool, no analytics.

Set before anything heavy is imported; values from outside are kept.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("RERUN_ANALYTICS", "0")
os.environ.setdefault("MPLBACKEND", "agg")

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))  # last, so that an installed `bns` comes first


@pytest.fixture
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skips where nothing can be drawn, as on a machine without OpenGL."""
    from bns.errors import MissingDependencyError
    from bns.models import arena, render

    try:
        render.picture(arena.spec(), camera="overhead", size=(16, 12))
    except MissingDependencyError as error:
        pytest.skip(str(error))


@pytest.fixture
def run_python(tmp_path):
    """Run Python in a process of its own, in an empty directory.

    Takes the interpreter's arguments; fails with its output when it exits with another
    code than `code` (default 0), else returns what it printed.
    """

    def run(*words, code=0, cwd=tmp_path, limit=240, **environment):
        done = subprocess.run(
            [sys.executable, *map(str, words)],
            cwd=cwd,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=limit,
            check=False,
        )
        if done.returncode != code:
            pytest.fail(f"{words} exited with {done.returncode}:\n{done.stdout}")
        return done.stdout

    return run
