"""What the diagnosis names in a robot's trials, for learners that mend their model."""

from collections.abc import Sequence

from bns.errors import BnsError
from bns.worlds.trial import Trial


def named(
    trials: Sequence[Trial], robot: str, *, seed: int = 0
) -> list[tuple[str, ...]]:
    """Sets of effects that explain trials, beside the robot as it was made.

    Args:
        trials: lists of commands and what was observed, two at least.
        robot: its name.
        seed: of what is drawn.

    Returns:
        the set that the diagnosis names, and the others that it fitted, the best
        first, each effect as text; none where too little is to be seen.

    Raises:
        UnknownNameError: no such robot.
        BnsError: one that the diagnosis has no model of.
    """
    from bns.gap.diagnose import diagnose
    from bns.gap.recordings import load_recordings

    model = load_recordings.model(robot)
    try:
        found = diagnose(trials, model, seed=seed, full=False)
    except BnsError:
        return []
    sets = [found.best.effects, *(fit.effects for fit in found.fits)]
    return [effects for effects in dict.fromkeys(sets) if effects]
