"""Real robots as worlds: serial drivers, overhead tracking, safety, emulators."""
