"""Fixed networks that stand for a world: what each command does, learned once."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from bns import seeding
from bns.errors import BnsError, FormatError
from bns.storage import arrays as npz
from bns.storage import reading
from bns.storage.reading import BEYOND

SCHEMA, VERSION = "bns-static-nets", 1
INPUTS, OUTPUTS = 5, 3
_ARRAYS = ("w1", "b1", "w2", "b2", "input_scale", "output_scale")


class Header(msgspec.Struct):
    """What a file of networks says of them, beside its schema and version."""

    provenance: dict[str, Any] = {}
    activation: Literal["sigmoid", "relu"] = "sigmoid"


@dataclass(frozen=True, eq=False)
class StaticNets:
    """Three networks with one hidden layer of H neurons, one output each.

    Inputs: the previous command, the command, and where robots have wheels its
    duration [s]; so I = 5 for two wheels [m/s], 36 for eighteen servos [rad].
    Outputs: forward, left [m], turn [rad] in the body frame at the command's start
    (dissertation, Figure 4.4). Output k is

        output_scale[k] * (w2[k] . active((input_scale * inputs) @ w1[k] + b1[k])
                           + b2[k])

    Attributes:
        w1: ``(3, I, H)``, inputs by hidden neurons.
        b1: ``(3, H)``.
        w2: ``(3, H)``.
        b2: ``(3,)``.
        input_scale: ``(I,)`` [1/unit of the input].
        output_scale: ``(3,)`` [m, m, rad].
        provenance: where they come from; kept in the file.
        activation: of the hidden neurons, logistic or rectified.

    Raises:
        BnsError: shapes disagree, or a number is not finite.
    """

    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray
    input_scale: np.ndarray
    output_scale: np.ndarray
    provenance: Mapping[str, Any] = field(default_factory=dict)
    activation: Literal["sigmoid", "relu"] = "sigmoid"

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        hidden = self.w2.shape[-1] if self.w2.ndim else 0
        count = self.inputs
        shapes = ((3, count, hidden), (3, hidden), (3, hidden), (3,), (count,), (3,))
        for name, shape in zip(_ARRAYS, shapes, strict=True):
            array = getattr(self, name)
            if array.shape != shape:
                raise BnsError(
                    f"StaticNets.{name} has shape {array.shape}, it needs {shape}."
                )
            if not np.isfinite(array).all():
                raise BnsError(f"StaticNets.{name} holds NaN or infinity.")

    @property
    def inputs(self) -> int:
        """How many, I."""
        return self.input_scale.size

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Displacements of commands.

        Args:
            inputs: ``(K, I)``, see the class.

        Returns:
            ``(K, 3)``: forward, left [m], turn [rad].
        """
        scaled = inputs * self.input_scale
        drive = np.einsum("ki,gih->gkh", scaled, self.w1) + self.b1[:, None]
        if self.activation == "relu":
            active = np.maximum(drive, 0.0)
        else:
            active = 0.5 * (1 + np.tanh(0.5 * drive))  # logistic, without overflow
        raw = np.einsum("gkh,gh->kg", active, self.w2) + self.b2
        return raw * self.output_scale

    def save(self, path: str | Path) -> None:
        """Write them to a file `path` (npz); refuses an existing one.

        Raises:
            BnsError: the file exists.
        """
        header = {
            "schema": SCHEMA,
            "version": VERSION,
            "provenance": dict(self.provenance),
        }
        if self.activation != "sigmoid":
            header["activation"] = self.activation
        if Path(path).exists():
            raise BnsError(f"{path} exists and is not overwritten; take another name.")
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        arrays["header"] = np.array(json.dumps(header, sort_keys=True))
        npz.write_npz(Path(path), arrays)

    @classmethod
    def load(cls, path: str | Path) -> "StaticNets":
        """Read what `save` wrote.

        Raises:
            FormatError: no such file, or not one of this kind and version.
        """
        arrays = npz.read_npz(path, most=reading.TEXT << 4)
        if "header" not in arrays:
            raise FormatError(
                f"{path} is no file of static networks; make one with StaticNets.save."
            )
        header = reading.json(str(arrays.pop("header")), path)
        _check_header(header, path)
        if set(arrays) != set(_ARRAYS):
            raise FormatError(
                f"{path} holds {', '.join(sorted(arrays))}; static networks are "
                f"{', '.join(_ARRAYS)}."
            )
        said = reading.typed(header, Header, path)
        for name, array in arrays.items():
            if array.dtype != np.float64:
                raise FormatError(f"{path}: {name} is {array.dtype}, not float64.")
            if not (np.abs(array) <= BEYOND).all():
                raise FormatError(f"{path}: {name} holds NaN or more than {BEYOND:g}.")
        try:
            return cls(**arrays, provenance=said.provenance, activation=said.activation)
        except BnsError as error:
            raise FormatError(f"{path}: {error}") from error


def _check_header(header: object, path: str | Path) -> None:
    given = header if isinstance(header, dict) else {}
    if given.get("schema") != SCHEMA:
        raise FormatError(
            f"{path} says schema {given.get('schema')!r}, not {SCHEMA!r}."
        )
    if given.get("version") != VERSION:
        raise FormatError(
            f"{path} has version {given.get('version')}; this release reads {VERSION}."
        )


def kinematic_nets(
    *,
    axle: float = 0.0884,
    top_speed: float = 0.1215,
    longest: float = 3.1,
    hidden: int = 200,
    patterns: int = 4000,
    seed: int = 0,
) -> StaticNets:
    """Networks that drive like an ideal two-wheeled robot.

    A stand-in until networks have been trained from trials: random hidden neurons,
    output weights by least squares to the closed form. It knows no acceleration.

    Args:
        axle: distance between the wheels [m]; Khepera III.
        top_speed: speeds are fitted up to this magnitude [m/s]; 17,500 speed units.
        longest: durations are fitted up to this [s].
        hidden: neurons per network.
        patterns: random commands for the fit.
        seed: of neurons and commands.
    """
    rng = seeding.generator(seed, "kinematic-nets")
    speeds = rng.uniform(-top_speed, top_speed, (patterns, 4))
    inputs = np.column_stack([speeds, rng.uniform(0, longest, patterns)])
    wanted = _differential_drive(inputs, axle)
    input_scale = 1 / np.array([top_speed] * 4 + [longest])
    output_scale = np.abs(wanted).max(axis=0)
    w1 = rng.normal(0, 2.0, (INPUTS, hidden))
    w1[:2] = 0.0  # an ideal robot forgets the previous command
    b1 = rng.normal(0, 2.0, hidden)
    drive = (inputs * input_scale) @ w1 + b1
    active = np.column_stack([1 / (1 + np.exp(-drive)), np.ones(patterns)])
    fit = np.linalg.lstsq(active, wanted / output_scale, rcond=1e-9)[0]
    return StaticNets(
        w1=np.tile(w1, (OUTPUTS, 1, 1)),
        b1=np.tile(b1, (OUTPUTS, 1)),
        w2=fit[:-1].T,
        b2=fit[-1],
        input_scale=input_scale,
        output_scale=output_scale,
        provenance={"origin": "ideal two-wheeled robot", "axle": axle},
    )


def _differential_drive(inputs: np.ndarray, axle: float) -> np.ndarray:
    """Displacement ``(K, 3)`` of inputs ``(K, 5)`` in closed form."""
    left, right, duration = inputs[:, 2:].T
    turn = (right - left) / axle * duration
    way = (left + right) / 2 * duration
    half = turn / 2
    chord = way * np.sinc(half / np.pi)
    return np.column_stack([chord * np.cos(half), chord * np.sin(half), turn])
