"""What to do with files that are no logs, or parts of one."""

from pathlib import Path

ARRAYS = (
    "import pandas as p; {load}; p.concat([p.DataFrame(d[k]).add_prefix(k) for k in "
    "('time', 'goal', 'q')], axis=1).to_csv('{out}', index=False)"
)
FRAME = "import pandas as p; p.{load}.to_csv('{out}', index=False)"
LINES = {
    ".h5": (ARRAYS, "import h5py; d = h5py.File('{path}')"),
    ".hdf5": (ARRAYS, "import h5py; d = h5py.File('{path}')"),
    ".mat": (
        ARRAYS,
        "from scipy.io import loadmat; d = loadmat('{path}', squeeze_me=1)",
    ),
    ".xlsx": (FRAME, "read_excel('{path}')"),
    ".json": (FRAME, "read_json('{path}')"),
    ".pkl": (FRAME, "read_pickle('{path}')"),
}
"""by the end of a name: Python that writes a CSV table of it, and how that loads it"""

BAGS = (".bag", ".db3")
KNOWN = (
    "give a table (.csv, .tsv, .csv.gz, .parquet, .npz) or a directory of some, one a "
    "trial, a PACE file (.pt), an MCAP log (.mcap) or the directory of a rosbag2 with "
    "some, or the directory of a SAGE motion (control.csv, state_motor.csv) or of a "
    "LeRobotDataset (meta/info.json)"
)
MOTION = ("control.csv", "state_motor.csv")
BESIDE = ("joint_list.txt", "event.csv")
PARTS = ("data", "meta", "videos")
FRAMES = (".parquet", ".json", ".jsonl", ".mp4")
COLUMNAR = (".parquet", ".pq", ".npz")
TABLES = (".csv", ".tsv", ".csv.gz", *COLUMNAR)
OURS = ("dataset.json", "run.json", "campaign.json")
DEEPEST = 4  # directories of a dataset in one another


def advice(path: Path) -> str:
    """Why a file or directory is no log, and what to do, in words."""
    inside = sorted(path.iterdir()) if path.is_dir() else [path]
    ends = {item.suffix.lower() for item in inside}
    packed = [p for p in inside if p.name.lower().endswith(".mcap.zstd")]
    stem = path.name.partition(".")[0] or "log"
    if packed:
        files = " ".join(str(item) for item in packed)
        given = path if path.is_dir() else path.with_suffix("")
        return f"{path} is packed: run `zstd -d {files}`, then give {given}."
    if ends & set(BAGS):
        return (
            f"{path} is a bag of ROS, but no MCAP log: run `pip install rosbags` and "
            f"`rosbags-convert --src {path} --dst {stem}_mcap --dst-storage mcap` (or "
            f"`ros2 bag convert`), then give {stem}_mcap."
        )
    if path.is_file() and path.suffix.lower() in LINES:
        line, load = LINES[path.suffix.lower()]
        text = line.format(load=load.format(path=path.name), out=f"{stem}.csv")
        yours = ", with the names of your arrays" * (line is ARRAYS)
        return (
            f"{path} is no log that is known. In its directory this makes a CSV table "
            f'of it{yours}: python -c "{text}"'
        )
    return f"{path} is no log that is known: {KNOWN}."


def whole(path: Path) -> tuple[Path, str] | None:
    """The directory that a file is a part of, and what that is; None = of none."""
    if path.name in MOTION + BESIDE and is_sage(path.parent):
        return path.parent, "a SAGE motion"
    if path.is_dir() or path.suffix.lower() in FRAMES:
        place = path.resolve()
        for home in place.parents[:DEEPEST]:
            if place.relative_to(home).parts[0] in PARTS and is_lerobot(home):
                return home, "a LeRobotDataset"
    return None


def tables_in(path: Path) -> list[Path]:
    """The tables in a directory, those of the kind that most are; of a dataset, a run
    or a campaign of this project none: what lies there is no log."""
    inside = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
    if any(item.name in OURS for item in inside):
        return []
    kinds: dict[str, list[Path]] = {end: [] for end in TABLES}
    for item in inside:
        for end in TABLES:
            if item.name.lower().endswith(end):
                kinds[end].append(item)
    return max(kinds.values(), key=len)


def is_lerobot(path: Path) -> bool:
    """Whether a directory is a LeRobotDataset."""
    return (path / "meta" / "info.json").is_file()


def is_sage(path: Path) -> bool:
    """Whether a directory is a SAGE motion."""
    return all((path / name).is_file() for name in MOTION)
