"""From displacements in the body frame to a path in the world frame, batched."""

from torch import Tensor


def integrate(
    forward: Tensor,
    left: Tensor,
    turn: Tensor,
    start: tuple[float, float, float],
    dim: int = -1,
) -> tuple[Tensor, Tensor, Tensor]:
    """Compose body-frame displacements along one axis.

    Args:
        forward, left: displacements of each command [m], any equal shapes.
        turn: the same [rad].
        start: pose in the world frame [m, m, rad].
        dim: the axis along which commands follow each other.

    Returns:
        x, y [m] and yaw [rad] in the world frame after each command.
    """
    x, y, yaw = start
    after = yaw + turn.cumsum(dim)
    before = after - turn
    cos, sin = before.cos(), before.sin()
    px = x + (cos * forward - sin * left).cumsum(dim)
    py = y + (sin * forward + cos * left).cumsum(dim)
    return px, py, after
