"""Tasks: what a robot has to do, whoever learns it.

A task is a TOML file here: `description`, `kind` (the module of this package that runs
and scores it) and what that kind reads. Navigation reads `order` (the objectives'
letters as they are to be reached) and, where they are not the corners and the centre,
`[objectives]` with their positions [m].
"""

from bns.tasks.base import Curve, Picture, Space, Task
from bns.tasks.registry import describe, kind, kinds, names, of

__all__ = [
    "Curve",
    "Picture",
    "Space",
    "Task",
    "describe",
    "kind",
    "kinds",
    "names",
    "of",
]
