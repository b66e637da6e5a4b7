"""Learners beside each other: faithfulness, priors, and what is deployed."""
