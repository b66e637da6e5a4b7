"""The gap of a recording taken apart: all candidates in one fit under priors."""
