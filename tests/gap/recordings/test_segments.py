"""What went on in a window does not hold the noise of its samples."""

import numpy as np

from bns.gap.recordings import segments


def test_a_robot_that_stays_has_no_places():
    noise = np.random.default_rng(0).normal(0, 1e-3, (50, 3))
    coarse = segments.coarse(noise + np.array([0.4, -0.2, 3.1]))
    assert np.ptp(coarse, axis=0).max() < 1e-12
    along = np.linspace(0, 1, 50)[:, None] * [0.5, 0.0, 0.0]
    assert len(np.unique(segments.coarse(along)[:, 0].round(9))) == 17  # 0.5 m / 3 cm
