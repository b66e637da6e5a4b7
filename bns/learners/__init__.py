"""What is learned, and how a trial of it is run: one file each, found by name.

A module has `DOC` (one line) and

    def make(configs, *, replicates, onsets)

which gives the learner of a batch, one run per configuration in `configs`: an object
with `propose(trial)` (what to try: `tried` and `best`, R items each, `best` None where
there is nothing else to measure), `observe(trial, tried, best)` (the figures and
arrays of a `Step`), `state()` and `restore(arrays)`;

    def execute(world, tried, *, trial, seeds)

which runs items of a proposal in a world and gives their trials; and

    def surroundings(config)

which gives what the world has to be told beside the robot, its damage and its
reality: keyword arguments of the world.

`DEARNESS` (1 where it is missing) says how much dearer a generation is than one of
navigation: it decides whether compiling pays.
"""
