"""BNS: evolve inside a simulator neural network, try, train, repeat (thesis 2.8)."""
