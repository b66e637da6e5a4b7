"""Readers of real recordings, on small files of the same form with the same faults."""

import gzip
import json

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.importers import khepera3_odometry, kscale_sts3215, mrclam6, servo, xl330
from bns.worlds.data import dataset
from bns.worlds.trial import body_displacements

COLUMNS = [
    "timestamp",
    "position",
    "speed",
    "goal_position",
    "torque_enable",
    "load",
    "torque",
    "input_volts",
    "temp",
    "current",
]


def kscale(directory, names=("a", "b"), *, lost=(), columns=COLUMNS, volts=12.1):
    rows = ["file,kp,length,mass,trajectory,vin,motor_params"]
    runs = {"_columns": np.array(columns)}
    for name in names:
        rows.append(f"{name},16,0.15,0.741,sin_sin,15.0,\"{{'name': 'sts3215'}}\"")
        table = np.zeros((40, len(columns)), np.float32)
        table[:, 0] = 7.0 + np.arange(40) * 0.01
        table[:, 1] = table[:, 3] = 0.5 * np.sin(np.arange(40) / 10)
        table[list(lost), 1] = -np.pi
        table[:, 4], table[:, 7] = 1, volts
        runs[name] = table
    (directory / "index.csv").write_text("\ufeff" + "\n".join(rows) + "\n")
    np.savez(directory / "runs.npz", **runs)
    return directory


class TestKscale:
    def test_settings_and_what_the_metadata_miss(self, tmp_path):
        first, second = kscale_sts3215.read(kscale(tmp_path))
        told = first.conditions
        assert (told["mass"], told["lever"], told["gain"]) == (0.741, 0.15, 16.0)
        assert told["arm_mass"] == 0.050
        assert told["voltage"] == pytest.approx(12.1, abs=1e-5)
        assert told["voltage_told"] == 15.0
        assert told["quantisation"] == pytest.approx(1.534e-3, abs=1e-6)
        assert (told["repeat"], second.conditions["repeat"]) == (0, 1)
        assert first.times[0] == 0 and first.times[-1] == pytest.approx(0.39, abs=1e-5)
        assert len(first.commands) == 39 and first.robot == "servo_pendulum"
        assert "load" not in [channel.name for channel in first.channels]

    def test_lost_packets_are_mended(self, tmp_path):
        trial = kscale_sts3215.read(kscale(tmp_path, lost=(7, 20)))[0]
        expected = 0.5 * np.sin(np.arange(40) / 10)
        np.testing.assert_allclose(trial.channel("angle"), expected, atol=3e-3)
        assert trial.conditions["lost_samples"] == 2

    def test_a_fast_swing_is_no_spike(self):
        swing = 1.5 * np.sin(np.arange(300) / 15)
        mended, lost = servo.despiked(swing)
        assert lost == 0 and (mended == swing).all()

    def test_rows_are_chosen_and_written_as_a_dataset(self, tmp_path):
        trials = kscale_sts3215.read(
            kscale(tmp_path), wanted=lambda row: row["file"] == "b"
        )
        assert [trial.conditions["repeat"] for trial in trials] == [1]
        dataset.write(tmp_path / "set", trials)
        back = dataset.read(tmp_path / "set").trials[0]
        assert (back.observed == trials[0].observed).all()
        assert back.conditions == trials[0].conditions

    def test_what_is_missing_is_said(self, tmp_path):
        with pytest.raises(FormatError, match=r"holds no index\.csv"):
            kscale_sts3215.read(tmp_path)
        columns = ["clock", *COLUMNS[1:]]
        with pytest.raises(FormatError, match="no column 'timestamp'"):
            kscale_sts3215.read(kscale(tmp_path, columns=columns))
        kscale(tmp_path)
        (tmp_path / "index.csv").write_text("file,kp\na,16\n")
        with pytest.raises(FormatError, match="column 'mass'"):
            kscale_sts3215.read(tmp_path)


def bam_run(**changes) -> dict:
    entries = [
        {
            "timestamp": 0.005 * k,
            "position": 0.01 * k,
            "speed": 2.0,
            "load": [0, 12, 65535, 65436][k % 4],
            "input_volts": 7.3,
            "temp": 28,
            "goal_position": 0.02 * k,
            "torque_enable": k < 5,
        }
        for k in range(8)
    ]
    told = {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4, "trajectory": "sin_sin"}
    return {**told, "motor": "xl330", "entries": entries, **changes}


