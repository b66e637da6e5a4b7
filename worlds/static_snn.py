"""The static-SNN world: fixed networks as reality, the dissertation's own choice."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

import msgspec
import numpy as np

from bns import models, seeding
from bns.errors import BnsError, FormatError
from bns.storage import arrays as npz
from bns.storage import reading
from bns.storage.reading import BEYOND
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.physics import control, observe
from bns.worlds.trial import Commands, Outcome, Trial

STAGES = ("command", "actuator", "tracking")
STEP = 0.005  # [s] grid on which effects change the commands; the physics step
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


class StaticSnnWorld:
    """Fixed networks, trained from any world's trials, that say what a command does.

    Each command's displacement depends on it and on the one before; the path is their
    sum. The robot is seen at the end of each command only. A command that an effect
    changes partly acts with its mean. Body effects cannot be represented. A robot with
    legs stands half-way before its first command, unless an effect holds it otherwise.

    Args:
        nets: the networks, or a file of them; None = an ideal two-wheeled robot (one
            with legs has no such default).
        robot: name of the robot model whose commands they take.
        damage: as in `MujocoWorld`, command, actuator and tracking effects only.
        reality: effects that always hold (unless they have a schedule), likewise.
        start: pose at the start of each trial in the world frame [m, m, rad].
        noise: standard deviation of a displacement, forward, left [m], turn [rad].
        arena: size of the board along x and y [m], its centre the world's origin.
        name: name of the world in the trials.

    Raises:
        UnknownNameError: no such robot or effect.
        OutOfBoundsError: a number outside its bounds, a start outside the arena.
        BnsError: an effect that this world cannot represent, networks of another robot.
        FormatError: `nets` is not a file of static networks.
    """

    def __init__(
        self,
        nets: StaticNets | str | Path | None = None,
        robot: str = "khepera3",
        *,
        damage: Damage | Sequence = (),
        reality: Damage | Sequence = (),
        start: Sequence[float] = (0.0, 0.0, 0.0),
        noise: Sequence[float] = (0.0, 0.0, 0.0),
        arena: Sequence[float] = (2.7, 1.8),
        name: str = "static-snn",
    ):
        self.model = models.robot(robot)
        self.robot, self.name = robot, name
        self._legged = self.model.kind == "legged"
        self.nets = _nets(nets, robot, self.model.channels, self._legged)
        self._limits = self.model.ranges if self._legged else self.model.limits
        self.damage = active.per_robot(damage)
        self.reality = active.as_damage(reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            active.refuse(item, stages=STAGES, kind=self.model.kind, world=name)
        self.arena = (float(arena[0]), float(arena[1]))
        self.start = checked_start(start, self.arena)
        units = ("m", "m", "rad")
        self.noise = np.array(
            [bounded("noise", s, 0, 1, u) for s, u in zip(noise, units, strict=True)]
        )

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on each of N robots, see `World.run`.

        Args:
            commands: N lists of commands, one a robot.
            trial: number of this trial, counted from 0.
            seeds: of what is random, one a robot; empty means 0, 1, 2, ...

        Raises:
            BnsError: numbers of commands, seeds and damages disagree; commands that
                the robot cannot be told.
        """
        damages, seeds = shared(self.damage, seeds, len(commands))
        return [
            self._run(item, damage, trial, seed)
            for item, damage, seed in zip(commands, damages, seeds, strict=True)
        ]

    def having(self, damages: Sequence[Damage]) -> Self:
        """The same world with other damage, see `active.having`."""
        return active.having(self, damages, STAGES, self.model.kind)

    def _run(self, commands: Commands, damage: Damage, trial: int, seed: int) -> Trial:
        control.check(commands, self.model.channels, self._limits, self.robot)
        stages = Stages.of(self.reality, damage, trial, commands.duration)
        moved = self.nets(self._inputs(commands, stages, seed, trial))
        if self.noise.any():
            rng = seeding.generator(seed, "world", trial, "static-snn")
            moved = moved + self.noise * rng.standard_normal(moved.shape)
        poses = _path(moved, self.start)
        times = np.concatenate([[0.0], np.cumsum(commands.durations)])
        stamps, seen = observe.tracked(
            poses, times, poses, times, stages.tracking, seed, trial
        )
        outside = np.abs(poses[:, :2]) > np.asarray(self.arena) / 2
        finite = bool(np.isfinite(poses).all())
        return Trial(
            commands=commands,
            times=stamps,
            observed=seen,
            boundaries=np.arange(len(times)),
            outcome=Outcome(left_arena=bool(outside.any()), diverged=not finite),
            robot=self.robot,
            world=self.name,
            conditions=stages.conditions(trial, seed),
        )

    def _inputs(
        self, commands: Commands, stages: Stages, seed: int, trial: int
    ) -> np.ndarray:
        """What the networks get for each command, ``(K, I)``."""
        told = _told(commands, stages, seed, trial)
        home = np.zeros((1, told.shape[1]))
        if not self._legged:
            before = np.vstack([home, told[:-1]])
            return np.column_stack([before, told, commands.durations])
        still = Commands(home, [STEP], commands.channels)
        home = _told(still, stages, seed, trial)
        return np.column_stack([np.vstack([home, told[:-1]]), told])


def _nets(
    nets: StaticNets | str | Path | None, robot: str, channels: Sequence, legged: bool
) -> StaticNets:
    """The networks of a robot.

    Raises:
        BnsError: there are none, or they are those of another robot.
    """
    if nets is None and legged:
        raise BnsError(
            f"Robot {robot!r} has no ideal networks: give `nets`, such as those of "
            "bns.experiment.static_snn.nets_for, or run `bns run hexapod-walk "
            "--world.name static-snn`, which trains them."
        )
    found = kinematic_nets() if nets is None else nets
    found = found if isinstance(found, StaticNets) else StaticNets.load(found)
    wanted = 2 * len(channels) + (not legged)
    if found.inputs != wanted:
        raise BnsError(
            f"The networks have {found.inputs} inputs, robot {robot!r} needs {wanted}: "
            "give those that were trained for it."
        )
    return found


def _told(commands: Commands, stages: Stages, seed: int, trial: int) -> np.ndarray:
    """Mean values of each command after the effects, shape ``(K, C)``."""
    if not stages.control:
        return commands.values
    counts = control.steps(commands.durations, STEP)
    signal = control.signal(commands, counts, STEP)
    values = control.disturbed(signal, stages.control, seed, trial)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # Relative to the first step, so that a constant is met without rounding.
    return (
        values[first]
        + np.add.reduceat(values - values[first][signal.command], first)
        / counts[:, None]
    )


def _path(moved: np.ndarray, start: tuple[float, float, float]) -> np.ndarray:
    """Poses ``(K + 1, 3)`` from displacements in the body frame, ``(K, 3)``."""
    yaw = start[2] + np.concatenate([[0.0], np.cumsum(moved[:, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    forward, left = moved[:, 0], moved[:, 1]
    x = start[0] + np.concatenate([[0.0], np.cumsum(cos * forward - sin * left)])
    y = start[1] + np.concatenate([[0.0], np.cumsum(sin * forward + cos * left)])
    return np.column_stack([x, y, yaw])
