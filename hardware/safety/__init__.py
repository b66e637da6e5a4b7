"""What keeps a real robot from harm: bounds, monitors, watchdog, stop order."""
