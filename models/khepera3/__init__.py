"""Khepera III: MJCF, numbers, device units, calibration."""
