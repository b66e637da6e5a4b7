"""The light-following experiments that several benches share (investigations B, C).

Settings that the dissertation lists are those of its tables 5.19 and 6.7; what it
leaves silent is that of the preset `khepera-light`.
"""

from dataclasses import replace

from bench import experiments
from bns.config import AdaptationConfig, RunConfig, WorldConfig

ONSET = 20  # trial of the damage (dissertation, section 6.3.2)
AFTER = 20  # trials from the damage on
SOLVING = 15  # trials of the undamaged experiment
DAMAGES = {
    "slow-wheel": "wheel_gain:wheel=left,factor=0.5",  # the percentage is silent
    "noisy": "sensor_noise:factor=2",  # all sensors (6.3.1: the noise is doubled)
    "minimum": "sensor_stuck_min:sensor=left,blend=1",
    "maximum": "sensor_stuck_max:sensor=left,blend=1",
}


def undamaged(**light: object) -> RunConfig:
    """The preset (table 5.19), `SOLVING` trials.

    Args:
        light: settings of the section `light` that differ.
    """
    config = _preset()
    config = replace(config, trials=SOLVING, light=replace(config.light, **light))
    words = [f"{key}={value}" for key, value in sorted(light.items())]
    return experiments.named(config, "-".join(["light", *words]))


def damaged(damage: str, **adaptation: object) -> RunConfig:
    """Table 6.7 over table 6.1, one of `DAMAGES` from trial `ONSET` on.

    Args:
        damage: key of `DAMAGES`.
        adaptation: fields of `AdaptationConfig` that differ from table 6.7.
    """
    config = _preset()
    settings = {"window": 600, "population_reset": True} | adaptation
    config = replace(
        config,
        trials=ONSET + AFTER,
        light=replace(config.light, hidden=5, weights=5.0, mirror=False),
        evolution=replace(config.evolution, headless_chicken=0.05),
        adaptation=AdaptationConfig(**settings),
        world=WorldConfig(name="light", damage=(f"{DAMAGES[damage]}@{ONSET}",)),
    )
    words = [f"{key}={value}" for key, value in sorted(adaptation.items())]
    return experiments.named(config, "-".join(["light", damage, *words]))


def _preset() -> RunConfig:
    from bns import presets

    return presets.load("khepera-light")
