"""Benches: one file each, found by name; see `python -m bench list`."""
