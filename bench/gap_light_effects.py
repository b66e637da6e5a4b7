"""Effects on light sensors that the library lacks: cases "outside the library"."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, SensorEffect


class Narrower(OpticsEffect):
    """Sensors see a narrower cone: another exponent of their angular response."""

    name = "off_narrower"
    doc = "sensors see a narrower cone"
    source = "assumed"

    @property
    def is_nominal(self) -> bool:
        """Never."""
        return False

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """The law with twice the exponent."""
        return {**law, "exponent": law["exponent"] * 2.0}


class Nonlinear(SensorEffect):
    """Readings bend: the middle of the range is read too dark."""

    name = "off_nonlinear"
    doc = "readings bend in the middle of their range"
    source = "assumed"

    @property
    def is_nominal(self) -> bool:
        """Never."""
        return False

    def apply(self, times, readings, channels, active, rng):
        """The readings, up to 600 counts darker."""
        share = np.clip(readings / 4095, 0, 1)
        return np.clip(readings + 2400 * share * (1 - share), 0, 4095)


class Coarse(SensorEffect):
    """Readings come in six steps."""

    name = "off_coarse"
    doc = "readings come in six steps"
    source = "assumed"

    @property
    def is_nominal(self) -> bool:
        """Never."""
        return False

    def apply(self, times, readings, channels, active, rng):
        """The readings rounded to steps of 819 counts."""
        return np.rint(readings / 819) * 819
