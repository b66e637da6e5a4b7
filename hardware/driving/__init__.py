"""Real robots on wheels as they drive: points, homing, steering, odometry."""
