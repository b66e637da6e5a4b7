"""Train Bootstrapped Neuro-Simulation, weaken a wheel on the way, read the record.

python examples/03_train_a_learner.py          (some minutes)
python examples/03_train_a_learner.py --quick  (too short to solve anything)
"""

import argparse
from dataclasses import replace

from bns import presets, stats, train
from bns.worlds.trial import Trial

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="three trials")
quick = parser.parse_args().quick

# A preset is a frozen tree of settings; `replace` gives one with other settings.
config = presets.load("demo")
if quick:
    config = replace(
        config,
        trials=3,
        replicates=2,
        evolution=replace(config.evolution, generations=5),
        snn=replace(config.snn, epochs=20),
        world=replace(config.world, damage=("wheel_gain:wheel=left,factor=0.8@2",)),
    )


def tell(trial: int, step: object, trials: list[Trial]) -> None:
    """Called after every trial, with what each replicate did in the world."""
    lengths = [len(done.commands) for done in trials]
    print(f"trial {trial + 1:3d}: lists of {min(lengths)} to {max(lengths)} commands")


record = train(config, on_trial=tell)  # a directory as second argument stores it

solved = stats.trials_to_solve(record)
recovered = stats.trials_to_recover(record)
print(f"\ndamage: {', '.join(config.world.damage)}")
print(f"trials to solve, per replicate:   {solved}")
print(f"trials to recover, per replicate: {recovered}  (inf = not within the run)")
print("\nmedian over replicates, by trial:")
print("trial   cost [cm]  reached  SNN error [mm]")
for trial in range(record.trials):
    cost = stats.median(record["fitness"][:, trial])
    reached = stats.median(record["reached"][:, trial])
    error = 1000 * stats.median(record["snn_forward"][:, trial])
    damaged = "  damaged" if record["damaged"][:, trial].any() else ""
    print(f"{trial + 1:5d} {cost:11.0f} {reached:8.1f} {error:15.1f}{damaged}")
