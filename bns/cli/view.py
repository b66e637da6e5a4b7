"""`bns view`: open the recording of a run or a diagnosis, or make a picture of it."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from bns.cli.parse import parse
from bns.errors import BnsError, MissingDependencyError


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Open the recording of a run or a gap diagnosis in the Rerun viewer, or draw it to
    a file."""

    directory: tyro.conf.Positional[str]
    """directory of a run or of a gap diagnosis, or a recording (.rrd)"""
    png: str = ""
    """write a picture to this file instead; needs no display"""
    bind: str = "127.0.0.1"
    """address that the viewer listens on; 0.0.0.0 lets other machines send to it"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    given = parse(Arguments, argv, prog="bns view")
    os.environ.setdefault("RERUN_ANALYTICS", "0")
    recording = find(Path(given.directory))
    if given.png:
        from bns.viz import picture

        for report in picture.save(recording, given.png):
            print(f"bns: the viewer says: {report}", file=sys.stderr)
        print(given.png)
        return 0
    return show(recording, given.bind)


def find(path: Path) -> Path:
    """The recording of a run, written now if it was not before, or of a diagnosis.

    Raises:
        BnsError: neither a run, a diagnosis nor a recording, a run without a trial, or
            a diagnosis that was told to make no recording.
    """
    from bns.cli.outputs import RECORDING, write_recording
    from bns.gap.store import FILE
    from bns.storage.store import load

    if path.suffix == ".rrd":
        if not path.is_file():
            raise BnsError(f"There is no recording {path}: give a run directory.")
        return path
    recording = path / RECORDING
    if (path / FILE).is_file():
        if not recording.is_file():
            raise BnsError(
                f"{path} holds a diagnosis without a recording: repeat "
                f"`bns gap diagnose` with --rerun and --out {path}."
            )
        return recording
    record = load(path)
    if recording.exists() and record.trials == record.config.trials:
        return recording
    if record.trials == 0:
        raise BnsError(f"{path} has no trial yet: let it run for a while.")
    return write_recording(record, recording)


def show(recording: Path, bind: str) -> int:
    """Open the viewer, which listens on an address, and leave it open.

    Raises:
        BnsError: there is no display.
        MissingDependencyError: there is no viewer.
    """
    import subprocess

    from bns.viz import picture

    if sys.platform == "linux" and not any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    ):
        raise BnsError(
            f"No display to open {recording} on: make a picture with --png FILE, or "
            "copy the file to a machine that has one."
        )
    viewer = picture.executable()
    if viewer is None:
        raise MissingDependencyError("bns view", "rerun-sdk", "pip install rerun-sdk")
    return subprocess.call([viewer, "--bind", bind, str(recording)])
