"""Logs as people have them: empty cells, orders of a controller's own, turned signs."""

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.describe import describe
from bns.gap.models.mjcf import guesses, matching
from bns.gap.models.mjcf.command_steps import stepped
from bns.gap.models.mjcf.log import bridged
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.recordings import check, load_recordings
from bns.worlds.trial import Channel, Commands, Trial
from tests.sources import ROOT

ARM = ROOT / "examples" / "arm" / "arm.xml"
RATE, COUNT = 50, 500
DELAY = 3  # samples by which the joints follow


def goals():
    """Two joints' goals, ``(T, 2)``."""
    times = np.arange(COUNT) / RATE
    return np.stack([0.4 * np.sin(2 * times), 0.3 * np.sin(3.1 * times + 1)], axis=1)


def followed(told):
    """Joints that come to each goal a little later, ``(T, 2)``."""
    return np.concatenate([told[:1].repeat(DELAY, axis=0), told[:-DELAY]])


def written(path, columns):
    """A CSV log of columns ``(T,)`` by name; empty cells for NaN."""
    lines = [",".join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(",".join("" if np.isnan(x) else repr(float(x)) for x in row))
    path.write_text("\n".join(lines) + "\n")
    return path


def log(path, told, seen, names=("shoulder_goal", "elbow_goal", "shoulder", "elbow")):
    """A log of two joints."""
    columns = {"time": np.arange(len(told)) / RATE}
    return written(path, columns | dict(zip(names, [*told.T, *seen.T], strict=True)))


def read(found, tmp_path, path):
    """Trials of a log by its own description."""
    found.write(tmp_path / "arm.toml")
    model = OwnModel.read(tmp_path / "arm.toml", threads=1)
    return model, model.read_log(str(path))


@pytest.fixture
def sparse(tmp_path):
    """Goals written where they change only, every fifth row from the third on."""
    told = goals()[np.arange(COUNT) // 5 * 5]
    cells = told.copy()
    cells[np.arange(COUNT) % 5 != 0] = np.nan
    cells[0] = np.nan
    return log(tmp_path / "log.csv", cells, followed(told)), told


def test_empty_cells_of_commands_hold_the_last_one(sparse, tmp_path):
    path, told = sparse
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    assert any("5 rows before the first" in line for line in found.guessed)
    assert any("held over the empty cells" in line for line in found.guessed)
    _, trials = read(found, tmp_path, path)
    assert trials[0].commands.values[0] == pytest.approx(told[5])


def test_a_column_without_a_number_is_left_out(tmp_path):
    told, seen = goals(), followed(goals())
    seen[:, 1] = np.nan
    path = log(tmp_path / "log.csv", told, seen)
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    assert "elbow: holds no number, left out" in found.unsure
    assert "[observed." + '"elbow"]' not in found.toml


def test_a_described_column_without_a_number_is_refused(tmp_path):
    told, seen = goals(), followed(goals())
    whole = log(tmp_path / "whole.csv", told, seen)
    found = describe(ARM, whole, out=tmp_path / "arm.toml")
    seen[:, 1] = np.nan
    path = log(tmp_path / "log.csv", told, seen)
    with pytest.raises(FormatError, match="elbow holds no number"):
        read(found, tmp_path, path)


def test_commands_in_an_order_of_their_own_go_to_joints_that_follow(tmp_path):
    told, seen = goals(), followed(goals())
    names = ("cmd.0", "cmd.1", "shoulder", "elbow")
    path = log(tmp_path / "log.csv", told[:, ::-1], seen, names)
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    lines = [line for line in found.unsure if "follows it" in line]
    assert len(lines) == 2 and "cmd.0: told to actuator 'elbow_servo'" in lines[0]


def test_a_turned_sign_is_told_and_can_be_turned_back(tmp_path):
    told, seen = goals(), followed(goals())
    seen[:, 1] *= -1
    path = log(tmp_path / "log.csv", told, seen)
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    assert any("elbow" in line and "scale = -1" in line for line in found.unsure)
    model, trials = read(found, tmp_path, path)
    notes = check.check(trials, model)[1]
    assert any("elbow moves against the model" in note for note in notes)
    text = (tmp_path / "arm.toml").read_text()
    turned = tmp_path / "turned.toml"
    turned.write_text(text + '\n[log]\nelbow = { column = "elbow", scale = -1 }\n')
    model = OwnModel.read(turned, threads=1)
    trials = model.read_log(str(path))
    assert not any("against" in note for note in check.check(trials, model)[1])
    turned.write_text(text + '\n[log]\nelbow = { column = "elbow", scale = 0 }\n')
    with pytest.raises(FormatError, match="scale of elbow is 0"):
        OwnModel.read(turned, threads=1)


def with_rows(told, kept):
    """Columns of some rows of a log, and the names of its commands."""
    columns = {"time": np.arange(COUNT)[kept] / RATE, "angle": told[kept, 0]}
    return columns | dict(zip(("a", "b"), told[kept].T, strict=True)), ("a", "b")


def test_commands_go_on_where_rows_are_lost():
    """A command held over a lost row would come late, and pass for a gap."""
    kept = ~np.isin(np.arange(COUNT), [40, 90, 91, 92, 93])
    made = bridged(*with_rows(goals(), kept))
    np.testing.assert_allclose(made["time"], np.arange(COUNT) / RATE)
    np.testing.assert_allclose(np.c_[made["a"], made["b"]], goals(), atol=1e-3)
    np.testing.assert_array_equal(np.isfinite(made["angle"]), kept)


def test_steps_are_held_where_rows_are_lost():
    kept = ~np.isin(np.arange(COUNT), [24, 25, 26, 60])
    columns, names = with_rows(goals()[np.arange(COUNT) // 25 * 25], kept)
    assert bridged(columns, names) is columns


def test_commands_with_rows_of_their_own_have_their_own_times(tmp_path):
    told = goals()[np.arange(COUNT) // 5 * 5]
    times = np.arange(COUNT) / RATE
    changes = np.arange(5, COUNT, 5)
    every = np.concatenate([times, times[changes] - 0.007])
    order = np.argsort(every)
    held = told[np.searchsorted(times[changes] - 0.007, every[order], "right") * 5]
    seen = np.concatenate([followed(told), np.full((len(changes), 2), np.nan)])[order]
    names = ("shoulder_goal", "elbow_goal", "shoulder", "elbow")
    columns = {"time": every[order]} | dict(zip(names, [*held.T, *seen.T], strict=True))
    path = written(tmp_path / "log.csv", columns)
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    model, trials = read(found, tmp_path, path)
    assert not any("command began" in note for note in check.check(trials, model)[1])


@pytest.mark.parametrize(("every", "curve"), [(0.02, True), (0.5, False)])
def test_a_curve_is_told_by_time_not_by_rows(every, curve):
    times = np.arange(0.0, 10.0, 0.002)  # readings at 500 Hz
    told = np.sin(np.floor(times / every) * every)[:, None]
    assert guesses.curved(told, 10.0) is curve


def test_columns_are_alike_where_both_have_numbers():
    one = np.r_[np.arange(10.0), np.nan]
    assert matching.alike(one, one) == pytest.approx(1.0)
    assert matching.alike(one, np.zeros(11)) == 0.0


def timed(durations, **conditions):
    """A trial of one joint whose commands are 1, 2, 3, ..."""
    times = np.append(0.0, np.cumsum(durations))
    told = np.arange(1.0, len(durations) + 1)[:, None]
    return Trial(
        commands=Commands(told, np.array(durations), (Channel("u", "1"),)),
        times=times,
        observed=np.zeros((len(times), 1)),
        boundaries=np.arange(len(times)),
        channels=(Channel("q", "rad"),),
        conditions=conditions,
    )


@pytest.mark.parametrize(
    ("durations", "told", "number"),
    [
        ((0.004, 0.004, 0.004), (1, 1, 2, 2, 3, 3), (0, 0, 1, 1, 2, 2)),
        ((0.005, 0.005, 0.004), (1, 1, 1.5, 2, 2, 3, 3), (0, 0, 1, 1, 1, 2, 2)),
        ((0.0005, 0.0005, 0.003), (2.25, 3), (2, 2)),
    ],
)
def test_a_command_that_ends_within_a_step_is_its_mean(durations, told, number):
    values, numbers = stepped(timed(durations), 0.002)
    assert values[:, 0] == pytest.approx(told)
    assert tuple(numbers) == number
    whole = np.array(durations) @ np.arange(1.0, len(durations) + 1)
    assert values.sum() * 0.002 == pytest.approx(whole)


def test_ends_that_mujoco_rounded_stay_rounded():
    values, _ = stepped(timed((0.005, 0.005, 0.004), mujoco="3"), 0.002)
    assert values[:, 0].tolist() == [1, 1, 2, 2, 2, 3, 3]


def test_commands_that_last_whole_steps_may_end_between_them(tmp_path):
    """As in pieces of a recording: each on a grid of its own, the commands of one would
    come up to half a step early or late."""
    model = OwnModel.read(ARM.with_suffix(".toml"), threads=1)
    told = goals()
    times = np.arange(COUNT) / RATE + np.where(np.arange(COUNT) % 150 < 75, 0, 0.0009)
    names = ("shoulder_goal", "elbow_goal", "shoulder", "elbow")
    columns = dict(zip(names, [*told.T, *followed(told).T], strict=True))
    path = written(tmp_path / "log.csv", {"time": times} | columns)
    (trial,) = load_recordings.trials([str(path)], model)
    ends = np.cumsum(trial.commands.durations)
    kept = np.cumsum(np.diff(times))
    assert set(np.round(ends, 9)) <= set(np.round(kept, 9))


def test_stamps_of_a_coarse_clock_come_in_pairs(tmp_path):
    """A clock that ticks at half the rate: pieces begin between two alike."""
    told, seen = goals(), followed(goals())
    names = ("shoulder_goal", "elbow_goal", "shoulder", "elbow")
    columns = {"time": np.arange(COUNT) // 2 * 2 / RATE}
    columns |= dict(zip(names, [*told.T, *seen.T], strict=True))
    path = written(tmp_path / "log.csv", columns)
    found = describe(ARM, path, out=tmp_path / "arm.toml")
    model, trials = read(found, tmp_path, path)
    assert len(trials) > 1
    assert len(check.check(trials, model)[0]) == len(trials)


def test_a_xacro_is_to_be_expanded_first(tmp_path):
    model = tmp_path / "arm.xacro"
    model.write_text("<robot/>")
    path = log(tmp_path / "log.csv", goals(), followed(goals()))
    with pytest.raises(FormatError, match=r"run `xacro .*arm.urdf`"):
        describe(model, path)


@pytest.mark.parametrize("factor", [1e3, 1e-6])
def test_a_time_in_another_unit_is_refused_at_once(tmp_path, factor):
    path = log(tmp_path / "log.csv", goals(), followed(goals()))
    model, _ = read(describe(ARM, path, out=tmp_path / "arm.toml"), tmp_path, path)
    columns = {"time": np.arange(COUNT) / RATE * factor}
    names = ("shoulder_goal", "elbow_goal", "shoulder", "elbow")
    columns |= dict.fromkeys(names, np.linspace(0, 1, COUNT))
    other = written(tmp_path / "other.csv", columns)
    with pytest.raises(FormatError, match="samples a second"):
        model.read_log(str(other))


@pytest.mark.parametrize(
    ("section", "unit", "said"),
    [
        ("commands", "deg", 'unit = "rad" here, and of its column'),
        ("observed", "deg", 'unit = "rad" here, and of its column'),
        ("observed", "furlong", "joints and places are in rad, m"),
    ],
)
def test_channels_in_other_units_are_refused(tmp_path, section, unit, said):
    path = log(tmp_path / "log.csv", goals(), followed(goals()))
    describe(ARM, path, out=tmp_path / "arm.toml").write(tmp_path / "arm.toml")
    before, mark, after = (tmp_path / "arm.toml").read_text().partition(f"[{section}.")
    after = after.replace('unit = "rad"', f'unit = "{unit}"', 1)
    (tmp_path / "arm.toml").write_text(before + mark + after)
    with pytest.raises(FormatError, match=said):
        OwnModel.read(tmp_path / "arm.toml", threads=1)
