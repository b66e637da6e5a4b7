"""Tasks: what a robot has to do, and how a path is scored.

A task is a TOML file here: `description`, `order` (the objectives' letters as they are
to be reached) and, where they are not the corners and the centre, `[objectives]` with
their positions [m].
"""

from bns.tasks.navigation import NavigationTask, objectives, score
from bns.tasks.registry import describe, names, order

__all__ = ["NavigationTask", "describe", "names", "objectives", "order", "score"]
