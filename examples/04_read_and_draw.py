"""Read a stored run, draw a figure of your own choice, write the report.

bns run demo --out runs/demo
python examples/04_read_and_draw.py runs/demo
"""

import argparse
from dataclasses import replace
from pathlib import Path

from bns import presets, stats, train
from bns.storage.store import load
from bns.viz import figures, report

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("directory", type=Path, nargs="?", default=Path("runs/demo"))
parser.add_argument("--quick", action="store_true", help="make a tiny run and read it")
given = parser.parse_args()

if given.quick:
    tiny = presets.load("demo")
    tiny = replace(
        tiny,
        trials=4,
        replicates=3,
        evolution=replace(tiny.evolution, generations=5),
        snn=replace(tiny.snn, epochs=20),
        world=replace(tiny.world, damage=("wheel_gain:wheel=left,factor=0.8@2",)),
    )
    given.directory = Path("runs/tiny")
    train(tiny, given.directory)

record = load(given.directory)
print(f"{given.directory}: {record.replicates} replicates, {record.trials} trials")
print(f"made with MuJoCo {record.versions['mujoco']}, seed {record.config.seed}")

# Every figure is a function from records to a matplotlib figure.
figures.path(record).savefig("path.png", dpi=150)
figures.fitness({given.directory.name: record}).savefig("fitness.png", dpi=150)

# Or draw your own: every column is an array, replicates by trials.
error = record["snn_forward"]
before, after = error[:, : record.damage_onset[0]], error[:, record.damage_onset[0] :]
print(
    f"SNN error before damage: {1000 * stats.median(before.ravel()):.1f} mm a command"
)
print(f"SNN error from it on:    {1000 * stats.median(after.ravel()):.1f} mm a command")

page = report.write([given.directory], "report.html")
print(f"Written: path.png, fitness.png, {page}")
