"""Learners, each a file or folder here, found by its name; see `bns.learners.base`."""
