"""Engines: where batches run. One interface, the same bytes from each.

An engine has `name` and `run(jobs, beat=...)`, which yields an `Outcome` per job as
they finish, in any order. Closing the generator stops what is still going on.
"""
