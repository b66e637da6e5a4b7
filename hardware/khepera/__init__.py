"""Khepera III: its ASCII protocol and the driver on it."""
