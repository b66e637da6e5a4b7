"""Hashes of tiny runs, diagnoses and reports, kept to be compared with."""
