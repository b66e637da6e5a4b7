"""The walking robot: what it learns, regains, and could do at best."""
