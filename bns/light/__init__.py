"""Closed-loop light following: investigations B and C of the dissertation.

Controllers are small networks from two light readings to two wheel speeds; their
weights evolve inside a motion SNN and two sensor SNNs that learn from single trials.
"""
