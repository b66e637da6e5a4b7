"""An alarm that any part of the program may raise and a moving robot obeys.

A learner that thinks in the background knows nothing of robots; when it fails, it
raises the alarm, and a world that moves a real robot stops it at once.
"""

_reasons: list[str] = []


def ring(reason: str) -> None:
    """Raise the alarm.

    Args:
        reason: what happened, in a few words.
    """
    _reasons.append(reason)


def reason() -> str:
    """Why the alarm was raised; empty while it was not."""
    return _reasons[0] if _reasons else ""


def clear() -> None:
    """End the alarm."""
    _reasons.clear()
