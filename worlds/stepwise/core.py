"""One robot in any world, one command at a time: `Stepwise`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.worlds import registry
from bns.worlds.checks import bounded
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial

CYCLES = {"light": 100, "hexapod": 11}
"""commands of an episode (thesis 5.2.2 and 7.2); elsewhere `NAVIGATION`"""

NAVIGATION = 20
"""commands of an episode of navigation; assumed"""

CYCLE = {"light": 0.4, "hexapod": 1.0}
"""s; duration of a command (thesis 5.2.2; walking commands end when the robot rests)"""

COMMAND = 0.8
"""s; duration of a command in navigation (the lab's preferred one)"""


class Stepwise:
    """One robot of a world that gets its commands one by one.

    A world with sessions goes on from the robot's own state. Any other is asked to run
    all commands so far, which gives the same, as worlds have no memory between calls.

    Args:
        world: registered name, or a world.
        damage: what is wrong with the robot, as `MujocoWorld` takes it; for a name.
        trial: number of the trial that each episode is, for damage with an onset.
        cycles: commands of an episode; None = as the world's experiments have.
        cycle: duration of each [s]; None = likewise.
        settings: further settings of the world; for a name.

    Raises:
        BnsError: settings that the world refuses.
    """

    def __init__(
        self,
        world: Any = "light",
        *,
        damage: Any = (),
        trial: int = 0,
        cycles: int | None = None,
        cycle: float | None = None,
        **settings: Any,
    ):
        if isinstance(world, str):
            settings = {"threads": 1, **settings}
            if "threads" not in registry.settings(world):
                settings.pop("threads")
            world = registry.make(world, damage=damage, **settings)
        elif damage or settings:
            raise BnsError("A world that is made already takes no damage or settings.")
        self.world, self.trial_number = world, int(bounded("trial", trial, 0, 1e9, "1"))
        cycles = CYCLES.get(world.name, NAVIGATION) if cycles is None else cycles
        cycle = CYCLE.get(world.name, COMMAND) if cycle is None else cycle
        self.cycles = int(bounded("cycles", cycles, 1, 1e6, "1"))
        self.cycle = bounded("cycle", cycle, 1e-3, 60.0, "s")
        self.model = models.robot(world.robot)
        self.seed = 0
        self._told: list[np.ndarray] = []
        self._session: Any = None
        self._row = 0  # of this robot in the session
        self._pose = np.zeros(len(POSE_CHANNELS))

    @property
    def command_channels(self) -> tuple[Channel, ...]:
        """What the robot is told, with units."""
        return tuple(Channel(*channel) for channel in self.model.channels)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest of each command, ``(C,)`` each, SI units."""
        commands = self.model.commands
        return np.array([c.low for c in commands]), np.array([c.high for c in commands])

    @property
    def count(self) -> int:
        """Commands done."""
        return len(self._told)

    def reset(self, seed: int = 0, start: Sequence[float] | None = None) -> Trial:
        """Begin an episode.

        Args:
            seed: of everything random, the start pose included where it is.
            start: pose [m, m, rad]; None = the world's.

        Returns:
            The trial so far: no command, one sample.

        Raises:
            BnsError: a seed that can not be; a start in a world that takes none for an
                episode.
        """
        return reset_all([self], [seed], start)[0]

    def step(self, command: np.ndarray) -> Trial:
        """Do one command.

        Args:
            command: shape ``(C,)``, SI units.

        Returns:
            The trial so far.

        Raises:
            BnsError: a command that the robot cannot be told, or no episode.
        """
        return step_all([self], [command])[0]

    @property
    def _loops(self) -> bool:
        return hasattr(self.world, "session")

    def _kept(self, trial: Trial) -> Trial:
        seen = trial.observed[-1, : len(POSE_CHANNELS)]
        self._pose = np.where(np.isfinite(seen), seen, self._pose)
        return trial

    def _list(self, told: Sequence[np.ndarray]) -> Commands:
        return Commands(
            np.stack(told), np.full(len(told), self.cycle), self.command_channels
        )

    def _first(self, trial: Trial) -> Trial:
        """A trial cut before its first command."""
        return trial.replace(
            commands=Commands(
                np.empty((0, len(self.command_channels))),
                np.empty(0),
                self.command_channels,
            ),
            times=trial.times[:1],
            observed=trial.observed[:1],
            boundaries=[0],
            outcome=type(trial.outcome)(),
            handled=np.zeros(0, bool),
        )

    def channels(self) -> tuple[Channel, ...]:
        """What is observed: the pose, then what else the world's trials have."""
        return self.reset(self.seed).channels

    def state(self) -> np.ndarray | None:
        """Physics state of the robot now, ``(nstate,)``; None without a session."""
        if self._session is None:
            return None
        now = self._session.cycle * self._session.setting.steps
        return self._session.states[self._row, now]

    def pose(self) -> np.ndarray:
        """Where the robot was seen last, ``(3,)`` [m, m, rad]; before all: zeros."""
        return self._pose

    def picture(self, size: tuple[int, int] = (480, 320)) -> np.ndarray:
        """The arena as it is, from the camera `perspective`, ``(height, width, 3)``."""
        from bns.worlds.stepwise.look import picture

        return picture(self, size)


def reset_all(
    steppers: Sequence[Stepwise],
    seeds: Sequence[int],
    start: Sequence[float] | None = None,
) -> list[Trial]:
    """Begin an episode of each of several robots of one world, in one batch.

    Args:
        steppers: all of one world and with equal settings.
        seeds: of each, see `Stepwise.reset`.
        start: of all, see `Stepwise.reset`.

    Returns:
        their trials so far: no command, one sample.

    Raises:
        BnsError: as `Stepwise.reset`.
    """
    first, world = steppers[0], steppers[0].world
    for stepper, seed in zip(steppers, seeds, strict=True):
        stepper.seed = int(bounded("seed", seed, 0, 2**63, "1"))
        stepper._told = []
    drawn = [stepper.seed for stepper in steppers]
    if first._loops:
        session = world.session(
            cycles=first.cycles,
            cycle=first.cycle,
            trial=first.trial_number,
            seeds=drawn,
            starts=None
            if start is None
            else np.tile(np.asarray(start, np.float64), (len(drawn), 1)),
        )
        for row, stepper in enumerate(steppers):
            stepper._session, stepper._row = session, row
        made = world.trials(session)
    elif start is not None:
        raise BnsError(
            f"World {world.name!r} takes no start for an episode; make it with the "
            "setting `start`."
        )
    else:
        idle = first._list([np.zeros(len(first.bounds[0]))])
        run = world.run([idle] * len(drawn), trial=first.trial_number, seeds=drawn)
        made = [first._first(trial) for trial in run]
    return [s._kept(trial) for s, trial in zip(steppers, made, strict=True)]


def step_all(
    steppers: Sequence[Stepwise], commands: Sequence[np.ndarray]
) -> list[Trial]:
    """Do one command of each of several robots of one world, in one batch.

    Robots whose episodes began together and that are not given are told nothing: their
    episodes are over.

    Args:
        steppers: all of one world and with equal settings.
        commands: of each, shape ``(C,)``, SI units.

    Returns:
        their trials so far.

    Raises:
        BnsError: a command that a robot cannot be told, or no episode.
    """
    told = [np.asarray(command, dtype=np.float64) for command in commands]
    if steppers[0]._loops:
        made = _looped(steppers, told)
    else:
        for stepper in steppers:
            if stepper.count >= stepper.cycles:
                raise BnsError(
                    f"The {stepper.cycles} cycles of this trial are over; begin "
                    "another."
                )
        lists = [s._list([*s._told, c]) for s, c in zip(steppers, told, strict=True)]
        number, seeds = steppers[0].trial_number, [s.seed for s in steppers]
        made = steppers[0].world.run(lists, trial=number, seeds=seeds)
    for stepper, command in zip(steppers, told, strict=True):
        stepper._told.append(command)
    return [s._kept(trial) for s, trial in zip(steppers, made, strict=True)]


def _looped(steppers: Sequence[Stepwise], told: Sequence[np.ndarray]) -> list[Trial]:
    """A command in each of the sessions that robots are in."""
    sessions = {id(stepper._session): stepper._session for stepper in steppers}
    if None in sessions.values():
        raise BnsError("There is no episode to go on with; call reset first.")
    trials: dict[int, list[Trial]] = {}
    for key, session in sessions.items():
        commands = np.zeros((len(session.seeds), len(session.setting.channels)))
        for stepper, command in zip(steppers, told, strict=True):
            if stepper._session is session:
                commands[stepper._row] = command
        session.step(commands)
        trials[key] = steppers[0].world.trials(session)
    return [trials[id(stepper._session)][stepper._row] for stepper in steppers]
