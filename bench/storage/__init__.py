"""Files, stores and campaigns under kills, full disks and damaged bytes."""
