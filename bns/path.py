"""From displacements in the body frame to a path in the world frame, batched."""

import torch
from torch import Tensor


def integrate(
    displacements: Tensor, start: tuple[float, float, float]
) -> tuple[Tensor, Tensor]:
    """Compose body-frame displacements.

    Args:
        displacements: ``(..., K, 3)`` forward [m], left [m], turn [rad].
        start: pose in the world frame [m, m, rad].

    Returns:
        positions ``(..., K, 2)`` [m] and headings ``(..., K)`` [rad] after each
        command, in the world frame.
    """
    x, y, yaw = start
    turn = displacements[..., 2]
    after = yaw + turn.cumsum(-1)
    before = after - turn
    cos, sin = before.cos(), before.sin()
    forward, left = displacements[..., 0], displacements[..., 1]
    px = x + (cos * forward - sin * left).cumsum(-1)
    py = y + (sin * forward + cos * left).cumsum(-1)
    return torch.stack([px, py], dim=-1), after
