"""What the decomposition needs of a nominal model."""

from bns.gap.models.base import BLOCK, FEW
from bns.gap.models.base import GapModel as DecomposableModel

__all__ = ["BLOCK", "FEW", "DecomposableModel"]
