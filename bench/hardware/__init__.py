"""The hardware mode, measured against emulated robots."""
