"""Worlds of real robots: one on wheels, one with light, one on legs."""
