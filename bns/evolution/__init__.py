"""The evolutionary algorithm: selection, crossover, mutation, diversity (thesis 2.3).

Every operator works on R runs at once and takes its random numbers as arguments, so
that each can be tested against its definition. Fitness is a cost: lower is better.
"""
