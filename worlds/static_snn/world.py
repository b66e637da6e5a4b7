"""The static-SNN world: fixed networks as reality, the dissertation's own choice."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np

from bns import models, seeding
from bns.errors import BnsError
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.physics import control, observe
from bns.worlds.static_snn.nets import StaticNets, kinematic_nets
from bns.worlds.trial import Commands, Outcome, Trial

STAGES = ("command", "actuator", "tracking")
STEP = 0.005  # [s] grid on which effects change the commands; the physics step


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
