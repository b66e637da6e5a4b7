"""The light-following experiments that several benches share (investigations B, C).

Settings that the dissertation lists are those of its tables 5.19 and 6.7; what it
leaves silent is that of the preset `khepera-light`. Runs that differ only from the
damage on share the trials before it, see `bench.learning.forking`.
"""

from collections.abc import Mapping
from dataclasses import replace

from bench.learning import experiments, forking
from bns import presets
from bns.experiment.config import AdaptationConfig, RunConfig, WorldConfig
from bns.experiment.config_watch import WatchConfig

ONSET = 20  # trial of the damage (dissertation, section 6.3.2)
AFTER = 20  # trials from the damage on
SOLVING = 15  # trials of the undamaged experiment
DAMAGES = {
    "slow-wheel": "wheel_gain:wheel=left,factor=0.5",  # the percentage is silent
    "noisy": "sensor_noise:factor=2",  # all sensors (6.3.1: the noise is doubled)
    "minimum": "sensor_stuck_min:sensor=left,blend=1",
    "maximum": "sensor_stuck_max:sensor=left,blend=1",
}
OTHERS = {  # the rest of 6.2.1; every fifth command or reading (silent)
    "both-slow": "wheel_gain:wheel=both,factor=0.5",
    "wheel-minimum": "wheel_stuck_min:wheel=left,blend=1",
    "wheel-maximum": "wheel_stuck_max:wheel=left,blend=1",
    "wheel-intermittent": "wheel_intermittent:wheel=left,every=5,speed=0.0555",
    "sensor-intermittent": "sensor_intermittent:sensor=left,every=5",
}
ALL = DAMAGES | OTHERS
UNHARMED = {"unharmed": "wheel_intermittent:wheel=left,every=1000"}
"""what would have been: no trial has that many commands"""
AFFECTED = {  # which of `bns.learners.bns.light.innovations.CHANNELS` a damage touches
    "slow-wheel": ("left wheel",),
    "noisy": ("left sensor", "right sensor"),
    "minimum": ("left sensor",),
    "maximum": ("left sensor",),
    "both-slow": ("left wheel", "right wheel"),
    "wheel-minimum": ("left wheel",),
    "wheel-maximum": ("left wheel",),
    "wheel-intermittent": ("left wheel",),
    "sensor-intermittent": ("left sensor",),
}


def undamaged(**light: object) -> RunConfig:
    """The preset (table 5.19), `SOLVING` trials.

    Args:
        light: settings of the section `light` that differ.
    """
    config = presets.load("khepera-light")
    config = replace(config, trials=SOLVING, light=replace(config.light, **light))
    words = [f"{key}={value}" for key, value in sorted(light.items())]
    return experiments.named(config, "-".join(["light", *words]))


def damaged(
    damage: str,
    *,
    light: Mapping[str, object] | None = None,
    watch: Mapping[str, object] | None = None,
    ensemble: bool = False,
    runs: int = experiments.REPLICATES,
    after: int = AFTER,
    **adaptation: object,
) -> RunConfig:
    """Table 6.7 over table 6.1, damaged from trial `ONSET` on.

    Args:
        damage: key of `ALL` or `UNHARMED`; empty = none.
        light: settings of the section `light` that differ.
        watch: settings of the section `watch`.
        ensemble: five networks with all outputs instead of one an output.
        runs: runs a side.
        after: trials from the damage on.
        adaptation: fields of `AdaptationConfig` that differ from table 6.7.
    """
    config = presets.load("khepera-light")
    light, watch = dict(light or {}), dict(watch or {})
    snn = replace(config.snn, kind="ensemble", hidden=15) if ensemble else config.snn
    settings = {"window": 600, "population_reset": True} | adaptation
    own = {"hidden": 5, "weights": 5.0, "mirror": False} | light
    texts = (f"{(ALL | UNHARMED)[damage]}@{ONSET}",) if damage else ()
    config = replace(
        config,
        trials=ONSET + after,
        snn=snn,
        light=replace(config.light, **own),
        watch=WatchConfig(**watch),
        evolution=replace(config.evolution, headless_chicken=0.05),
        adaptation=AdaptationConfig(**settings),
        world=WorldConfig(name="light", damage=texts),
    )
    differing = light | watch | adaptation
    words = [f"{key}={value}" for key, value in sorted(differing.items())]
    words += ["ensemble"] if ensemble else []
    config = experiments.named(config, "-".join(["light", damage or "whole", *words]))
    config = replace(config, replicates=runs)
    return replace(config, seed=forking.seed(config)) if damage else config


def recovering(damage: str, *, runs: int = experiments.REPLICATES) -> RunConfig:
    """The preset `khepera-light-recover` with another damage.

    Args:
        damage: key of `ALL`.
        runs: runs a side.
    """
    config = presets.load("khepera-light-recover")
    world = replace(config.world, damage=(f"{ALL[damage]}@{ONSET}",))
    config = replace(config, trials=ONSET + AFTER, world=world)
    config = experiments.named(config, f"light-recover-{damage}")
    config = replace(config, replicates=runs)
    return replace(config, seed=forking.seed(config))
