"""A walking robot as a nominal model for the diagnosis: `WalkModel`.

The recorded goals are executed again, each as long as it took in the recording. What is
compared is each servo's position, which its own loop holds so that errors do not add
up, and the body's motion over short windows, in its own frame.
"""

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.candidates import legged
from bns.gap.decomposition.row import Row
from bns.gap.models.base import Windows
from bns.gap.models.legged import scatter
from bns.gap.models.legged import signs as walk_signs
from bns.gap.models.legged.signs import Signs
from bns.gap.models.library import LibraryModel
from bns.gap.recordings import segments
from bns.gap.recordings.trial_conditions import as_number
from bns.worlds.active import Stages, as_damage
from bns.worlds.damage import Damage
from bns.worlds.effects.base import Effect
from bns.worlds.physics import legged_plan, observe
from bns.worlds.physics.legged_world import SPEED, HexapodWorld
from bns.worlds.physics.rollout import walk
from bns.worlds.trial import Channel, Trial, body_displacement

WINDOW = 0.12  # [s] over which the body's motion is compared
TRACKER = (1e-3, 1e-3, 1e-2)  # [m, m, rad] noise of the tracker; assumed
READING = 2e-3  # [rad] of a servo's reading, which comes in steps of 5.1 mrad
SCATTER = (2e-3, 2e-3, 0.01)  # [m, m, rad per root second] of a walking body; assumed
SLIPS = (1e-3, 1e-3, 5e-3)  # [m, m, rad] of a step although all is as told; assumed
SPREAD = (0.4, 1.3)  # plausible departures: feet come down elsewhere soon
WOBBLE = 3e-3  # [rad per root second] of a joint; assumed


