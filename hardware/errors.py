"""What can go wrong with a robot on a line."""

from bns.errors import BnsError


class LinkError(BnsError):
    """The line to the robot is dead, or nothing that can be understood comes back."""


class SafetyStop(BnsError):
    """The robot was stopped before its commands were done.

    Args:
        reason: what happened, in a few words.
        advice: what to do now.
    """

    def __init__(self, reason: str, advice: str = "look at the robot, then go on"):
        self.reason = reason
        super().__init__(f"The robot was stopped: {reason}; {advice}.")


class Void(BnsError):
    """A trial that was not executed as told; it is repeated, never learned from.

    Args:
        reason: what happened, in a few words.
        advice: what to do where it happens again at once, so that going on would be
            no use or no good; empty = it is repeated as often as others.
    """

    def __init__(self, reason: str, advice: str = ""):
        self.reason, self.advice = reason, advice
        super().__init__(f"The trial is void: {reason}; it has to be repeated.")
