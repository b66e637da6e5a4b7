"""A package that adds to the BNS testbed one of each kind that can be added."""
