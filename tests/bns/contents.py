"""Contents of directories, for comparing runs."""

NOT_PROMISED = ("timing.jsonl", "recording.rrd", "report.html")
"""what may differ between a run and the same one killed and resumed"""


def contents(directory):
    """Bytes of every file under a directory, by relative path."""
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and path.name not in NOT_PROMISED
    }
