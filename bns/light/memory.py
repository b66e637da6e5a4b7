"""What R runs know: patterns and networks of the motion SNN or of the sensor SNNs."""

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.experiment.config_watch import WatchConfig
from bns.forgetting import contradicted, drop
from bns.light.loops import LightLoops
from bns.light.patterns import Patterns
from bns.patterns import PatternBuffer
from bns.snn import fitting
from bns.snn.network import Shape, forward, predict

BUCKET = 512  # patterns; training tensors grow in these steps, so shapes recur


class Learned:
    """Patterns and networks of R runs.

    Args:
        shape: of the networks.
        targets: outputs that a pattern has.
        windows: newest patterns a run trains on, 0 = all; shape ``(R,)``.
        batch: patterns trained on at a time, drawn from those; 0 = all.
        draws: source of randomness.
    """

    def __init__(
        self,
        shape: Shape,
        targets: int,
        windows: np.ndarray,
        batch: int,
        draws: Draws,
    ):
        self.shape, self.batch, self.draws = shape, batch, draws
        runs = len(windows)
        self.buffer = PatternBuffer(runs, windows, (shape.inputs, targets), BUCKET)
        self.trials = [np.zeros(0, np.int64) for _ in range(runs)]
        self.theta = self.fresh()
        self.loss = torch.full((runs,), torch.nan)
        self.spread = torch.zeros(runs, targets, device=self.theta.device)

    def fresh(self) -> Tensor:
        """Random weights ``(R, D)``."""
        return self.shape.random(len(self.buffer.windows), self.draws)

    def miss(self, run: int, patterns: Patterns) -> np.ndarray:
        """How far the networks are off on patterns, scaled, ``(N, O)``."""
        seen = torch.from_numpy(patterns.inputs.T.astype(np.float32))
        seen = seen.to(self.theta.device)[None]
        said = predict(self.shape, self.theta[run : run + 1], seen)[0]
        return said.cpu().numpy().T - patterns.targets

    def doubt(self, run: int, patterns: Patterns) -> np.ndarray:
        """Variance of the ensemble's members on patterns, ``(N, O)``; 0 without one."""
        if self.shape.outputs == 1:
            return np.zeros_like(patterns.targets)
        seen = torch.from_numpy(patterns.inputs.T.astype(np.float32))
        seen = seen.to(self.theta.device)[None]
        said = forward(self.shape, self.theta[run : run + 1], seen)[0]
        return said.var(0, unbiased=False).cpu().numpy().T

    def patterns(self, run: int) -> Patterns:
        """Those a run has learned."""
        return Patterns(self.buffer.inputs[run], self.buffer.targets[run])

    def append(self, run: int, trial: int, patterns: Patterns) -> None:
        """Keep a trial's patterns."""
        self.buffer.append(run, patterns.inputs, patterns.targets)
        mark = np.full(len(patterns.inputs), trial)
        joined = np.concatenate([self.trials[run], mark])
        self.trials[run] = joined[len(joined) - len(self.buffer.inputs[run]) :]

    def clear(self, run: int) -> None:
        """Forget all patterns of a run."""
        self.buffer.clear(run)
        self.trials[run] = self.trials[run][:0]

    def forget(self, run: int, config: WatchConfig) -> int:
        """Drop the old trials that the newest one contradicts; how many there were."""
        buffer, trials = self.buffer, self.trials[run]
        gone = contradicted(buffer.inputs[run], buffer.targets[run], trials, config)
        self.trials[run] = drop(buffer, run, trials, gone)
        return len(gone)

    def train(self, loops: LightLoops, which: np.ndarray) -> None:
        """Train the networks of runs marked in `which` ``(R,)`` that have patterns."""
        known = torch.from_numpy(which & (self.buffer.counts > 0))
        if not known.any():
            return
        patterns = self._patterns()
        trained, loss = loops.train(self.shape, self.theta, patterns)
        here = known.to(self.theta.device)[:, None]
        self.theta = torch.where(here, trained, self.theta)
        self.spread = torch.where(here, self._spread(patterns), self.spread)
        self.loss = torch.where(known, loss.cpu(), self.loss)

    def _spread(self, patterns: fitting.Patterns) -> Tensor:
        """RMS error of each scaled output on patterns, ``(R, O)``."""
        weight = patterns.weight[:, 0]
        miss = predict(self.shape, self.theta, patterns.inputs) - patterns.targets
        total = (miss * weight).square().sum(2)
        return (total / weight.sum(2).clamp(min=1)).sqrt()

    def _patterns(self) -> fitting.Patterns:
        """All patterns, or as many as a batch has, drawn anew each time."""
        patterns = fitting.Patterns(*self.buffer.tensors(self.theta.device))
        counts = torch.from_numpy(self.buffer.counts).to(self.theta.device)[:, None]
        if not 0 < self.batch < int(counts.max()):
            return patterns
        coins = self.draws.uniform(len(counts), self.batch)
        drawn = whole_below(coins, counts.clamp(min=1))
        whole = torch.arange(self.batch, device=drawn.device)
        index = torch.where(counts <= self.batch, whole, drawn)
        inputs, targets, weight = patterns
        return fitting.Patterns(
            inputs.gather(2, index[:, None].expand(-1, inputs.shape[1], -1)),
            targets.gather(2, index[:, None].expand(-1, targets.shape[1], -1)),
            weight.gather(3, index[:, None, None]),
        )

    def state(self, prefix: str) -> dict[str, np.ndarray]:
        """Everything as arrays."""
        arrays = {
            "theta": self.theta.cpu().numpy(),
            "loss": self.loss.numpy(),
            "spread": self.spread.cpu().numpy(),
            "trials": np.concatenate(self.trials),
            **self.buffer.state(),
        }
        return {f"{prefix}.{name}": value for name, value in arrays.items()}

    def restore(self, prefix: str, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        own = {
            name.removeprefix(f"{prefix}."): value
            for name, value in arrays.items()
            if name.startswith(f"{prefix}.")
        }
        self.theta = torch.from_numpy(own["theta"]).to(self.theta.device)
        self.loss = torch.from_numpy(own["loss"])
        self.spread = torch.from_numpy(own["spread"]).to(self.theta.device)
        edges = np.cumsum(own["pattern_counts"])[:-1]
        self.trials = np.split(own["trials"], edges)
        self.buffer.restore(own)
