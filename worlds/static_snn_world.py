"""The static-SNN world: fixed networks as reality, the dissertation's own choice."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bns import models, seeding
from bns.worlds import active, control, observe
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.static_nets import StaticNets, kinematic_nets
from bns.worlds.trial import Commands, Outcome, Trial

STAGES = ("command", "actuator", "tracking")
STEP = 0.005  # [s] grid on which effects change the commands; the physics step


class StaticSnnWorld:
    """Fixed networks, trained from any world's trials, that say what a command does.

    Each command's displacement depends on it and on the one before; the path is their
    sum. The robot is seen at the end of each command only. A command that an effect
    changes partly acts with its mean. Body effects cannot be represented.

    Args:
        nets: the networks, or a file of them; None = an ideal two-wheeled robot.
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
        BnsError: an effect that this world cannot represent.
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
        if nets is None:
            nets = kinematic_nets()
        self.nets = nets if isinstance(nets, StaticNets) else StaticNets.load(nets)
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

        Raises:
            BnsError: numbers of commands, seeds and damages disagree; commands that
                the robot cannot be told.
        """
        damages, seeds = shared(self.damage, seeds, len(commands))
        return [
            self._run(item, damage, trial, seed)
            for item, damage, seed in zip(commands, damages, seeds, strict=True)
        ]

    def _run(self, commands: Commands, damage: Damage, trial: int, seed: int) -> Trial:
        control.check(commands, self.model.channels, self.model.limits, self.robot)
        stages = Stages.of(self.reality, damage, trial, commands.duration)
        speeds = _speeds(commands, stages, seed, trial)
        before = np.vstack([np.zeros((1, 2)), speeds[:-1]])
        moved = self.nets(np.column_stack([before, speeds, commands.durations]))
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


def _speeds(commands: Commands, stages: Stages, seed: int, trial: int) -> np.ndarray:
    """Mean speeds of each command after the effects, shape ``(K, 2)`` [m/s]."""
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
