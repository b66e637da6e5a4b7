"""What a learner has to give back: so many controllers, and the columns it declares."""

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.errors import BnsError

if TYPE_CHECKING:
    from bns.learners.base import Learner, Proposal

COMMON = (
    "fitness",
    "fitness_best",
    "solved",
    "solved_best",
    "reached",
    "commands",
    "damaged",
    "evaluations",
    "predicted",
)
"""columns that a record has whatever the learner"""


def hold(kind: "type[Learner]") -> None:
    """Have the methods that a class of learners defines checked when they are called.

    Only the outermost is: what a subclass has from `super()` need not be complete. Nor
    is what only stands for the learner of the configuration, in another process.
    """
    for name, check in (("propose", check_proposal), ("observe", check_row)):
        if name in vars(kind):
            setattr(kind, name, _checked(name, vars(kind)[name], check))


def _checked(
    name: str, method: Callable[..., Any], check: Callable[[Any, Any], None]
) -> Callable[..., Any]:
    @wraps(method)
    def checked(self: "Learner", *told: Any, **named: Any) -> Any:
        found = method(self, *told, **named)
        if getattr(type(self), name) is checked and _is_configured(self):
            check(self, found)
        return found

    return checked


def _is_configured(learner: "Learner") -> bool:
    from bns.learners import registry

    try:
        return registry.get(learner.config.learner) is type(learner)
    except BnsError:
        return False


def check_proposal(learner: "Learner", proposal: "Proposal[Any]") -> None:
    """Refuse a proposal that has not one controller for each run.

    Raises:
        BnsError: too few or too many.
    """
    parts = {"tried": proposal.tried, "best": proposal.best}
    for name, part in parts.items():
        if part is not None and len(part) != learner.runs:
            raise BnsError(
                f"Learner {learner.config.learner!r}: propose gave {len(part)} "
                f"controllers as `{name}` for {learner.runs} runs: give one for each."
            )


def check_row(learner: "Learner", row: Mapping[str, Any]) -> None:
    """Refuse what `observe` gave where it is not as `Learner.columns` says.

    Arrays of more than one number a run need not be declared.

    Raises:
        BnsError: a column that is missing, or not declared.
    """
    said = f"Learner {learner.config.learner!r}: observe gave"
    declared = _listed(list(learner.columns))
    for name in learner.columns:
        if name not in row:
            raise BnsError(
                f"{said} no {name!r}, and `columns` declares {declared}: give all of "
                "them in every trial, or take it out of `columns`."
            )
    if learner.open_columns:
        return
    known = (*COMMON, *learner.task.columns, *learner.columns)
    for name, value in row.items():
        if name not in known and np.ndim(value) < 2:
            raise BnsError(
                f"{said} the column {name!r}, and `columns` declares {declared}: add "
                "it there with its meaning, or leave it out."
            )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
