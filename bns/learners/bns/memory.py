"""What R runs know: patterns (what each command did) and networks trained on them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.errors import FormatError
from bns.snn import training
from bns.snn.network import Shape, forward, predict

BUCKET = 64  # patterns; training tensors grow in these steps, so shapes recur

Fit = tuple[Tensor, Tensor]


class Patterns(NamedTuple):
    """Scaled inputs and targets, a row per pattern."""

    inputs: np.ndarray
    targets: np.ndarray


class Trainer(Protocol):
    """What fits networks to patterns."""

    def train(self, shape: Shape, theta: Tensor, patterns: training.Patterns) -> Fit:
        """Fit the networks of all runs.

        Args:
            shape: of the networks.
            theta: weights before, ``(R, D)``.
            patterns: what to train on.

        Returns:
            new weights ``(R, D)``, and the mean squared error after training ``(R,)``.
        """


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
        windows: Sequence[int] | np.ndarray,
        sizes: tuple[int, int] = (5, 3),
        bucket: int = BUCKET,
    ):
        self.windows = np.asarray(windows, dtype=np.int64)
        self.sizes, self.bucket = sizes, bucket
        self.inputs = [np.zeros((0, sizes[0]), np.float32) for _ in range(runs)]
        self.targets = [np.zeros((0, sizes[1]), np.float32) for _ in range(runs)]

    def append(self, run: int, inputs: np.ndarray, targets: np.ndarray) -> None:
        """Add a trial's patterns; those older than the run's window slide out.

        Args:
            run: whose they are.
            inputs: scaled, ``(N, I)``.
            targets: scaled, ``(N, O)``.
        """
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

    def tensors(
        self, device: str | torch.device = "cpu"
    ) -> tuple[Tensor, Tensor, Tensor]:
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
        made = [torch.from_numpy(a).to(device) for a in (inputs, targets, weight)]
        return made[0], made[1], made[2]

    def state(self) -> dict[str, np.ndarray]:
        """All patterns, run after run, and how many each run has."""
        return {
            "pattern_counts": self.counts,
            "pattern_inputs": np.concatenate(self.inputs),
            "pattern_targets": np.concatenate(self.targets),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`.

        Raises:
            FormatError: the counts are not those of the patterns.
        """
        counts, held = arrays["pattern_counts"], len(arrays["pattern_inputs"])
        sums = {int(counts.sum()), len(arrays["pattern_targets"])}
        if (counts < 0).any() or sums != {held}:
            raise FormatError(
                f"A stored state counts {counts.sum()} of {held} patterns."
            )
        edges = np.cumsum(counts)[:-1]
        self.inputs = np.split(arrays["pattern_inputs"], edges)
        self.targets = np.split(arrays["pattern_targets"], edges)


