"""An hour of trials over a line that loses and corrupts bytes."""

from collections import Counter

import numpy as np

from bench.hardware.emulated import resumed
from bench.result import Result, bench

PARTS, MINUTES = 6, 10.0  # each part is a session of its own, with its own seed
LOST, CORRUPTED, MUTE = 0.01, 0.01, 0.005
FAR, TURNED = 0.005, np.deg2rad(3.0)  # m, rad: what a command's end may be off
ASTRAY = 0.03  # m that a wheel may be led astray within a command: 0.25 s at 0.12 m/s


@bench(
    "trials over a line with 1 % lost bytes, 1 % corrupted packets, mute answers",
    bar="no wrong trial accepted, no hang, every fault logged (60 min of trials)",
)
def hardware_fault_storm(quick: bool) -> Result:
    """Sessions in virtual time: emulated robot, line, camera and tracker.

    A trial that is accepted is wrong if a pose at a command's end is off the true one
    at its moment, or if the set points that reached the robot led a wheel astray of
    the commands recorded. The figure is the number of wrong trials. Parts that are
    done are kept, so that an interrupted run goes on with the next one.
    """
    if quick:
        parts = [_part(0, 1.0)]
    else:
        keep = resumed("hardware-fault-storm")
        parts = [keep(f"part-{k}", lambda k=k: _part(k, MINUTES)) for k in range(PARTS)]
    wrong = [text for part in parts for text in part["wrong"]]
    kinds: Counter[str] = Counter()
    for part in parts:
        kinds.update(part["faults"])
    minutes = sum(part["minutes"] for part in parts)
    logged = all(part["logged"] for part in parts)
    return Result(
        figure=len(wrong),
        unit="wrong trials",
        holds=not wrong and logged and (quick or minutes >= PARTS * MINUTES),
        n=sum(part["trials"] for part in parts),
        details={
            "virtual minutes": round(minutes, 2),
            "void trials, repeated": sum(part["voids"] for part in parts),
            "bytes lost": sum(part["lost"] for part in parts),
            "packets corrupted": sum(part["corrupted"] for part in parts),
            "faults logged": dict(kinds),
            "latest command [s]": max(part["late"] for part in parts),
            "wrong": wrong,
        },
    )


def _part(number: int, minutes: float) -> dict:
    """A session of some virtual minutes."""
    from bns.hardware.emulators import virtual
    from bns.hardware.excitation import commands
    from bns.hardware.world import HardwareWorld

    rig = virtual.rig(lost=LOST, corrupted=CORRUPTED, mute=MUTE, seed=11 + number)
    world = HardwareWorld(rig=rig)
    wrong, trials, late = [], 0, 0.0
    while rig.clock.now() < 60 * minutes:
        told = commands(8, seed=5 + number, number=trials)
        (trial,) = world.run([told], trial=trials)
        fault = _wrong(rig, trial)
        if fault:
            wrong.append(f"part {number}, trial {trials}: {fault}")
        late = max(late, trial.conditions["late"])
        trials += 1
    return {
        "wrong": wrong,
        "trials": trials,
        "voids": world.voids,
        "minutes": rig.clock.now() / 60,
        "late": late,
        "faults": dict(rig.faults.counts),
        "logged": len(rig.faults.faults) == len(rig.faults) > 0,
        **rig.line.device.counts,
    }


def _wrong(rig, trial) -> str:
    """What is wrong with an accepted trial; empty if nothing is."""
    begin = trial.conditions["began"]
    log = [row for row in rig.device.log if row[0] >= begin]
    first = trial.conditions["first"]
    seen = trial.command_poses_world
    for index, at in enumerate(trial.times[trial.boundaries]):
        true = rig.body.pose(first + at)
        off = seen[index] - true
        off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi
        if not np.isfinite(off).all():
            continue
        if np.hypot(*off[:2]) > FAR or abs(off[2]) > TURNED:
            return f"pose {index} is off by {np.round(off, 4).tolist()}"
    return _astray(rig, trial, log, first)


def _astray(rig, trial, log, first: float) -> str:
    """Compare the set points that held with the commands recorded."""
    dt = 0.005
    times = np.arange(0, trial.commands.duration, dt)
    ends = np.cumsum(trial.commands.durations)
    index = np.minimum(np.searchsorted(ends, times, side="right"), len(ends) - 1)
    moments = np.array([row[0] for row in log]) - first
    held = np.array([row[1:] for row in log], float)
    at = np.clip(np.searchsorted(moments, times, side="right") - 1, 0, None)
    units = rig.robot.units.speed_units
    off = np.abs(held[at].clip(-48000, 48000) / units - trial.commands.values[index])
    for command in range(len(ends)):
        way = off[index == command].sum(0) * dt
        if way.max(initial=0.0) > ASTRAY:
            return f"command {command} led a wheel {way.max():.4f} m astray"
    return ""
