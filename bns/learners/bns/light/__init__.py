"""BNS with closed loops (thesis chapters 5 and 6): light following."""
