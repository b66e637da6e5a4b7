"""Virtual robots that speak the real protocols and move in MuJoCo."""
