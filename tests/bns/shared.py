"""What tests of runs share: a tiny campaign, and contents of directories.

The campaign has four configurations of two replicates, and no waiting.
"""

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


NOT_PROMISED = ("timing.jsonl", "recording.rrd", "report.html")
"""what may differ between a run and the same one killed and resumed"""


def contents(directory):
    """Bytes of every file under a directory, by relative path."""
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and path.name not in NOT_PROMISED
    }
