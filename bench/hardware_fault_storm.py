"""Half an hour of trials over a line that loses and corrupts bytes."""

import numpy as np

from bench.result import Result

DOC = "trials over a line with 1 % lost bytes, 1 % corrupted packets, mute answers"
BAR = "no wrong trial accepted, no hang, every fault logged (30 min of trials)"
MINUTES = 30.0
LOST, CORRUPTED, MUTE = 0.01, 0.01, 0.005
FAR, TURNED = 0.005, np.deg2rad(3.0)  # m, rad: what a command's end may be off
ASTRAY = 0.03  # m that a wheel may be led astray within a command: 0.25 s at 0.12 m/s


def run(quick: bool) -> Result:
    """The whole session in virtual time: emulated robot, line, camera and tracker.

    A trial that is accepted is wrong if a pose at a command's end is off the true one
    at its moment, or if the set points that reached the robot led a wheel astray of
    the commands recorded. The figure is the number of wrong trials.
    """
    from bns.hardware.emulators import virtual
    from bns.hardware.excitation import commands
    from bns.hardware.world import HardwareWorld

    minutes = 1.0 if quick else MINUTES
    rig = virtual.rig(lost=LOST, corrupted=CORRUPTED, mute=MUTE, seed=11)
    world = HardwareWorld(rig=rig)
    wrong, trials, late = [], 0, []
    spoilt = rig.line.device.counts
    while rig.clock.now() < 60 * minutes:
        told = commands(8, seed=5, number=trials)
        (trial,) = world.run([told], trial=trials)
        fault = _wrong(rig, trial)
        if fault:
            wrong.append(f"trial {trials}: {fault}")
        late.append(trial.conditions["late"])
        trials += 1
    kinds = dict(rig.faults.counts)
    logged = len(rig.faults.faults) == len(rig.faults) > 0
    return Result(
        figure=len(wrong),
        unit="wrong trials",
        holds=not wrong and logged and (quick or rig.clock.now() >= 60 * MINUTES),
        n=trials,
        details={
            "virtual minutes": round(rig.clock.now() / 60, 2),
            "void trials, repeated": world.voids,
            "bytes lost": spoilt["lost"],
            "packets corrupted": spoilt["corrupted"],
            "faults logged": kinds,
            "latest command [s]": max(late),
            "wrong": wrong,
        },
    )


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
