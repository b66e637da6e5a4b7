"""BNS testbed: robots that learn their own simulator, in a physics world.

SNN means simulator neural network here, never a spiking one. Importing `bns` is
light: torch, MuJoCo and Rerun are imported by the modules that need them.
"""

from bns.errors import BnsError

__all__ = ["BnsError", "__version__"]

__version__ = "0.2.0"
