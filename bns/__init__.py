"""BNS testbed: robots that learn their own simulator, in a physics world.

SNN means simulator neural network here, never a spiking one. Importing `bns` is
light: torch, MuJoCo and Rerun are imported by the modules that need them, and what is
named here by its first use.

    from bns import make, train, load, diagnose
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bns.errors import BnsError

if TYPE_CHECKING:
    from bns.experiment.config import RunConfig
    from bns.experiment.record import RunRecord
    from bns.experiment.run import train, train_many
    from bns.gap.diagnose import diagnose
    from bns.storage.store import load
    from bns.worlds.registry import make

__all__ = [
    "BnsError",
    "RunConfig",
    "RunRecord",
    "__version__",
    "diagnose",
    "load",
    "make",
    "train",
    "train_many",
]

__version__ = "0.2.0"

_PLACES = {
    "RunConfig": "bns.experiment.config",
    "RunRecord": "bns.experiment.record",
    "diagnose": "bns.gap.diagnose",
    "load": "bns.storage.store",
    "make": "bns.worlds.registry",
    "train": "bns.experiment.run",
    "train_many": "bns.experiment.run",
}


def __getattr__(name: str) -> Any:
    """What `__all__` names, from its module, at its first use."""
    if name not in _PLACES:
        raise AttributeError(f"module 'bns' has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)
