"""All learners on the same robots, damages and budgets: which recovers, how soon."""
