"""A package that adds an effect, a world and a robot to the BNS testbed."""