class WalkModel(LibraryModel):
    """A hexapod in MuJoCo whose servos report their positions, see `GapModel`.

    Args:
        robot: name of the robot model, of kind "legged".
        pose_sd: noise of the tracker [m, m, rad].

    Raises:
        BnsError: the robot does not walk.
    """

    timed = False  # commands last until the robot rests, not as long as they are told
    starts = 8
    singly = True
    spread = SPREAD
    odds = 6.0  # against each of some four hundred

    def __init__(self, robot: str = "phantomx", *, pose_sd: Sequence[float] = TRACKER):
        world = HexapodWorld(robot, threads=1)
        self.name, self.dt = robot, world.dt
        self.channels = tuple(world.channels)
        joints = self.channels[3:]
        self.joints = tuple(c.name.removesuffix("_position") for c in joints)
        self.limits = {
            channel.name: (float(low), float(high), channel.unit)
            for channel, (low, high) in zip(
                world.model.commands, _ranges(world), strict=True
            )
        }
        self.features = (
            Channel("forward", "m"),
            Channel("left", "m"),
            Channel("turn", "rad"),
            *joints,
        )
        self.process = np.array([*SCATTER, *[WOBBLE] * len(joints)])
        self._walks: dict[bytes, np.ndarray] = {}
        self.resolution = np.array([*pose_sd, *[READING] * len(joints)])

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature."""
        moved = np.hypot(self.resolution[:3], SLIPS)
        return np.concatenate([moved, self.resolution[3:]])

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """Numbers of the joints and legs in which recordings depart, and of all."""
        (predicted,) = self.simulate(trials, [()])
        signs = self.signs(trials, predicted)
        rests = [
            trial.observed[:, 3:] - path[:, 3:]
            for trial, path in zip(trials, predicted, strict=True)
        ]
        lost = scatter.likely(trials, legged.lost(signs), self.simulate)
        self._scatter(trials, lost)
        walks = [self._walks[_key(trial)][..., 3:] for trial in trials]
        rests = scatter.without(rests, walks, WOBBLE)
        found = walk_signs.suspects(rests, self.joints, READING)
        listed = legged.rows(found, self.joints, signs)
        return self.remembered((*legged.known(listed), *scatter.rows()))

    def _scatter(self, trials: Sequence[Trial], lost: Sequence[Effect]) -> None:
        """Simulate the robots that this one may be, see `scatter`."""
        drawn = scatter.robots(legged.unsure(self.joints))
        sets = [lost, *((*robot, *lost) for robot in drawn)]
        midst, *walks = self.simulate(trials, sets)
        for number, trial in enumerate(trials):
            made = np.stack([walk[number] - midst[number] for walk in walks])
            self._walks[_key(trial)] = np.nan_to_num(made)

    def beside(
        self, trials: Sequence[Trial], known: Sequence[Mapping[str, float]]
    ) -> tuple["WalkModel", Sequence[Trial]]:
        """See `GapModel.beside`: a robot whose commands come late, or that slips, puts
        its feet down elsewhere, and so do the walks that it may do as well."""
        made = copy.copy(self)
        made._walks = {}
        for trial, values in zip(trials, known, strict=True):
            made._scatter([trial], self._effects(scatter.bare(values)))
        return made, trials

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`: what walks scatter is added to what effects do."""
        own = [[scatter.bare(values) for values in row] for row in sets]
        made = super().paths(trials, own, fine=fine)
        for paths, values in zip(made, sets, strict=True):
            for at, (trial, row) in enumerate(zip(trials, values, strict=True)):
                shares = {scatter.number(n): v for n, v in row.items()}
                shares.pop(-1, None)
                if shares:
                    walks = self._walks[_key(trial)][list(shares)]
                    off = np.tensordot(list(shares.values()), walks, axes=1)
                    paths[at] = paths[at] + off
        return made

    def signs(self, trials: Sequence[Trial], predicted: Sequence[np.ndarray]) -> Signs:
        """What the servos say of joints and legs that hold, hang or are gone.

        Args:
            trials: recorded trials.
            predicted: observations by the nominal model, ``(T, n_channels)`` each.
        """
        return walk_signs.signs(trials, predicted, self.joints)

    def at_rest(self, trial: Trial, predicted: np.ndarray) -> frozenset[str]:
        """See `GapModel.at_rest`: joints that hold, hang or are gone."""
        joints = self.signs([trial], [predicted]).joints
        return frozenset(f"{name}_position" for name in joints)

    def blocks(self, trials: Sequence[Trial], windows: Sequence[Windows]) -> np.ndarray:
        """Commands of each trial: a robot rests between them, so that what it scatters
        in one does not go on into the next."""
        made, first = [], 0
        for trial, parts in zip(trials, windows, strict=True):
            ends = trial.times[trial.boundaries[1:]]
            number = np.minimum(np.searchsorted(ends, parts.times), len(ends) - 1)
            made.append(first + number)
            first += len(ends)
        return np.unique(np.concatenate(made), return_inverse=True)[1]

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: poses [m, m, rad] and servo positions [rad]."""
        return [[self._walked(trial, items) for trial in trials] for items in effects]

    def _walked(self, trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
        times = trial.times - trial.times[trial.boundaries[0]]
        counts = np.diff(np.rint(times[trial.boundaries] / self.dt)).astype(np.int64)
        start = (0.0, 0.0, _heading(trial) if _sloping(effects) else 0.0)
        stages = Stages.of(as_damage(effects), Damage.none(), 0, times[-1])
        job, servos = legged_plan.job(
            self.name,
            trial.commands,
            stages,
            start=start,
            speed=as_number(trial.conditions, "speed", SPEED),
            seed=0,
            trial=0,
            counts=np.maximum(counts, 1),
        )
        states = walk(job).states
        poses = observe.planar(states[:, 1:8], start[2])
        angles = states[:, servos.angles] + servos.laws["offset"]
        grid = np.arange(len(states)) * self.dt
        both = np.column_stack([poses, angles])
        return np.stack([np.interp(times, grid, column) for column in both.T], axis=1)

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen, `WINDOW` long or more."""
        return segments.windows(trial, WINDOW)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: the body's displacement, then servo positions."""
        begin, end = observed[..., windows.first, :], observed[..., windows.last, :]
        moved = body_displacement(begin[..., :3], end[..., :3])
        return np.concatenate([moved, end[..., 3:]], axis=-1)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Time in the trial and since the command changed, in each window."""
        times = trial.times[trial.boundaries]
        at = np.searchsorted(times, windows.times, side="right") - 1
        return {
            "time since the command changed": windows.times - times[at],
            "time in the trial": windows.times - times[0],
        }


def _key(trial: Trial) -> bytes:
    told = trial.commands.values.tobytes() + trial.times.tobytes()
    return told + trial.boundaries.tobytes()


def _sloping(effects: Sequence[Effect]) -> bool:
    """Whether headings in the world differ: only then does the start's count."""
    return any(effect.name == "floor_slope" for effect in effects)


def _heading(trial: Trial) -> float:
    yaw = trial.channel("yaw")
    seen = yaw[np.isfinite(yaw)]
    return float(np.round(seen[0], 2)) if len(seen) else 0.0


def _ranges(world: HexapodWorld) -> list[tuple[float, float]]:
    return [(item.low, item.high) for item in world.model.commands]
