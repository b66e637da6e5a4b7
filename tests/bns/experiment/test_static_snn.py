"""Static nets: a known world is imitated, and the form of a world is the network."""

import numpy as np

from bns.experiment import static_snn
from bns.experiment.config import RunConfig
from bns.worlds import registry


def test_imitates_a_known_world():
    source = registry.make("static-snn", robot="khepera3")
    nets = static_snn.fit(source, RunConfig(threads=1), lists=60, epochs=600)
    rng = np.random.default_rng(0)
    speeds = rng.uniform(0, 0.12, (200, 4))
    inputs = np.column_stack([speeds, rng.uniform(0.3, 3.1, 200)])
    miss = nets(inputs) - source.nets(inputs)
    assert (np.sqrt((miss**2).mean(0)) < [0.012, 0.012, 0.08]).all()
    assert nets.provenance["commands"] == 54 * static_snn.PER_LIST