class TestXl330:
    def test_current_is_signed_again(self, tmp_path):
        (tmp_path / "run.json").write_text(json.dumps(bam_run()))
        (trial,) = xl330.read(tmp_path)
        np.testing.assert_allclose(
            trial.channel("current")[:4], [0, 0.012, -0.001, -0.1]
        )
        assert trial.conditions["voltage"] == pytest.approx(7.3)
        assert trial.conditions["gain"] == 200
        assert trial.commands.values[:, 1].tolist() == [1] * 5 + [0] * 2

    def test_faults_are_said(self, tmp_path):
        with pytest.raises(FormatError, match=r"no \.json file"):
            xl330.read(tmp_path)
        back = bam_run()
        back["entries"][3]["timestamp"] = 0.0
        (tmp_path / "run.json").write_text(json.dumps(back))
        with pytest.raises(FormatError, match="does not go forward at sample 3"):
            xl330.read(tmp_path)
        (tmp_path / "run.json").write_text(json.dumps({"mass": 1}))
        with pytest.raises(FormatError, match="no run of an XL330"):
            xl330.read(tmp_path)
        (tmp_path / "run.json").write_text(json.dumps(bam_run(entries=[])))
        with pytest.raises(FormatError, match="0 samples"):
            xl330.read(tmp_path)


TUPLE = '{ "T": 0.8, "phi_l": 0.5, "phi_r": 0.4, "sm": [ 0.008, -1e-4, -2e-3 ] }'


class TestKheperaOdometry:
    def test_two_objects_on_a_line_are_two_intervals(self, tmp_path):
        text = f"{TUPLE}\n{TUPLE} {TUPLE}\n\n{TUPLE}"
        (tmp_path / khepera3_odometry.TUPLES).write_text(text)
        trial = khepera3_odometry.read(tmp_path)
        assert len(trial.commands) == 4
        speeds = [0.5 * 0.0205, 0.4 * 0.0205]
        np.testing.assert_allclose(trial.commands.values[2], speeds)
        moved = body_displacements(trial.command_poses_world)
        np.testing.assert_allclose(moved[3], [0.008, -1e-4, -2e-3], atol=1e-15)

    def test_published_estimate(self, tmp_path):
        values = dict(zip(khepera3_odometry.PARAMETERS, range(6), strict=True))
        content = {**values, "covariance": np.diag([4.0] * 6).tolist()}
        (tmp_path / khepera3_odometry.RESULTS).write_text(json.dumps(content))
        found = khepera3_odometry.published(tmp_path)
        assert found.values["l_x"] == 3 and found.deviations["axle"] == 2

    @pytest.mark.parametrize(
        "text, said",
        [
            (f"{TUPLE}\nnonsense", "line 2"),
            (f"{TUPLE}\n{{}}", "object 2"),
            (TUPLE.replace("0.8", "-0.8"), "not positive"),
            ("", "no interval"),
        ],
    )
    def test_faults_are_said(self, tmp_path, text, said):
        (tmp_path / khepera3_odometry.TUPLES).write_text(text)
        with pytest.raises(FormatError, match=said):
            khepera3_odometry.read(tmp_path)


def mrclam(directory, *, hole=False):
    times = 1.2e9 + np.arange(0, 30, 0.02)
    speeds = np.where(times < 1.2e9 + 7, 0.1, 0.2)
    told = np.stack([times, speeds, 0 * times], axis=1)
    seen = np.stack([times + 0.001, times - 1.2e9, 0 * times, 3 + times % 2], axis=1)
    if hole:
        seen = seen[(times < 1.2e9 + 12) | (times > 1.2e9 + 14)]
    seen[:, 3] = (seen[:, 3] + np.pi) % (2 * np.pi) - np.pi
    np.savetxt(directory / "Robot2_Odometry.dat", told, fmt="%.3f", header="Time v w")
    lines = "\n".join(" ".join(f"{v:.4f}" for v in row) for row in seen)
    with gzip.open(directory / "Robot2_Groundtruth.dat.gz", "wt") as file:
        file.write(f"# Time x y\n{lines}\n")
    return directory


class TestMrclam:
    def test_equal_commands_become_one_and_headings_do_not_jump(self, tmp_path):
        assert mrclam6.robots(mrclam(tmp_path)) == (2,)
        first, second = mrclam6.read(tmp_path, 2, seconds=10.0)
        np.testing.assert_allclose(first.commands.values[:, 0], [0.1, 0.2])
        np.testing.assert_allclose(first.commands.durations, [7, 3], atol=0.02)
        assert second.commands.values.tolist() == [[0.2, 0.0]]
        assert np.abs(np.diff(first.poses_world[:, 2])).max() < 2.5
        assert first.boundaries[1] == np.searchsorted(first.times, 6.999 - 0.001)

    def test_a_hole_in_the_poses_leaves_its_trial_out(self, tmp_path):
        trials = mrclam6.read(mrclam(tmp_path, hole=True), 2, seconds=10.0)
        assert [trial.conditions["part"] for trial in trials] == [0]

    def test_faults_are_said(self, tmp_path):
        with pytest.raises(FormatError, match="robots there: 2"):
            mrclam6.read(mrclam(tmp_path), 3)
        (tmp_path / "Robot2_Odometry.dat").write_text("2 0 0\n1 0 0\n")
        with pytest.raises(FormatError, match="backwards at row 2"):
            mrclam6.read(tmp_path, 2)
        (tmp_path / "Robot2_Odometry.dat").write_text("2 0 zero\n")
        with pytest.raises(FormatError, match="no table of numbers"):
            mrclam6.read(tmp_path, 2)
