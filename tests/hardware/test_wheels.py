"""Set points that a line spoils are put right or make a trial void; damage does not."""

import numpy as np
import pytest

from bns.worlds.trial import Commands

pytest.importorskip("cv2")

from bns.hardware.emulators import virtual
from bns.hardware.worlds.real_robot import TRIES
from bns.hardware.worlds.wheeled import HardwareWorld

LONG = Commands([[0.12, 0.11], [-0.10, -0.12]], [2.4, 2.2])


class Spoilt:
    """A device that hears another number instead of one, so many times."""

    def __init__(self, device, heard, instead, times):
        self.device, self.heard, self.instead = device, heard, instead
        self.times = times

    def receive(self, data, now):
        if self.heard in data and self.times:
            self.times -= 1
            data = data.replace(self.heard, self.instead)
        return self.device.receive(data, now)

    def advance(self, now):
        self.device.advance(now)


def spoilt(rig, told, instead, times):
    """The rig, its line spoiling some set points and (so it seems) some answers."""
    units = round(rig.robot.units.units(told))
    words = f"l{units},".encode(), f"l{round(rig.robot.units.units(instead))},".encode()
    rig.line.device = Spoilt(rig.line.device, *words, times)
    for _ in range(10):  # else the line is not suspected
        rig.faults.note("garbled answer")
    return rig


def test_a_set_point_that_was_spoilt_is_sent_again_and_the_trial_is_void():
    rig = spoilt(virtual.rig(), 0.12, 0.02, 2)
    (trial,) = HardwareWorld(rig=rig).run([LONG])
    assert rig.faults.counts["wheels not as told"] >= 1
    assert (
        len(trial.conditions["voids"]) == 1 and "astray" in trial.conditions["voids"][0]
    )
    told = [row[1:] for row in rig.device.log]
    wrong = told.index((2880, 15841))
    assert (17281, 15841) in told[wrong:]


class Unanswered(Spoilt):
    """A device whose answers to a number are lost, so many times."""

    def receive(self, data, now):
        answer = self.device.receive(data, now)
        if self.heard in data and self.times:
            self.times -= 1
            return type(answer)()
        return answer


def test_a_first_set_point_that_may_have_held_before_makes_the_trial_void():
    rig = virtual.rig()
    world = HardwareWorld(rig=rig)
    world.run([LONG])  # from then on it is known how soon answers come
    units = round(rig.robot.units.units(0.12))
    rig.line.device = Unanswered(rig.line.device, f"l{units},".encode(), b"", 1)
    (trial,) = world.run([LONG], trial=1)
    (why,) = trial.conditions["voids"]
    assert "the first command had to be sent again" in why
    began = [row[0] for row in rig.device.log if row[1] == units]
    assert trial.conditions["first"] == pytest.approx(
        min(moment for moment in began if moment > trial.conditions["began"]), abs=0.05
    )


@pytest.mark.parametrize("suspected", [False, True])
def test_a_damaged_wheel_is_learned_and_not_taken_for_the_line(suspected):
    rig = virtual.rig(["wheel_gain:wheel=left,factor=0.6"])
    for _ in range(10 * suspected):
        rig.faults.note("garbled answer")
    world = HardwareWorld(rig=rig)
    (trial,) = world.run([LONG])
    assert trial.conditions["notes"] == ["a wheel does not follow its set point"]
    assert world.voids <= 1 < TRIES
    if suspected:
        assert rig.following.shares == pytest.approx([0.6, 1.0], abs=0.06)
    before = rig.faults.counts["wheels not as told"]
    (again,) = world.run([LONG], trial=1)
    assert rig.faults.counts["wheels not as told"] == before
    assert np.isfinite(again.poses_world).all()
