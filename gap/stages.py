"""Stages of a diagnosis, and which share of its time each takes as a rule."""

from collections.abc import Mapping

from bns.gap.models.base import GapModel

TANGENT = {"nominal model": 0.12, "explanations": 0.85, "rivals": 0.03}
"""of robots whose rivals are told apart by tangents: measured on the demo's run (trials
15 to 20: 0.12, 0.86, 0.02 of 116 to 126 s)"""
"""arm: 0.07, 0.10, 0.83 of 9.5 s"""


def shares_of(model: GapModel) -> Mapping[str, float]:
    return TANGENT
