"""Tasks: `edge.toml` names one, `edge` runs and scores it."""
