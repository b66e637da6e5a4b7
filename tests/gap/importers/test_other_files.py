"""Files that are no logs: what to run, or which directory to give, is said."""

import pytest

from bench.storage.sample_files import lerobot, sage
from bns.errors import FormatError
from bns.gap.importers import tables


def said(path):
    with pytest.raises(FormatError) as caught:
        tables.read(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "todo"),
    [
        ("a.db3", "rosbags-convert --src {path} --dst a_mcap --dst-storage mcap"),
        ("a.bag", "rosbags-convert --src {path} --dst a_mcap --dst-storage mcap"),
        ("a.mcap.zstd", "`zstd -d {path}`, then give {home}/a.mcap."),
        ("a.h5", "h5py.File('a.h5')"),
        ("a.mat", "loadmat('a.mat'"),
        ("a.xlsx", "p.read_excel('a.xlsx').to_csv('a.csv', index=False)"),
    ],
)
def test_what_makes_a_log_of_it_is_said(tmp_path, name, todo):
    path = tmp_path / name
    path.write_bytes(b"x")
    assert todo.format(path=path, home=tmp_path) in said(path)


@pytest.mark.parametrize(
    ("name", "todo"), [("a.db3", "rosbags-convert --src"), ("a.mcap.zstd", "zstd -d")]
)
def test_so_it_is_for_a_directory_of_rosbag2(tmp_path, name, todo):
    (tmp_path / name).write_bytes(b"x")
    (tmp_path / "metadata.yaml").write_text("")
    assert todo in said(tmp_path)


def test_a_part_of_a_motion_or_a_dataset_is_said(tmp_path):
    motion, dataset = sage(tmp_path / "a"), lerobot(tmp_path / "b")
    for name in ("control.csv", "state_motor.csv", "joint_list.txt"):
        assert said(motion / name).endswith(
            f"SAGE motion: give its directory {motion}."
        )
    frames = next(dataset.rglob("*.parquet"))
    for part in (frames, frames.parent, dataset / "meta" / "info.json"):
        assert said(part).endswith(f"LeRobotDataset: give its directory {dataset}.")


def test_a_checkpoint_is_no_pace_file(tmp_path):
    import torch

    torch.save(torch.nn.Linear(2, 2), tmp_path / "a.pt")
    text = said(tmp_path / "a.pt")
    assert "holds more than tensors; save a dictionary of the tensors time, " in text
    assert "\x1b" not in text
