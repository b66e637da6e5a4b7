"""A robot on two wheels, made with `bns models new`."""
