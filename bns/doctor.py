"""What this machine has, what is known to be bad, what to install."""

import os
import platform
import shutil
from collections.abc import Callable
from ctypes.util import find_library
from glob import glob
from typing import Literal, NamedTuple

from bns.errors import install
from bns.experiment import versions

State = Literal["ok", "missing", "bad", "note"]

REQUIRED = ("mujoco", "numpy", "scipy", "rich", "jinja2")


class Optional(NamedTuple):
    """A package that a part of the testbed needs.

    Attributes:
        name: of the package.
        extra: of bns-testbed that brings it.
        needed_by: what needs it.
    """

    name: str
    extra: str
    needed_by: str


OPTIONAL = (
    Optional("torch", "learn", "learners"),
    Optional("matplotlib", "report", "figures and reports"),
    Optional("pyarrow", "tables", "Parquet, CSV and campaigns"),
    Optional("rerun-sdk", "view", "recordings in 3D"),
    Optional("imageio-ffmpeg", "video", "videos as MP4"),
    Optional("gymnasium", "gym", "Gymnasium worlds"),
    Optional("dm-control", "dm", "dm_env worlds"),
    Optional("pyserial", "hardware", "a Khepera on a serial port"),
    Optional("opencv-python-headless", "hardware", "overhead tracking"),
    Optional("dynamixel-sdk", "hardware", "a hexapod on its bus"),
)


class Finding(NamedTuple):
    """One thing looked at.

    Attributes:
        what: was looked at.
        state: ok, missing (a feature is), bad (must be changed), note.
        found: in words.
        remedy: what to do, empty if nothing.
    """

    what: str
    state: State
    found: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything; changes nothing."""
    checks: tuple[Callable[[], list[Finding]], ...] = (
        _python, _packages, _optional, pins, _graphics, _compiler, _machine, _ports,
    )  # fmt: skip
    return [finding for check in checks for finding in check()]


def _python() -> list[Finding]:
    version = platform.python_version()
    good = (3, 11) <= tuple(map(int, platform.python_version_tuple()[:2])) < (3, 14)
    remedy = "" if good else "use Python 3.11, 3.12 or 3.13"
    return [Finding("Python", "ok" if good else "bad", version, remedy)]


def _packages() -> list[Finding]:
    return [_installed(name, "bad", f"pip install {name}") for name in REQUIRED]


def _optional() -> list[Finding]:
    return [
        _installed(name, "note", f"for {use}: {install(extra)}")
        for name, extra, use in OPTIONAL
    ]


def _installed(name: str, lacking: State, remedy: str) -> Finding:
    version = versions.package(name)
    if version:
        return Finding(name, "ok", version)
    return Finding(name, lacking, "not installed", remedy)


def pins(package: Callable[[str], str] = versions.package) -> list[Finding]:
    """Combinations of versions that are known to go wrong.

    Args:
        package: gives the version of a package, empty if it is not installed.
    """
    mujoco, control = package("mujoco"), package("dm-control")
    found = []
    if mujoco == "4.0.0":
        found.append(
            Finding(
                "mujoco pin",
                "bad",
                "4.0.0: wrong accelerations with the sparse solver",
                'pip install "mujoco>=3.17,<4"',
            )
        )
    if mujoco.startswith("4.") and control:
        found.append(
            Finding(
                "dm-control pin",
                "bad",
                f"dm-control {control} does not work with mujoco {mujoco}",
                'pip install "mujoco>=3.17,<4"',
            )
        )
    return found or [Finding("known-bad versions", "ok", "none installed")]


def _graphics() -> list[Finding]:
    if platform.system() != "Linux":
        return [Finding("graphics", "note", "of the system, not looked at")]
    gl = {name: find_library(name) for name in ("EGL", "OSMesa", "GL")}
    have = [name for name, path in gl.items() if path]
    off_screen = bool(gl["EGL"] or gl["OSMesa"])
    drivers = glob("/usr/share/vulkan/icd.d/*.json") + glob("/etc/vulkan/icd.d/*.json")
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return [
        Finding(
            "OpenGL off screen",
            "ok" if off_screen else "missing",
            ", ".join(have) or "none",
            "" if off_screen else _apt("libegl1 libegl-mesa0 libgl1-mesa-dri"),
        ),
        Finding(
            "MUJOCO_GL",
            "note",
            os.environ.get("MUJOCO_GL", "not set"),
            "" if "MUJOCO_GL" in os.environ else "fine: pictures use EGL by themselves",
        ),
        Finding(
            "Vulkan",
            "ok" if drivers else "missing",
            f"{len(drivers)} drivers",
            "" if drivers else _apt("mesa-vulkan-drivers"),
        ),
        Finding(
            "display",
            "ok" if display else "note",
            display or "none",
            "" if display else "pictures: bns view DIR --png FILE",
        ),
    ]


def _compiler() -> list[Finding]:
    names = ("g++", "clang++", "c++")
    path = next((p for p in map(shutil.which, names) if p), None)
    if path:
        return [Finding("C++ compiler", "ok", path)]
    remedy = f"long runs are up to twice as fast with it: {_apt('g++')}"
    return [Finding("C++ compiler", "missing", "none", remedy)]


def _machine() -> list[Finding]:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 0
    cores = cores or os.cpu_count() or 1
    free = shutil.disk_usage(".").free / 2**30
    return [
        Finding("cores", "ok", f"{cores} ({versions.processor()})"),
        Finding(
            "disk here",
            "ok" if free > 1 else "missing",
            f"{free:.1f} GiB free",
            "" if free > 1 else "a run needs up to 0.1 GiB; free some space",
        ),
    ]


def _ports() -> list[Finding]:
    ports = sorted(glob("/dev/ttyUSB*") + glob("/dev/ttyACM*") + glob("/dev/rfcomm*"))
    shut = [port for port in ports if not os.access(port, os.R_OK | os.W_OK)]
    if not ports:
        return [Finding("serial ports", "note", "none", "needed for real robots only")]
    remedy = f"no permission: usermod -aG dialout {os.environ.get('USER', 'USER')}"
    state: State = "missing" if shut else "ok"
    return [Finding("serial ports", state, ", ".join(ports), remedy if shut else "")]


def _apt(packages: str) -> str:
    return f"apt-get install {packages}"
