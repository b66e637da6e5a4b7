"""Campaigns: many configurations, run in batches on any engine, kept in one store.

file.py       the campaign file: grid, list or random sample over any setting
identity.py   what a configuration is, whatever it is called and wherever it stands
plan.py       what is missing, grouped into batches
work.py       one batch, the same bytes wherever it runs
engines/      where batches run: in this process, on a local pool, on Ray
store.py      a file per batch, compacted to Parquet, readable while it grows
drive.py      the loop around all of them
table.py      what the campaign says: medians, pairs, power
"""
