"""Overhead tracking: where the robot is, from pictures of a tag on its back."""
