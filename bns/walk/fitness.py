"""What a walk is worth inside the SNN; lower is better, as everywhere here.

The dissertation's fitness (7.1) divides the ensemble's variance (7.2) by the distance.
A controller whose commands all members agree upon scores next to nothing, however short
the way, so evolution goes where the SNN is sure, not where the robot gets far. The
repaired form is a distance: the mean end point's, less the members' spread around it.
Standing still costs 0 at best, and any walk that is longer than its spread beats it.
"""

from torch import Tensor

SHORTEST = 1e-6  # [m] so that the printed form stays finite


def printed(distance: Tensor, variance: Tensor) -> Tensor:
    """Equations 7.1 and 7.2, the sign turned.

    Args:
        distance: from start to end of the predicted path [m].
        variance: of the members' predictions, summed over outputs and commands.
    """
    return variance / distance.clamp(min=SHORTEST)


def repaired(x: Tensor, y: Tensor, doubt: float) -> Tensor:
    """Spread less distance of the members' end points [m].

    Args:
        x, y: end points from the start, the members along axis 1, ``(R, G, P)`` [m].
        doubt: weight of the spread.

    Returns:
        ``(R, P)``.
    """
    spread = (x.var(1, unbiased=False) + y.var(1, unbiased=False)).sqrt()
    return doubt * spread - (x.mean(1).square() + y.mean(1).square()).sqrt()
