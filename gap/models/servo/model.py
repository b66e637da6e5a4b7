"""A servo on a lever as a nominal model for the general diagnosis.

Angles are compared as they are, at the end of each window: a servo's loop pulls them
back, so that errors do not pile up as they do for a robot that drives. Where runs
without a change exist, `bns.gap.models.servo.diagnosis` does better: it learns how the
law errs alone.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.gap.models.base import Windows
from bns.gap.models.library import LibraryModel
from bns.gap.models.servo import candidates as servo_candidates
from bns.gap.models.servo.nominal import Nominal, usual
from bns.gap.models.servo.runs import SAMPLE, Runs, runs
from bns.gap.planning import servo_excitation
from bns.gap.planning.excitation import Excitation
from bns.worlds.effects.base import Effect
from bns.worlds.physics.servo_rollout import simulate
from bns.worlds.trial import Channel, Trial

WINDOW = 0.1  # [s] between two angles that are compared
AT_ONCE = 400  # sets of effects in one batch, which bounds the memory


class ServoModel(LibraryModel):
    """The servo law with what each trial's conditions tell of it.

    Conditions named like numbers of the law (mass, lever, gain, voltage, ...) hold for
    their trial.

    Args:
        nominal: the law; None = that of the servo that trials are of (`usual`).
        process: see `GapModel.process` [rad per square root of a second].
        resolution: see `GapModel.resolution` [rad].
    """

    name = "servo_pendulum"
    channels = (Channel("angle", "rad"),)
    features = (Channel("angle", "rad"),)
    whole = True
    memory = 2

    def __init__(
        self,
        nominal: Nominal | None = None,
        *,
        process: Sequence[float] = (0.06,),
        resolution: Sequence[float] = (1.5e-3,),
    ):
        kind = models.robot(self.name).kind
        if kind != "servo":
            raise BnsError(f"{self.name!r} is of kind {kind!r}; it has to be a servo.")
        self.nominal = nominal
        self.process = np.array(process, dtype=float)
        self.resolution = np.array(resolution, dtype=float)

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of an angle [rad]."""
        return self.resolution

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All servo effects."""
        del trials
        return self.remembered(servo_candidates.candidates())

    def excitations(
        self, *, seed: int = 0, told: Mapping[str, float] | None = None
    ) -> tuple[Excitation, ...]:
        """Safe commands for the planner, see `gap/planning/servo_excitation.py`."""
        return servo_excitation.servo(seed=seed, told=told)

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted angles [rad]; other channels as recorded.

        Raises:
            BnsError: a trial is shorter than two hundredths of a second.
        """
        groups: dict[int, list[int]] = {}
        for number, trial in enumerate(trials):
            groups.setdefault(int(trial.times[-1] / SAMPLE), []).append(number)
        made = [[np.empty(0)] * len(trials) for _ in effects]
        for steps, members in groups.items():
            if steps < 2:
                raise BnsError(
                    "A servo trial is shorter than two hundredths of a second."
                )
            batch = runs([seen(trials[i]) for i in members], seconds=steps * SAMPLE)
            for begin in range(0, len(effects), AT_ONCE):
                angles = self._angles(batch, effects[begin : begin + AT_ONCE])
                for row, number in enumerate(members):
                    for column, predicted in enumerate(angles[row]):
                        made[begin + column][number] = _sampled(
                            trials[number], predicted
                        )
        return made

    def _angles(self, batch: Runs, effects: Sequence[Sequence[Effect]]) -> np.ndarray:
        nominal = self.nominal or usual(batch)
        law = servo_candidates.columns(nominal.told(batch), effects)
        made = simulate(law, batch.drive)
        return np.broadcast_to(made, (len(batch), len(effects), made.shape[-1]))

    def windows(self, trial: Trial) -> Windows:
        """Windows of `WINDOW` seconds, between samples that were seen.

        Raises:
            BnsError: a trial has no two samples with an angle.
        """
        fine = np.flatnonzero(np.isfinite(trial.channel("angle")))
        if len(fine) < 2:
            raise BnsError("A servo trial has no two samples with an angle.")
        times = trial.times[fine]
        edges = np.arange(times[0], times[-1] + 1e-9, WINDOW)
        marks = fine[np.unique(np.searchsorted(times, edges - 1e-9))]
        first, last = marks[:-1], marks[1:]
        begin, end = trial.times[first], trial.times[last]
        return Windows(first, last, (begin + end) / 2, end - begin)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: the angle at the end of each window [rad]."""
        return observed[..., windows.last, :1]

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Goal, speed, error, reversals and power in each window."""
        names = [channel.name for channel in trial.commands.channels]
        started = np.searchsorted(trial.boundaries, windows.first, side="right") - 1
        told = trial.commands.values[np.clip(started, 0, len(trial.commands) - 1)]
        goal, angle = told[:, names.index("goal")], trial.channel("angle")
        way = angle[windows.last] - angle[windows.first]
        made = {
            "goal [rad]": goal,
            "speed [rad/s]": way / windows.durations,
            "error [rad]": goal - angle[windows.first],
            "load, sine of the angle": np.sin(angle[windows.first]),
            "turns back": (np.diff(np.sign(way), prepend=0) != 0).astype(float),
            "time [s]": windows.times,
        }
        if "torque_on" in names:
            made["powered"] = told[:, names.index("torque_on")]
        return made


def angles_only(trial: Trial) -> Trial:
    """A trial with the one observed channel that the model has."""
    return trial.replace(
        observed=trial.channel("angle")[:, None], channels=ServoModel.channels
    )


def seen(trial: Trial) -> Trial:
    """A trial whose lost angles are bridged, so that it can be resampled."""
    angle = trial.channel("angle")
    fine = np.isfinite(angle)
    if fine.all():
        return trial
    column = [channel.name for channel in trial.channels].index("angle")
    observed = trial.observed.copy()
    observed[:, column] = np.interp(trial.times, trial.times[fine], angle[fine])
    return trial.replace(observed=observed)


def _sampled(trial: Trial, angles: np.ndarray) -> np.ndarray:
    """Samples like the trial's own, the angle as predicted on the regular grid."""
    column = [channel.name for channel in trial.channels].index("angle")
    made = trial.observed.copy()
    made[:, column] = np.interp(
        trial.times, np.arange(len(angles)) * SAMPLE, angles, right=np.nan
    )
    late = trial.times > (len(angles) - 1) * SAMPLE
    made[late, column] = angles[-1]
    return made
