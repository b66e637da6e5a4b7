"""A hexapod gets up from rest, and from nothing else."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.hardware.clock import VirtualClock
from bns.hardware.dynamixel import joints, packets
from bns.hardware.dynamixel.walker import LIES, STILL, Walker
from bns.hardware.faults import FaultLog
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.tracking.tracker import Sighting


class Servos:
    """A bus whose servos sink until a moment; notes when torque goes on."""

    def __init__(self, clock, sinks):
        self.clock, self.sinks, self.guard = clock, sinks, None
        self.joints, self.on, self.goals = joints.read(), [], None

    def read(self, servo):
        self.clock.sleep(0.0015)
        moved = round(100 * min(self.clock.now(), self.sinks))
        return packets.State(512 + moved, 0, 0.0, 11.1, 35)

    def look(self, count):
        return [(joint, self.read(joint.id)) for joint in self.joints[:count]]

    def write(self, goals):
        self.goals = self.goals or goals

    def power(self):
        self.on.append(self.clock.now())

    def powered(self):
        pass

    def pace(self, speed):
        pass

    def stop(self):
        pass


class Eyes:
    """See the robot where it is, at every look."""

    def __init__(self, clock, tag=lambda now: 0.0):
        self.clock, self.tag = clock, tag

    def poll(self):
        now = self.clock.now()
        return [Sighting(now, np.array([self.tag(now), 0.0, 0.0]), 0.1)]


def walker(sinks, **words):
    clock = VirtualClock()
    bus, names = Servos(clock, sinks), tuple(joint.name for joint in joints.read())
    rest = {"limits": Limits(), "operator": Operator(), "faults": FaultLog(clock)}
    return Walker(bus, Eyes(clock, **words), clock, names=names, **rest), bus


def test_torque_comes_on_once_the_robot_that_was_stopped_has_come_to_rest():
    made, bus = walker(sinks=0.8)
    made.rise()
    assert 0.8 + STILL <= bus.on[0] < 0.8 + STILL + 0.2
    joint = bus.joints[0]
    assert bus.goals[joint.name] == joint.angle(592)  # it begins where it lies
    made, bus = walker(sinks=0.0, tag=lambda now: 0.1 * min(now, 1.5))
    made.rise()
    assert 1.5 + STILL - 0.02 <= bus.on[0] < 1.5 + STILL + 0.2


def test_a_robot_that_is_carried_is_not_switched_on():
    made, bus = walker(sinks=1e9)
    with pytest.raises(BnsError, match="let go of it"):
        made.rise()
    assert not bus.on and made.clock.now() > LIES
