"""Adaptations beyond the settings of `AdaptationConfig`: one file each, found by name.

A module has `DOC` (one line), `PARAMETERS` (name -> default) and

    def resets(trial, onset, **parameters) -> set[str]

which gives what a run resets before trial `trial`: any of "population", "simulator"
(SNN) and "data" (training patterns). `onset` is the run's first damaged trial, -1 for
none; an adaptation that uses it has to be told of the damage.
"""
