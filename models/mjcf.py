"""MJCF files, looked at before MuJoCo builds anything of them.

A few characters in such a file can ask for gigabytes: a height field, a texture, a
replicated body. What a file asks for is added up first.
"""

import xml.etree.ElementTree as xml
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError, UnknownNameError
from bns.models.robot_model import RobotModel
from bns.storage import reading

MOST = 20_000_000
"""cells, pixels, copies or numbers that one element may ask for"""

MEMORY = 1 << 30  # [bytes] of a model's arena
INCLUDED = 100  # files that one may include, each in the next
PRODUCTS = {
    "hfield": ("nrow", "ncol"),
    "texture": ("width", "height"),
    "replicate": ("count",),
    "composite": ("count",),
    "flexcomp": ("count",),
    "flex": ("dim",),
    "layer": (),
}
COPIES = 10_000  # of bodies in one file, by replicate, composite and flexcomp
SIZES = ("njmax", "nconmax", "nstack", "nuserdata", "nkey")
SHIFT = {"": 0, "K": 10, "M": 20, "G": 30, "T": 40, "P": 50, "E": 60}
ASSETS = ("mesh", "texture", "hfield", "skin", "model", "include", "flexcomp")


def load(path: Path) -> Any:
    """A file as a `mujoco.MjSpec`.

    Raises:
        FormatError: missing, no MJCF, or it asks for too much.
    """
    import mujoco

    check(path)
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError, *reading.UNREADABLE) as error:
        raise FormatError(f"MuJoCo cannot read {path}: {error}") from error


def compiled(spec: Any, name: object) -> Any:
    """A spec as a `mujoco.MjModel`.

    Args:
        spec: as `load` gives it.
        name: of its file, for messages.

    Raises:
        FormatError: MuJoCo refuses it.
    """
    import mujoco

    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError, *reading.UNREADABLE) as error:
        raise FormatError(f"MuJoCo refuses {name}: {error}") from error


def check(path: Path, *, depth: int = 0) -> None:
    """Stop at a file, or one that it includes, that asks for too much.

    Raises:
        FormatError: it does; missing, no XML, or no MJCF.
    """
    if depth > INCLUDED:
        raise FormatError(f"{path} is included by itself.")
    text = reading.read_bytes(path)
    try:
        root = xml.fromstring(text)
    except (xml.ParseError, *reading.UNREADABLE) as error:
        raise FormatError(f"{path} cannot be read as XML: {error}.") from error
    if root.tag not in ("mujoco", "mujocoinclude", "robot"):
        raise FormatError(f"{path} is no MJCF: its root is <{root.tag[:40]}>.")
    folders = _folders(root, path.parent)
    level: list[tuple[xml.Element, float]] = [(root, 1.0)]
    copies = 0.0
    for nesting in range(reading.DEEPEST + 1):
        if not level:
            return
        if nesting == reading.DEEPEST:
            raise FormatError(f"{path} is nested deeper than {nesting} levels.")
        deeper = []
        for element, times in level:
            asked = times * _asked(element, path)
            copies += asked if element.tag in ("replicate", "composite") else 0
            if asked > MOST or copies > COPIES:
                raise FormatError(
                    f"{path}: <{element.tag}> asks for {asked:.3g} parts, "
                    f"{min(MOST, COPIES) if copies > COPIES else MOST} is the most."
                )
            _check_file(element, folders, path, depth)
            inner = asked if element.tag == "replicate" else times
            deeper += [(child, inner) for child in element]
        level = deeper


def _asked(element: xml.Element, path: Path) -> float:
    """How many parts an element asks for."""
    if element.tag == "size":
        _check_size(element, path)
    asked = 1.0
    for name in PRODUCTS.get(element.tag, ()):
        for word in element.get(name, "").split():
            asked *= max(1.0, abs(_number(word, element, path)))
    return asked


def _number(word: str, element: xml.Element, path: Path) -> float:
    try:
        number = float(word)
    except ValueError:
        number = float("nan")
    if not abs(number) < float("inf"):
        raise FormatError(f"{path}: {word[:40]!r} in <{element.tag}> is no number.")
    return number


def _check_size(element: xml.Element, path: Path) -> None:
    """Stop at memory that no model needs.

    Raises:
        FormatError: it is asked for.
    """
    wanted = element.get("memory", "0").strip()
    unit = wanted[-1:].upper() if wanted[-1:].isalpha() else ""
    number = _number(wanted.rstrip("KMGTPEkmgtpe") or "0", element, path)
    asked = number * (1 << SHIFT.get(unit, 0))
    counts = [_number(element.get(name, "0"), element, path) for name in SIZES]
    if asked > MEMORY or max(counts) > MOST:
        raise FormatError(
            f"{path}: <size> asks for {max(asked, 8 * max(counts)):.3g} bytes, "
            f"{reading.size(MEMORY)} is the most."
        )


def _folders(root: xml.Element, home: Path) -> list[Path]:
    """Where the files that are named may lie."""
    given = [home]
    for compiler in root.iter("compiler"):
        for name in ("assetdir", "meshdir", "texturedir"):
            given.append(home / compiler.get(name, "."))
    return given


def _check_file(
    element: xml.Element, folders: list[Path], path: Path, depth: int
) -> None:
    """Stop at a named file that is no regular one.

    Raises:
        FormatError: it is none, or too large; one that is included asks for too much.
    """
    if element.tag not in ASSETS or not element.get("file"):
        return
    for folder in folders:
        try:
            there = (found := folder / element.get("file", "")).exists()
        except (OSError, ValueError):
            continue
        if there and element.tag == "include":
            return check(found, depth=depth + 1)
        if there:
            with reading.regular(found, most=reading.TEXT << 4):
                return


def robot_spec(
    robot: RobotModel, *, scene: bool, visuals: bool, options: Mapping[str, str]
) -> Any:
    """The robot's `mujoco.MjSpec`, its options applied.

    Args:
        robot: the robot's files and options.
        scene: with a floor, a light and a camera; False = the robot alone.
        visuals: with what only shows; False = see `strip`.
        options: chosen alternative by option; the others stay as in the file.

    Raises:
        UnknownNameError: an option or alternative that the robot does not offer.
        FormatError: a file that is missing or that MuJoCo cannot read.
    """
    for name, value in options.items():
        if name not in robot.options:
            raise UnknownNameError(f"option of {robot.name}", name, robot.options)
        if value not in robot.options[name].headings:
            raise UnknownNameError(name, value, robot.options[name].headings)
    file = robot.scene if scene else robot.xml
    spec = load(file)
    for name, value in options.items():
        for site, heading in robot.options[name].headings[value].items():
            _look(spec.site(site), np.radians(heading))
    if not visuals:
        strip(spec)
    return spec


def _look(site: Any, heading: float) -> None:
    """Turn a site so that its z axis is horizontal at `heading` [rad]."""
    half = np.sqrt(0.5)  # cos and sin of 90 / 2 deg, from straight up to the horizon
    cos, sin = np.cos(heading / 2), np.sin(heading / 2)
    site.alt.type = 0  # the quaternion holds, not the euler angles of the file
    site.quat = [half * cos, -half * sin, half * cos, half * sin]


def strip(spec: Any) -> None:
    """Delete what only shows: geoms that touch nothing, lights, cameras."""
    for geom in list(spec.geoms):
        if not (geom.contype or geom.conaffinity):
            spec.delete(geom)
    for item in [*spec.lights, *spec.cameras]:
        spec.delete(item)
