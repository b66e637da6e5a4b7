"""Settings of a learner that watches its data for a change of the robot."""

from dataclasses import dataclass, fields


@dataclass(frozen=True, kw_only=True)
class WatchConfig:
    """Damage detection (navigation, light following), and forgetting by evidence."""

    detect: bool = False
    """watch for damage; the adaptations to damage then follow what is detected
    instead of being told"""
    threshold: float = 6.0
    """an alarm is an innovation so many times what is usual in its run"""
    warmup: int = 6
    """trials that are seen before the first alarm, and after each before the next"""
    history: int = 12
    """trials before this one that an innovation is compared with"""
    floor: float = 0.03
    """an SNN is believed no better than this share of the largest motion or reading;
    what a damage changes less is not looked for"""
    grow: float = 0.3
    """by this share more for each unit of distance to the `near` nearest learned
    patterns (scaled inputs)"""
    reach: float = 0.4
    """a pattern is on known ground where a learned one lies no further away"""
    near: int = 5
    """what an SNN errs by at some place is its error on so many learned patterns; a
    trial with fewer patterns on known ground is not judged"""
    largest: int = 5
    """a trial is judged by so many of its patterns, those that stand out most"""
    forget: bool = False
    """drop all that came before a change of the robot: the last trial that the newest
    one contradicts, and those before it; for a walker the settings below do nothing
    (bns/walk/forgetting.py)"""
    forget_factor: float = 4.0
    """an old trial is contradicted when it differs from the newest one by so many
    times what either differs from itself (navigation: by which the SNNs err)"""
    forget_floor: float = 0.02
    """what differs by less of the largest motion or reading is no contradiction"""
    forget_reach: float = 0.2
    """patterns are compared where their scaled inputs lie no further apart"""
    forget_least: int = 8
    """patterns of an old trial that have to be comparable before it is judged"""

    def idle(self, task: str) -> set[str]:
        """The settings that do nothing as `detect` and `forget` are.

        Args:
            task: kind of the task.
        """
        names = {field.name for field in fields(self)} - {"detect", "forget"}
        forgetting = {name for name in names if name.startswith("forget_")}
        forgets = self.forget and task != "walk"
        detecting = names - forgetting
        return (set() if forgets else forgetting) | (
            set() if self.detect else detecting
        )
