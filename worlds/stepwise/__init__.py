"""Worlds one command at a time: for Gymnasium and dm_env, and for whoever else steps.

`bns.worlds.stepwise.core` steps any world; `gym_env` and `dm_env_view` show it to
libraries that are imported only there.
"""
