"""The hexapod's bus: eighteen Dynamixel AX-12A on protocol 1.0."""
