"""`bns view`: open the recording of a run or a diagnosis, or make a picture of it."""

import os
import socket
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from urllib.parse import quote

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.errors import BnsError, MissingDependencyError, OutOfBoundsError, install
from bns.progress import working

DATA, PAGE = 9876, 9090
"""ports of Rerun's data and of its page, where they are free"""
DRAWING = 11.0
"""what a picture takes [s]: 12 and 19 s, of a diagnosis and of the demo's run, on two
cores that others used as well; 6 s of it are a wait"""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Open the recording of a run or a gap diagnosis in the Rerun viewer, or draw it to
    a file."""

    directory: Positional[str]
    """directory of a run or of a gap diagnosis, or a recording (.rrd)"""
    png: str = ""
    """write a picture to this file instead; needs no display"""
    gif: str = ""
    """write a film of a run to this file instead; needs no display"""
    mp4: str = ""
    """the same as MP4"""
    trials: tuple[int, ...] = ()
    """trials of the film; by default before, just after and recovered from damage"""
    speed: float = 8.0
    """of the film, times real time"""
    web: bool = False
    """open it in a browser instead of the viewer's own window"""
    bind: str = "127.0.0.1"
    """address that the viewer listens on; 0.0.0.0 lets other machines send to it"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code.

    Raises:
        BnsError: more than one of ``--png``, ``--gif``, ``--mp4`` and ``--web``, or
            nothing there to show.
        MissingDependencyError: Rerun is not installed, and no film was asked for.
    """
    given = parse(Arguments, argv, prog="bns view")
    os.environ.setdefault("RERUN_ANALYTICS", "0")
    if sum(map(bool, (given.png, given.gif, given.mp4, given.web))) > 1:
        raise BnsError("Give one of --png, --gif, --mp4 and --web.")
    if given.gif or given.mp4:
        print(film(given))
        return 0
    if find_spec("rerun") is None:
        raise MissingDependencyError("bns view", "Rerun", install("view"))
    recording = find(Path(given.directory))
    if given.png:
        from bns.viz import pictures

        with working("drawing", usual=DRAWING):
            reports = pictures.write_png(recording, given.png)
        for report in reports:
            print(f"bns: the viewer says: {report}", file=sys.stderr)
        print(given.png)
        return 0
    return show(recording, given.bind, web=given.web)


def film(given: Arguments) -> Path:
    """Write the film of a run's trials.

    Raises:
        BnsError: no run, or a run without such a trial; a file that cannot be.
        MissingDependencyError: this machine cannot render.
    """
    from bns.cli.outputs import shown
    from bns.storage.store import load
    from bns.viz import choices, pictures, style

    path = Path(given.gif or given.mp4)
    if path.suffix != (".gif" if given.gif else ".mp4"):
        end = ".gif" if given.gif else ".mp4"
        raise BnsError(
            f"{path} is no {end[1:].upper()}: give a name that ends in {end}."
        )
    record = load(Path(given.directory))
    if record.trials == 0:
        raise BnsError(f"{given.directory} has no trial yet: let it run for a while.")
    for trial in given.trials:
        if not 0 <= trial < record.trials:
            raise OutOfBoundsError("--trials", trial, 0, record.trials - 1, "")
    replicate, dense = shown(record)
    onset = int(record.damage_onset[replicate])
    chosen = [
        choices.Choice(
            trial, "damaged" if 0 <= onset <= trial else "as it is", style.BLUE
        )
        for trial in given.trials
    ]
    return pictures.write_film(
        record,
        dense,
        path,
        replicate=replicate,
        choices=chosen or None,
        speed=given.speed,
    )


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
    with working("writing the recording"):
        return write_recording(record, recording)


def show(recording: Path, bind: str, *, web: bool = False) -> int:
    """Open the viewer, which listens on an address, and leave it open.

    Args:
        recording: what to show.
        bind: the address.
        web: serve it to a browser on this machine, until Ctrl-C.

    Raises:
        BnsError: there is no display, or no such address.
        MissingDependencyError: there is no viewer.
    """
    import subprocess

    from bns.viz import pictures

    viewer = pictures.executable()
    if viewer is None:
        raise MissingDependencyError("bns view", "the Rerun viewer", install("view"))
    if (
        not web
        and sys.platform == "linux"
        and not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    ):
        raise BnsError(
            f"No display to open {recording} on: make a picture with --png FILE, "
            "serve it to a browser with --web, or copy it to a machine that has one."
        )
    words = ["--bind", str(_address(bind)), *(_served(bind) if web else [])]
    os.environ.setdefault("RUST_LOG", "warn")
    return subprocess.call([viewer, *words, str(recording)])


def _address(bind: str) -> IPv4Address | IPv6Address:
    try:
        return ip_address(bind)
    except ValueError:
        raise BnsError(
            f"--bind {bind} is no address: give 127.0.0.1 for this machine alone, or "
            "0.0.0.0 for all that reach it."
        ) from None


def _served(bind: str) -> list[str]:
    """How the viewer is told to serve a browser; says where it does."""
    from bns.viz import pictures

    data, page = pictures.free_port(DATA), pictures.free_port(PAGE)
    everywhere = _address(bind).is_unspecified
    host = socket.gethostname() if everywhere else bind
    host = f"[{host}]" if ":" in host else host
    source = quote(f"rerun+http://{host}:{data}/proxy", safe="")
    print(f"http://{host}:{page}?url={source}\nCtrl-C ends it.", flush=True)
    return ["--web-viewer", "--port", str(data), "--web-viewer-port", str(page)]
