"""A tiny campaign that tests share: four configurations, two replicates, no waiting."""

from bns.campaign.file import from_content

CONTENT = {
    "name": "tiny",
    "replicates": 2,
    "batch_runs": 4,
    "settings": {
        "trials": 3,
        "compiled": "no",
        "evolution": {"population": 8, "generations": 1},
        "snn": {"epochs": 2},
        "world": {"damage": ["wheel_gain:wheel=left,factor=0.8@1"]},
    },
    "grid": {
        "adaptation": {"window": [0, 20]},
        "evolution.mutation_rate": [0.1, 0.2],
    },
}


def campaign(**changes):
    """The tiny campaign with other entries at the top."""
    return from_content({**CONTENT, **changes}, "tiny")
