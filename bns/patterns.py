"""Training patterns: what each command did, newest last, with a sliding window."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from bns.errors import FormatError
from bns.worlds.trial import Trial, body_displacements

BUCKET = 64  # patterns; training tensors grow in these steps, so shapes recur


class PatternBuffer:
    """Patterns of R runs; each run has its own number and its own window.

    Args:
        runs: R.
        windows: newest patterns a run trains on, 0 = all; shape ``(R,)``.
        sizes: inputs and targets of a pattern.
        bucket: training tensors grow in steps of so many patterns.
    """

    def __init__(
        self,
        runs: int,
        windows: Sequence[int],
        sizes: tuple[int, int] = (5, 3),
        bucket: int = BUCKET,
    ):
        self.windows = np.asarray(windows, dtype=np.int64)
        self.sizes, self.bucket = sizes, bucket
        self.inputs = [np.zeros((0, sizes[0]), np.float32) for _ in range(runs)]
        self.targets = [np.zeros((0, sizes[1]), np.float32) for _ in range(runs)]

    def append(self, run: int, inputs: np.ndarray, targets: np.ndarray) -> None:
        """Add a trial's patterns, inputs and targets; old ones slide out."""
        keep = self.windows[run] or None
        for store, new in ((self.inputs, inputs), (self.targets, targets)):
            joined = np.concatenate([store[run], new.astype(np.float32)])
            store[run] = joined[-keep:] if keep else joined

    def clear(self, run: int) -> None:
        """Forget all patterns of a run."""
        self.keep(run, 0)

    def keep(self, run: int, newest: int) -> None:
        """Forget all patterns of a run but so many of the newest."""
        first = max(len(self.inputs[run]) - newest, 0)
        self.inputs[run] = self.inputs[run][first:]
        self.targets[run] = self.targets[run][first:]

    @property
    def counts(self) -> np.ndarray:
        """Patterns each run trains on, ``(R,)``."""
        return np.array([len(rows) for rows in self.inputs])

    def tensors(self, device: str = "cpu") -> tuple[Tensor, Tensor, Tensor]:
        """What to train on, padded alike.

        Returns:
            inputs ``(R, 5, N)``, targets ``(R, 3, N)``, weight ``(R, 1, 1, N)`` (1
            for a pattern, 0 for padding); N is the longest, rounded up to a bucket.
        """
        counts = self.counts
        longest = max(1, int(counts.max()))
        size = -(-longest // self.bucket) * self.bucket
        runs = len(counts)
        inputs = np.zeros((runs, self.sizes[0], size), np.float32)
        targets = np.zeros((runs, self.sizes[1], size), np.float32)
        weight = np.zeros((runs, 1, 1, size), np.float32)
        for run, count in enumerate(counts):
            inputs[run, :, :count] = self.inputs[run].T
            targets[run, :, :count] = self.targets[run].T
            weight[run, ..., :count] = 1.0
        return tuple(torch.from_numpy(a).to(device) for a in (inputs, targets, weight))

    def state(self) -> dict[str, np.ndarray]:
        """All patterns, run after run, and how many each run has."""
        return {
            "pattern_counts": self.counts,
            "pattern_inputs": np.concatenate(self.inputs),
            "pattern_targets": np.concatenate(self.targets),
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`.

        Raises:
            FormatError: the counts are not those of the patterns.
        """
        counts, held = arrays["pattern_counts"], len(arrays["pattern_inputs"])
        if (counts < 0).any() or {counts.sum(), len(arrays["pattern_targets"])} != {
            held
        }:
            raise FormatError(
                f"A stored state counts {counts.sum()} of {held} patterns."
            )
        edges = np.cumsum(counts)[:-1]
        self.inputs = np.split(arrays["pattern_inputs"], edges)
        self.targets = np.split(arrays["pattern_targets"], edges)


def of_trial(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """What each command was and did, in SI units.

    Args:
        trial: commands as sent, and what was observed.

    Returns:
        commands ``(K, 5)`` (previous left, previous right, left, right [m/s],
        duration [s]) and displacements ``(K, 3)`` in the body frame [m, m, rad];
        commands whose pose was lost at either end, and diverged trials, are left out.
    """
    speeds = trial.commands.values[:, :2]
    before = np.vstack([np.zeros((1, 2)), speeds[:-1]])
    commands = np.column_stack([before, speeds, trial.commands.durations])
    moved = body_displacements(trial.command_poses_world)
    seen = np.isfinite(moved).all(1) & trial.outcome.usable
    return commands[seen], moved[seen]