class Memory:
    """Patterns and networks of R runs.

    Args:
        name: in the state and in messages.
        shape: of the networks.
        targets: outputs that a pattern has.
        windows: newest patterns a run trains on, 0 = all; shape ``(R,)``.
        draws: source of randomness.
        bucket: training tensors grow in steps of so many patterns.
        batch: patterns trained on at a time, drawn from those; 0 = all.
        prefix: of its columns in the record.

    Attributes:
        theta: weights of the networks, ``(R, D)``.
        loss: mean squared error after training, ``(R,)``.
        spread: RMS error of each scaled output on the patterns after training,
            ``(R, O)``.
        trials: the trial that each pattern of a run is of.
    """

    def __init__(
        self,
        name: str,
        shape: Shape,
        targets: int,
        windows: np.ndarray,
        draws: Draws,
        *,
        bucket: int = BUCKET,
        batch: int = 0,
        prefix: str = "",
    ):
        self.name, self.shape, self.prefix = name, shape, prefix
        self.batch, self.draws = batch, draws
        runs = len(windows)
        self.buffer = PatternBuffer(runs, windows, (shape.inputs, targets), bucket)
        self.trials = [np.zeros(0, np.int64) for _ in range(runs)]
        self.theta = self.fresh()
        self.loss = torch.full((runs,), torch.nan)
        self.spread = torch.zeros(runs, targets, device=self.theta.device)

    def fresh(self) -> Tensor:
        """Random weights ``(R, D)``."""
        return self.shape.random(len(self.buffer.windows), self.draws)

    def members(self, run: int, inputs: np.ndarray) -> Tensor:
        """Outputs of a run's networks on scaled inputs ``(N, I)``: ``(G, O, N)``."""
        return forward(self.shape, self.theta[run : run + 1], self._tensor(inputs))[0]

    def predict(self, run: int, inputs: np.ndarray) -> np.ndarray:
        """What a run's networks say of scaled inputs ``(N, I)``, scaled, ``(N, O)``."""
        said = predict(self.shape, self.theta[run : run + 1], self._tensor(inputs))[0]
        outputs: np.ndarray = said.cpu().numpy().T
        return outputs

    def _tensor(self, inputs: np.ndarray) -> Tensor:
        rows = torch.from_numpy(inputs.T.astype(np.float32))
        return rows.to(self.theta.device)[None]

    def error(self, run: int, patterns: Patterns) -> np.ndarray:
        """How far the networks are off on patterns, scaled, ``(N, O)``."""
        found: np.ndarray = self.predict(run, patterns.inputs) - patterns.targets
        return found

    def variance(self, run: int, patterns: Patterns) -> np.ndarray:
        """Variance of the ensemble's members on patterns, ``(N, O)``; 0 without one."""
        if self.shape.outputs == 1:
            return np.zeros_like(patterns.targets)
        said = self.members(run, patterns.inputs)
        spread: np.ndarray = said.var(0, unbiased=False).cpu().numpy().T
        return spread

    def patterns(self, run: int) -> Patterns:
        """Those a run has learned."""
        return Patterns(self.buffer.inputs[run], self.buffer.targets[run])

    def append(self, run: int, trial: int, patterns: Patterns) -> None:
        """Keep a trial's patterns.

        Args:
            run: whose they are.
            trial: number of the trial.
            patterns: N of them; those older than the run's window slide out.
        """
        self.buffer.append(run, patterns.inputs, patterns.targets)
        mark = np.full(len(patterns.inputs), trial)
        joined = np.concatenate([self.trials[run], mark])
        self.trials[run] = joined[len(joined) - len(self.buffer.inputs[run]) :]

    def keep(self, run: int, newest: int) -> None:
        """Forget all patterns of a run but so many of the newest."""
        self.buffer.keep(run, newest)
        first = len(self.trials[run]) - len(self.buffer.inputs[run])
        self.trials[run] = self.trials[run][first:]

    def train(self, trainer: Trainer, which: np.ndarray) -> None:
        """Train the networks of runs marked in `which` ``(R,)`` that have patterns."""
        known = torch.from_numpy(which & (self.buffer.counts > 0))
        if not known.any():
            return
        patterns = self._patterns()
        trained, loss = trainer.train(self.shape, self.theta, patterns)
        here = known.to(self.theta.device)[:, None]
        self.theta = torch.where(here, trained, self.theta)
        self.spread = torch.where(here, self._spread(patterns), self.spread)
        self.loss = torch.where(known, loss.cpu(), self.loss)

    def _spread(self, patterns: training.Patterns) -> Tensor:
        """RMS error of each scaled output on patterns, ``(R, O)``."""
        weight = patterns.weight[:, 0]
        miss = predict(self.shape, self.theta, patterns.inputs) - patterns.targets
        total = (miss * weight).square().sum(2)
        return (total / weight.sum(2).clamp(min=1)).sqrt()

    def _patterns(self) -> training.Patterns:
        """All patterns, or as many as a batch has, drawn anew each time."""
        patterns = training.Patterns(*self.buffer.tensors(self.theta.device))
        counts = torch.from_numpy(self.buffer.counts).to(self.theta.device)[:, None]
        if not 0 < self.batch < int(counts.max()):
            return patterns
        coins = self.draws.uniform(len(counts), self.batch)
        drawn = whole_below(coins, counts.clamp(min=1))
        whole = torch.arange(self.batch, device=drawn.device)
        index = torch.where(counts <= self.batch, whole, drawn)
        inputs, targets, weight = patterns
        return training.Patterns(
            inputs.gather(2, index[:, None].expand(-1, inputs.shape[1], -1)),
            targets.gather(2, index[:, None].expand(-1, targets.shape[1], -1)),
            weight.gather(3, index[:, None, None]),
        )

    def state(self) -> dict[str, np.ndarray]:
        """Everything as arrays, each name after the memory's own and a dot."""
        arrays = {
            "theta": self.theta.cpu().numpy(),
            "loss": self.loss.numpy(),
            "spread": self.spread.cpu().numpy(),
            "trials": np.concatenate(self.trials),
            **self.buffer.state(),
        }
        return {f"{self.name}.{name}": value for name, value in arrays.items()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`."""
        prefix = f"{self.name}."
        own = {
            name.removeprefix(prefix): value
            for name, value in arrays.items()
            if name.startswith(prefix)
        }
        self.theta = torch.from_numpy(own["theta"]).to(self.theta.device)
        self.loss = torch.from_numpy(own["loss"])
        self.spread = torch.from_numpy(own["spread"]).to(self.theta.device)
        edges = np.cumsum(own["pattern_counts"])[:-1]
        self.trials = np.split(own["trials"], edges)
        self.buffer.restore(own)
