"""Diagnose the gap of a robot of your own, described by an MJCF and a TOML file.

    python examples/07_your_robot.py

The robot is a two-joint arm (`examples/arm`), which the package knows nothing of.
Here its recordings are simulated, with a hidden effect; yours come from a CSV log or
a dataset, with `bns gap diagnose log.csv --model arm.toml --out DIR`.
"""

import argparse
from pathlib import Path

import numpy as np

from bns.gap.bench import mjcf_cases
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf.model import OwnModel

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="one hidden effect only")
hidden: tuple[str, ...] = (
    "joint_damping:part=elbow,added=0.06",
    "command_delay:part=all,delay=0.04",
)
if parser.parse_args().quick:
    hidden = hidden[:1]

arm = OwnModel.read(Path(__file__).parent / "arm" / "arm.toml")
commands = mjcf_cases.commands(arm, np.random.default_rng(0), 4, seconds=3.0)
for text in hidden:
    trials = mjcf_cases.record(arm, commands, [arm.parse(text)], seed=1)
    found = diagnose(trials, arm, full=False)
    print(f"hidden: {text}")
    print(f"found:  {found.verdict.sentence}")
