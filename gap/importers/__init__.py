"""Recordings of real robots, each kind read by one module into trials in SI units.

Every reader takes the directory where its files lie; none is known beforehand.
"""
