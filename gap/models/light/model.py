"""Light sensors as a nominal model for the diagnosis: `SightModel`.

The recorded poses are taken as they are; what is compared is each reading's departure
from the expected one in units of its own noise, and, for what makes readings scatter
rather than shift, how large that departure is whatever its sign.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.candidates import light
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.models.library import LibraryModel
from bns.gap.models.light.reader import Reader, Reads, extra
from bns.gap.recordings import trial_conditions
from bns.gap.recordings.trial_conditions import as_number
from bns.worlds.effects.base import Effect
from bns.worlds.light import sensors
from bns.worlds.light.closed_loop import LEAD
from bns.worlds.light.law import Lamp, LightField
from bns.worlds.light.sensors import VIRTUAL
from bns.worlds.objects import Post, RayScreen
from bns.worlds.trial import POSE_CHANNELS, Channel, Trial

FEWEST = 8  # readings of a trial
WIDTH = 1.5  # departures beyond some of these look alike to the scatter
LEAST = 0.9  # smallest believed deviation of what is 1 by design
SQUEEZED = 0.915  # standard deviation of `squeezed` of a normal number, not divided
SCATTER = 0.188  # standard deviation of `unlikely` of a normal number


def squeezed(departure: np.ndarray) -> np.ndarray:
    """Departures, each in units of its noise, of which large ones count less.

    A noisy sensor has many of them.
    """
    return 2 * np.arcsinh(departure / 2) / SQUEEZED


def unlikely(departure: np.ndarray) -> np.ndarray:
    """How far each departure is from expected, whatever the sign: 0..1."""
    return 1 - np.exp(-0.5 * (departure / WIDTH) ** 2)


def told_by(model: GapModel, trials: Sequence[Trial]) -> bool:
    """Whether the model's robot can see and all recordings have its readings."""
    return sensors.can_see(model.name) and sees(trials)


def sees(trials: Sequence[Trial]) -> bool:
    """Whether recordings have readings of light sensors."""
    names = {channel.name for channel in VIRTUAL}
    return bool(trials) and all(
        names <= {channel.name for channel in trial.channels} for trial in trials
    )


def _rows(conditions: Mapping[str, object], name: str) -> Sequence[Mapping[str, float]]:
    """A condition that is a list of tables; empty where there is none."""
    found = conditions.get(name)
    return found if isinstance(found, Sequence) else ()


