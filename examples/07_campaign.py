"""A campaign: two windows, two mutation rates, compared.

python examples/07_campaign.py          (some minutes)
python examples/07_campaign.py --quick  (too short to say anything)
"""

import argparse
import tempfile
from pathlib import Path

from bns.campaign import drive, file, results
from bns.campaign.engines import registry
from bns.campaign.table import table

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="two runs of three trials")
quick = parser.parse_args().quick

text = """
preset = "demo"
replicates = 12
[grid]
adaptation.window = [0, 150]
evolution.mutation_rate = [0.05, 0.1]
"""
if quick:
    text = text.replace("replicates = 12", "replicates = 2")
    text += """
[settings]
trials = 3
evolution.generations = 5
snn.epochs = 20
world.damage = ["wheel_gain:wheel=left,factor=0.8@2"]
"""

with tempfile.TemporaryDirectory() as name:
    path = Path(name) / "windows.toml"
    path.write_text(text)
    campaign = file.read(path)
    for member in campaign.members:
        print(member.identity, member.label)

    # `inline` runs here; "local" gives each core a process, "ray" a cluster.
    engine = registry.make("inline")
    session = drive.run(campaign, Path(name) / "store", engine, progress=True)
    print(f"{session.done} batches done, {len(session.failed)} failed\n")

    found = table(results.read(Path(name) / "store"), "observation")

print("cost after the damage (eq 3.1), lower is better")
for row in found.rows:
    print(f"  {row.label:32s} {row.runs:3d} runs, median {row.median.value:8.0f}")
for pair in found.pairs:
    print(f"  {pair.a} against {pair.b}:")
    print(f"    p {pair.p:.3f}, Holm {pair.p_holm:.3f}, A12 {pair.a12.value:.2f}")
