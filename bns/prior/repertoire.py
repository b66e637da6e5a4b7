"""Repertoires: many different controllers of a robot, each with what it achieves.

A repertoire is one NPZ file: the elites of a grid (`bns.prior.archive`), and a head
that says of which robot and model they are, what was spent and how the grid grew.
Those that ship lie in `bns/prior/data`; a path names one of a user's own. Genes are
kept in `LEVELS` steps of their range, so that a file is small and exact.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.experiment import robots
from bns.experiment.config import RunConfig
from bns.experiment.validate import leaves
from bns.storage import arrays, reading
from bns.tasks import registry as tasks
from bns.tasks.base import Space, Task

DATA = Path(__file__).parent / "data"
LEVELS = 250
MOST = 64 << 20
"""bytes that a repertoire's arrays may have"""


class Head(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """What a repertoire is of, and how it was made.

    Attributes:
        schema: of the file.
        command: that made it.
        task: by name.
        robot, model: by name, and `robots.digest` of its files.
        world, step, reality: in which it was made; step of the physics [s], 0 = the
            model's own.
        genotype: which of `Task.genotypes` its genes are of.
        behaviour: what its grid is along.
        bins: of the grid.
        controllers: settings on which it depends what genes mean.
        seed: of all that was drawn.
        evaluations: executions of the model.
        growth: after so many evaluations: cells, best worth, worth of all together.
        versions: of what can move a result.
        sha256: of the arrays.
    """

    schema: int
    command: str
    task: str
    robot: str
    model: str
    world: str
    step: float
    reality: list[str]
    genotype: str
    behaviour: str
    bins: int
    controllers: dict[str, Any]
    seed: int
    evaluations: int
    growth: list[tuple[int, int, float, float]]
    versions: dict[str, str]
    sha256: str


@dataclass(frozen=True, eq=False)
class Repertoire:
    """Elites and where they come from.

    Attributes:
        head: of the file.
        genes: shares of each gene's range, ``(N, D)``.
        behaviours: ``(N, B)``, each from 0 to 1.
        worth: in the model, ``(N,)``; higher is better.
    """

    head: Head
    genes: np.ndarray
    behaviours: np.ndarray
    worth: np.ndarray

    def __len__(self) -> int:
        return len(self.worth)

    def space(self, task: Task) -> Space:
        """The controllers of its genes.

        Raises:
            UnknownNameError: the task has no such genotype.
        """
        known = task.genotypes
        if self.head.genotype not in known:
            raise UnknownNameError("genotype", self.head.genotype, known)
        return known[self.head.genotype]

    def vectors(self, task: Task) -> np.ndarray:
        """All elites as vectors of `space`, ``(N, D)``."""
        space = self.space(task)
        found: np.ndarray = space.low + self.genes * (space.high - space.low)
        return found


def quantised(genes: np.ndarray) -> np.ndarray:
    """Genes ``(N, D)`` as files keep them: the nearest of `LEVELS` steps."""
    found: np.ndarray = np.rint(genes * LEVELS) / LEVELS
    return found


def controllers(config: RunConfig) -> dict[str, Any]:
    """The settings on which it depends what a vector means, by dotted name."""
    task = tasks.of(config)
    wanted = task.makes_controllers or task.sections
    return {
        name: value
        for name, value in leaves(config)
        if name in wanted or name.partition(".")[0] in wanted
    }


def names() -> tuple[str, ...]:
    """Repertoires that ship, sorted."""
    return tuple(sorted(path.stem for path in DATA.glob("*.npz")))


def path(name: str) -> Path:
    """The file of a repertoire that ships, or of one of a user's own.

    Raises:
        UnknownNameError: neither.
    """
    own = Path(name)
    if own.suffix == ".npz" and own.exists():
        return own
    if name not in names():
        raise UnknownNameError(
            "repertoire", name, names(), "A file of your own: give PATH.npz."
        )
    return DATA / f"{name}.npz"


def write(file: Path, head: Mapping[str, Any], held: Mapping[str, np.ndarray]) -> None:
    """Write a repertoire, whole or not at all; the same one gives the same bytes.

    Args:
        file: to be written.
        head: as `Head`, without `schema` and `sha256`.
        held: `Archive.state`; genes have to be `quantised`.

    Raises:
        StorageError: no space, or no permission.
    """
    packed = {
        "genes": np.rint(held["genes"] * LEVELS).astype(np.uint8),
        "behaviours": held["behaviours"].astype(np.float32),
        "worth": held["worth"].astype(np.float32),
    }
    told = {"schema": 1, **head, "sha256": _digest(packed)}
    text = json.dumps(told, allow_nan=False, sort_keys=True).encode()
    packed["head"] = np.frombuffer(text, np.uint8)
    arrays.write_npz(file, packed, compressed=True)


def read(name: str | Path) -> Repertoire:
    """A repertoire by name or path, its head compared with what it holds.

    Raises:
        UnknownNameError: there is none.
        FormatError: damaged, or no repertoire.
    """
    file = path(str(name))
    stat = file.stat()
    return _read(file, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=8)
def _read(file: Path, changed: int, size: int) -> Repertoire:
    """As `read`; a file that has changed since is read anew."""
    del changed, size
    held = arrays.read_npz(file, most=MOST)
    try:
        head = _head(bytes(held.pop("head")))
        genes, behaviours, worth = (
            held[name] for name in ("genes", "behaviours", "worth")
        )
        fits = genes.ndim == behaviours.ndim == 2 and worth.ndim == 1
        alike = {len(genes), len(behaviours), len(worth)} == {len(worth)}
    except (KeyError, *reading.UNREADABLE) as error:
        raise FormatError(
            f"{file} is no repertoire: {error}. Make one by `bns repertoire make`."
        ) from error
    if not (fits and alike and len(worth)) or head.sha256 != _digest(held):
        raise FormatError(
            f"{file} is damaged: it does not hold what its head says. Make it anew by "
            f"`{head.command}`."
        )
    shares = genes.astype(np.float64) / LEVELS
    return Repertoire(head, shares, behaviours.astype(float), worth.astype(float))


def _head(text: bytes) -> Head:
    return msgspec.json.decode(text, type=Head)


def _digest(held: Mapping[str, np.ndarray]) -> str:
    found = hashlib.sha256()
    for name in ("genes", "behaviours", "worth"):
        array = np.ascontiguousarray(held[name])
        found.update(f"{name}{array.shape}{array.dtype}".encode() + array.tobytes())
    return found.hexdigest()


def check(found: Repertoire, config: RunConfig) -> Repertoire:
    """The repertoire, if it is of a configuration's task, robot and controllers.

    Raises:
        BnsError: it is of another robot, model, task or kind of controllers.
    """
    head, robot = found.head, config.world.robot
    again = "make one by `bns repertoire make`, or take another (`bns repertoire list`)"
    kinds = [tasks.kind(name) for name in (head.task, config.task.name)]
    if kinds[0] != kinds[1]:
        raise BnsError(
            f"The repertoire is of the task {head.task!r}, not of "
            f"{config.task.name!r}: {again}."
        )
    if head.robot != robot:
        raise BnsError(
            f"The repertoire is of {head.robot!r}, not of {robot!r}: {again}."
        )
    if head.model != robots.digest(robot):
        raise BnsError(
            f"The repertoire is of another model of {robot!r} than the one here, which "
            f"was changed since: {again}."
        )
    here = json.loads(json.dumps(controllers(config)))
    for name, value in here.items():
        if head.controllers.get(name) != value:
            raise BnsError(
                f"The repertoire was made with {name} = {head.controllers.get(name)!r},"
                f" not {value!r}: {again}."
            )
    return found


def growth(rows: Sequence[Sequence[float]], most: int = 12) -> list[Sequence[float]]:
    """A few rows of a growth curve, the last one among them."""
    if len(rows) <= most:
        return list(rows)
    places = np.unique(np.geomspace(1, len(rows), most).round().astype(int) - 1)
    return [rows[int(place)] for place in places]