class SightModel(LibraryModel):
    """The light sensors of a robot, as `GapModel`.

    Args:
        trials: recordings; the lamps are those of their conditions, else the nominal
            one, and single sensors count if all trials have them.
        pose_sd: noise of the tracker [m, m, rad].
        robot: its name or directory; default: that of the first recording.
        headings: which way the sensors look, see `light_sensors.of`.
    """

    starts = 6
    singly = True
    spread = (0.3, 1.0)
    odds = 5.0  # against each of some two hundred

    def __init__(
        self,
        trials: Sequence[Trial],
        *,
        pose_sd: Sequence[float] = (0.0, 0.0, 0.0),
        robot: str = "",
        headings: str = "",
    ):
        robot = robot or trials[0].robot
        known = sensors.of(robot, headings)
        self.name = f"{robot} light sensors"
        seen = [{channel.name for channel in trial.channels} for trial in trials]
        singles = all(set(known.names) <= names for names in seen)
        names = known.names if singles else tuple(item.name for item in VIRTUAL)
        about = trials[0].conditions
        lamps = tuple(Lamp(**row) for row in _rows(about, "lights")) or (Lamp(),)
        posts = tuple(Post(**row) for row in _rows(about, "objects"))
        ambient = as_number(about, "ambient", LightField().ambient)
        self.reader = Reader(
            LightField(lamps, ambient),
            known,
            singles=singles,
            screen=RayScreen(posts) if posts else None,
            pose_sd=pose_sd,
        )
        self.names, self.singles = names, singles
        self.features = (
            *(Channel(name, "1") for name in names),
            *(Channel(f"{name}_scatter", "1") for name in names),
        )
        self.channels = (*POSE_CHANNELS, *self.features)
        count = len(self.features)
        self.process = np.zeros(count)
        self.resolution = np.ones(3 + count)
        self._nominal: dict[bytes, tuple] = {}

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature."""
        return np.full(len(self.features), LEAST)

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers of sensors and lamps that may be off."""
        del trials
        names = self.reader.sensors.names
        return self.remembered(light.rows(singles=self.singles, sensors=names))

    def motion(self, features: np.ndarray) -> np.ndarray:
        """See `GapModel.motion`: noise is 1 whatever is read."""
        return np.zeros_like(features)

    def ready(
        self, trials: Sequence[Trial]
    ) -> tuple[tuple[Trial, ...], tuple[str, ...]]:
        """Recordings as this model compares them; those without readings left out."""
        made, notes = [], []
        for number, trial in enumerate(trials):
            ready = self.prepared(trial)
            if np.isfinite(ready.observed).all(axis=1).sum() < FEWEST:
                notes.append(
                    f"{trial_conditions.label(trial, number)}: "
                    "hardly any reading, left out"
                )
            else:
                made.append(ready)
        return tuple(made), tuple(notes)

    def prepared(self, trial: Trial) -> Trial:
        """A recording as this model compares it: a sample per reading.

        Readings are those at the ends of commands, at the poses some time before; of a
        robot that was handled, where it was put.
        """
        ends = np.concatenate([[0.0], np.cumsum(trial.commands.durations)])
        held = np.concatenate([[0.0], trial.commands.durations])
        moved = np.concatenate([[False], trial.handled])  # read where it was put
        moments = ends - np.where(moved, 0.0, np.minimum(LEAD, held))
        stamps = trial.times - trial.times[trial.boundaries[0]]
        poses = trial.poses_world
        seen = np.isfinite(poses).all(axis=1)
        at = np.stack(
            [np.interp(moments, stamps[seen], axis[seen]) for axis in poses.T], axis=1
        )
        read = np.stack([trial.channel(name) for name in self.names], axis=1)
        read = read[trial.boundaries]
        lost = ~np.isfinite(read).all(axis=1)
        first = read[np.flatnonzero(~lost)[0]] if not lost.all() else read[0]
        reads = Reads(ends, moments, at, first)
        mean, spread, dither = self._norm(reads)
        rng = np.random.default_rng(len(ends))
        read = read + dither * rng.standard_normal(read.shape)
        departure = (read - mean) / spread
        observed = np.hstack([at, squeezed(departure), unlikely(departure) / SCATTER])
        observed[lost, 3:] = np.nan
        made = trial.replace(
            times=ends,
            observed=observed,
            channels=self.channels,
            boundaries=np.arange(len(ends)),
            truth={"first": np.tile(first, (len(ends), 1)), "moments": moments},
        )
        return made

    def _norm(self, reads: Reads) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Expected readings, their noise, and what of it is added to saturated ones."""
        mean, own, free = self.reader.expected(reads)
        dither = np.sqrt(np.maximum(free**2 - own**2, 0.0))
        return mean, np.hypot(own, dither), dither

    def _reads(self, trial: Trial) -> Reads:
        return Reads(
            trial.times,
            trial.truth["moments"],
            trial.observed[:, :3],
            trial.truth["first"][0],
        )

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: expected departures and scatter of each reading."""
        return [[self._expected(trial, items) for trial in trials] for items in effects]

    def _expected(self, trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
        departure = self.departures(trial, effects)
        scatter = unlikely(departure).mean(axis=1) / SCATTER
        mean = squeezed(departure).mean(axis=1)
        return np.hstack([trial.observed[:, :3], mean, scatter])

    def departures(self, trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
        """Draws of readings' departures in units of their noise, ``(T, D, R)``."""
        reads = self._reads(trial)
        key = trial.observed[:, :3].tobytes()
        if key not in self._nominal:
            mean, spread, dither = self._norm(reads)
            noise = extra(len(mean), self.reader.draws, mean.shape[1])
            noise = dither[:, None] * noise
            self._nominal[key] = mean[:, None], spread[:, None], noise
        mean, spread, noise = self._nominal[key]
        return (self.reader.samples(reads, effects) + noise - mean) / spread

    def windows(self, trial: Trial) -> Windows:
        """One per reading: from the one before that was not lost; the first is as long
        as those after it are in the median."""
        last = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
        first = np.concatenate([last[:1], last[:-1]])
        end = trial.times[last]
        begin = np.concatenate([end[:1] - np.median(np.diff(end)), end[:-1]])
        middle = np.maximum((begin + end) / 2, trial.times[0])
        return Windows(first, last, middle, end - begin)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: departure and scatter at each window's end."""
        return observed[..., windows.last, 3:]

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Where the lamp is, heading and time in each window."""
        poses = trial.observed[windows.last, :3]
        way = self.reader.field.positions[0, :2] - poses[:, :2]
        bearing = np.arctan2(way[:, 1], way[:, 0]) - poses[:, 2]
        return {
            "distance of the lamp": np.hypot(*way.T),
            "lamp to the left": np.sin(bearing),
            "lamp ahead": np.cos(bearing),
            "heading": np.angle(np.exp(1j * poses[:, 2])),
            "time in the trial": windows.times,
        }
