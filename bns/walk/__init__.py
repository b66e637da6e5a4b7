"""Walking: investigation D of the dissertation.

Controllers are eleven commands of servo goals; they evolve inside an ensemble of
networks that foresee how each command moves the body, and learn from single trials.
"""
