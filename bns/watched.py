"""Navigation that watches its data for a change of the robot; see `WatchConfig`."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from bns.detection import Detector, Ground, Misses, innovation
from bns.experiment.config import RunConfig
from bns.forgetting import contradicted, drop
from bns.learner import Learner
from bns.snn.network import forward
from bns.snn.scaling import AXLE
from bns.worlds.trial import Trial

CHANNELS = ("left wheel", "right wheel")
SHARP = 2.5  # [rad] commands that turn further do not tell how far each wheel rolled


class WatchedLearner(Learner):
    """`Learner` with damage detection, forgetting by evidence, or both.

    Its rows have further figures: detected, suspect (index of `CHANNELS`, -1 = none)
    and alarm_score; forgotten (trials dropped).

    Args:
        configs, replicates, onsets: see `Learner`; where damage is detected nobody is
            told the onsets.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        watch = configs[0].watch
        told = [-1] * len(configs) if watch.detect else onsets
        super().__init__(configs, replicates=replicates, onsets=told)
        self.detector = Detector.fresh(watch, self.runs, len(CHANNELS))
        self.marks = [np.zeros(0, np.int64) for _ in range(self.runs)]
        self.spread = np.zeros((self.runs, 3))  # RMS errors on the patterns, scaled
        self.rolled = np.zeros((self.runs, 2))  # of the ways the wheels rolled [m]
        self._forgotten = np.zeros(self.runs)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        innovations = np.stack([self._innovation(*pair) for pair in enumerate(tried)])
        self._new = [(trial, len(self._patterns(each)[0])) for each in tried]
        self._forgotten = np.zeros(self.runs)
        row = super().observe(trial, tried, best)
        watch = self.config.watch
        if watch.detect:
            onsets = self.adaptations.onsets
            row.update(self.detector.figures(trial, innovations, onsets))
        if watch.forget:
            row["forgotten"] = self._forgotten
        return row

    def _innovation(self, run: int, trial: Trial) -> np.ndarray:
        inputs, moved = self._patterns(trial)
        if not self.spread[run].any():  # nothing was learned yet
            return np.full(len(CHANNELS), np.nan)
        output = self.scaling.output.cpu().numpy()
        mild, said, miss = self._missed(run, inputs, moved / output)
        learned = self.buffer.inputs[run]
        gentle, _, known = self._missed(run, learned, self.buffer.targets[run])
        watch = self.config.watch
        ground = Ground.of(inputs[mild], learned[gentle], watch)
        misses = Misses(miss, said.var(0), known, self.rolled[run])
        return innovation(misses, ground, watch, unit=float(output[0]))

    def _missed(
        self, run: int, inputs: np.ndarray, moved: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which patterns turn mildly; ways of the wheels there, and their misses.

        Args:
            run: which.
            inputs, moved: of patterns, scaled.

        Returns:
            ``(N,)`` bool; of M of them, what each network says ``(G, M, 2)`` and how
            far they are off together ``(M, 2)`` [m].
        """
        output = self.scaling.output.cpu().numpy()
        mild = np.abs(moved[:, 2] * output[2]) < SHARP
        said = ways(self._said(run, inputs[mild]) * output)
        return mild, said, said.mean(0) - ways(moved[mild] * output)

    def _off(self, run: int) -> np.ndarray:
        """How far the networks are off on what a run learned, scaled, ``(N, 3)``."""
        buffer = self.buffer
        return self._said(run, buffer.inputs[run]).mean(0) - buffer.targets[run]

    def _said(self, run: int, inputs: np.ndarray) -> np.ndarray:
        """Scaled outputs of each network with all of them, ``(G, N, 3)``."""
        seen = torch.from_numpy(inputs.T.astype(np.float32)).to(self.config.device)
        said = forward(self.shape, self.theta[run : run + 1], seen[None])[0]
        if self.shape.outputs == 1:
            said = said.transpose(0, 1)
        return said.transpose(1, 2).double().cpu().numpy()

    def _learn(self, tried: Sequence[Trial]) -> dict[str, np.ndarray]:
        row = super()._learn(tried)
        for run in range(self.runs):
            inputs = self.buffer.inputs[run]
            if len(inputs):
                moved = self.buffer.targets[run]
                self.spread[run] = _rms(self._off(run))
                mild, _, far = self._missed(run, inputs, moved)
                self.rolled[run] = _rms(far) if mild.any() else 1.0
        return row

    def _train(self, which: Tensor) -> None:
        for run, (trial, count) in enumerate(self._new):
            self._mark(run, trial, count)
        self._new = []
        super()._train(which)

    _new: Sequence[tuple[int, int]] = ()  # trial and patterns not marked yet

    def _mark(self, run: int, trial: int, count: int) -> None:
        """Note which trial the newest patterns are of; drop what they contradict."""
        buffer, watch = self.buffer, self.config.watch
        joined = np.concatenate([self.marks[run], np.full(count, trial)])
        marks = joined[len(joined) - len(buffer.inputs[run]) :]
        if watch.forget and count and self.spread[run].any():
            gone = contradicted(
                buffer.inputs[run], self._off(run), marks, watch, self.spread[run]
            )
            marks = drop(buffer, run, marks, gone)
            self._forgotten[run] = len(gone)
        self.marks[run] = marks

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        return super().state() | {
            "onsets": self.adaptations.onsets,
            "innovations": self.detector.past,
            "pattern_trials": np.concatenate(self.marks),
            "spread": self.spread,
            "rolled": self.rolled,
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        super().restore(arrays)
        self.adaptations.onsets = arrays["onsets"].copy()
        self.detector.past = arrays["innovations"].copy()
        edges = np.cumsum(arrays["pattern_counts"])[:-1]
        self.marks = np.split(arrays["pattern_trials"], edges)
        self.spread = arrays["spread"].copy()
        self.rolled = arrays["rolled"].copy()


def ways(moved: np.ndarray) -> np.ndarray:
    """How far the left and the right wheel rolled in commands that turn mildly.

    Args:
        moved: displacements in the body frame, ``(..., 3)`` [m, m, rad].

    Returns:
        ``(..., 2)`` [m], of an arc with that chord.
    """
    forward, left, turn = np.moveaxis(moved, -1, 0)
    half = np.clip(turn / 2, -SHARP, SHARP)
    along = forward * np.cos(half) + left * np.sin(half)  # on the chord's direction
    arc = along / np.sinc(half / np.pi)
    return np.stack([arc - AXLE / 2 * turn, arc + AXLE / 2 * turn], axis=-1)


def _rms(miss: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(miss**2, axis=0))
