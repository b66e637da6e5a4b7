"""What a walker that forgets by evidence would have done in a recorded run."""

import numpy as np
import torch

from bns.experiment.record import RunRecord
from bns.learners.bns.change_detection import changed
from bns.learners.bns.walking import MOVED, goal_inputs
from bns.worlds.trial import body_displacements


def forgets(record: RunRecord) -> np.ndarray:
    """Whether a change of the robot would have been seen after a trial, ``(R, T)``.

    As long as it would not, runs with `watch.forget` are those without.
    """
    walk, window = record.config.walk, record.config.adaptation.window
    found = np.zeros(record.sent.shape[:2], dtype=bool)
    for run in range(record.replicates):
        goals = torch.from_numpy(record.sent[run].copy())
        seen = goal_inputs(goals).numpy().astype(np.float32)
        moved = body_displacements(record.poses[run]) / np.array(MOVED)
        for trial in range(record.trials):
            rows = [
                part[: trial + 1].reshape(-1, part.shape[-1])[-window:]
                for part in (seen, moved.astype(np.float32))
            ]
            found[run, trial] = changed(*rows, walk.commands) > 0
    return found
