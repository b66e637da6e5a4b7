"""The hexapod's bus: ROBOTIS's SDK against emulated servos on a pseudo terminal."""

import os
import time
from contextlib import ExitStack

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.hardware.clock import RealClock
from bns.hardware.dynamixel import joints, packets
from bns.hardware.emulators.hexapod import ServoBank
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.faults import LinkError, SafetyStop, Void

pytest.importorskip("dynamixel_sdk")
pytest.importorskip("serial")


@pytest.fixture
def served(tmp_path, serving):
    """Serves servos on a port; gives port and servos."""
    with ExitStack() as ends:

        def serve(**settings):
            bank = ServoBank(at=RealClock().now(), **settings)
            bank.host = PtyHost(bank, tmp_path / "bus")
            ends.enter_context(serving(bank.host))
            return str(tmp_path / "bus"), bank

        yield serve


def opened(port, **settings):
    from bns.hardware.dynamixel.bus import Bus

    return Bus(port, joints.read(), RealClock(), latency=0.3, **settings)


def test_goals_reach_all_servos_and_states_come_back(served, guard):
    port, bank = served()
    bus = opened(port, guard=guard)
    bus.identify()
    bus.power()
    bus.write({joint.name: 0.2 for joint in bus.joints})
    RealClock().sleep(0.5)
    for joint in bus.joints:
        state = bus.read(joint.id)
        assert joint.angle(state.position) == pytest.approx(0.2, abs=0.01)
        assert (state.voltage, state.temperature) == (11.1, 35)
    assert bus.guard.fed[-1] is True
    bus.close()
    RealClock().sleep(0.05)
    assert not any(table[packets.TORQUE] for table in bank.tables.values())


def test_missing_and_doubled_servos_are_named(served):
    port, _ = served(numbers=[n for n in range(1, 19) if n != 7])
    with pytest.raises(BnsError, match=r"Servos \[7\] do not answer"):
        opened(port).identify()


def test_doubled_servos_are_named(served):
    port, _ = served(numbers=[*range(1, 19), 5])
    with pytest.raises(BnsError, match=r"\[5\].*two have one number"):
        opened(port).identify()


def test_nothing_moves_unguarded_and_a_low_battery_stops(served):
    port, bank = served(voltage=9.5)
    bus = opened(port)
    with pytest.raises(BnsError, match="Nobody guards"):
        bus.write({joint.name: 0.0 for joint in bus.joints})
    assert not bank.goals
    with pytest.raises(SafetyStop, match=r"9\.5 V"):
        bus.look()


def test_goals_stay_between_the_end_stops():
    joint = joints.Joint("knee", 1, -1, 512, 200, 800)
    assert joint.units(0.0) == 512
    assert joint.units(9.0) == 200
    assert joint.angle(joint.units(0.5)) == pytest.approx(0.5, abs=0.003)


def test_a_servo_given_twice_is_refused(tmp_path):
    path = tmp_path / "r.toml"
    line = "{ id = 1, sign = 1, zero = 512, low = 1, high = 9 }"
    path.write_text(f"[joints]\na = {line}\nb = {line}\n")
    with pytest.raises(FormatError, match="servo 1 is given twice"):
        joints.read(path)


def test_packets_of_the_manual():
    found, rest = packets.instructions(b"\xff\xff\x01\x02\x01\xfb")
    assert found == [packets.Instruction(1, packets.PING, b"")] and rest == b""
    assert packets.status(1, 0) == b"\xff\xff\x01\x02\x00\xfc"
    assert packets.words(0b100001) == "input voltage, overload"
    spoilt = packets.instructions(b"\xff\xff\x01\x02\x01\xfa\xff\xff\x01\x02\x01\xfb")
    assert len(spoilt[0]) == 1


def test_a_full_turn_of_the_law_takes_the_motors_time():
    bank = ServoBank([1])
    bank.tables[1][packets.TORQUE] = 1
    bank.tables[1][30:32] = b"\xff\x03"
    for step in range(1, 101):
        bank.advance(step * 0.01)
    way = bank.place[1] - 512
    assert 0.9 * 511 < way <= 511
    assert np.isclose(packets.UNITS, 1023 / np.deg2rad(300), rtol=1e-5)


@pytest.fixture
def standing(served, guard):
    """A bus whose servos hold, and the servos."""
    port, bank = served()
    bus = opened(port, guard=guard)
    bus.write({joint.name: 0.0 for joint in bus.joints})
    bus.power()
    bus.read(1)
    return bus, bank


def test_a_bus_that_goes_on_talking_is_left_and_the_stop_gets_through(standing):
    bus, bank = standing
    bank.host.baud, bank.host.flooded = packets.BAUD, True
    with pytest.raises((Void, LinkError)):
        for _ in range(200):
            bus.read(2)
    bank.host.flooded = False
    bus.stop()
    assert not any(table[packets.TORQUE] for table in bank.tables.values())
    assert bus.guard.fed[-1] is False
    bus.release()


def test_servos_that_were_reset_are_noticed(standing):
    bus, bank = standing
    bus.powered()
    bank.restart(RealClock().now(), power=True)
    with pytest.raises(Void, match="has lost its torque"):
        bus.powered()
    bus.close()


def test_a_stop_that_no_servo_confirms_is_said_so(standing):
    bus, bank = standing
    bank.host.deaf_until = float("inf")
    with pytest.raises(LinkError, match="do not confirm"):
        bus.stop()
    assert bus.guard.fed[-1] is True
    bus.release()


def test_somebody_who_opens_the_port_stops_the_robot(standing):
    bus, bank = standing
    other = os.open(bank.host.link, os.O_RDWR | os.O_NOCTTY)
    os.close(other)
    with pytest.raises(Void, match="another program"):
        bus.write({joint.name: 0.0 for joint in bus.joints})
    bus.close()


def test_a_wall_clock_that_is_set_does_not_matter(standing, monkeypatch):
    bus, _ = standing
    jumps = iter(range(10**6))
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + 3600 * (next(jumps) % 3 - 1))
    for joint in bus.joints:
        assert bus.read(joint.id).voltage == 11.1
    assert not len(bus.faults)
    bus.close()


def test_a_servo_that_falls_silent_makes_the_trial_void_where_torque_is_on(standing):
    bus, bank = standing
    bank.numbers.remove(7)
    with pytest.raises(Void, match="servo 7 gave no proper answer"):
        bus.read(7)
    bus.stop()
    with pytest.raises(LinkError, match="check its cable"):
        bus.read(7)
    bus.close()


def test_an_answer_is_not_waited_for_without_end_on_a_line_that_never_rests(standing):
    bus, _ = standing
    bus.stop()
    begin = time.monotonic()
    with open("/dev/zero", "rb", buffering=0) as garbage:
        line, bus._port.ser = bus._port.ser, garbage
        bus._port.setPacketTimeout(8)
        _, result = bus._protocol.rxPacket(bus._port)
        bus._port.ser = line
    assert result != 0 and time.monotonic() - begin < 10.0
    bus.close()
