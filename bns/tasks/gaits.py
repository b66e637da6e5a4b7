"""Gaits that repeat themselves: six legs, 36 numbers (Cully et al. 2015).

Each leg's coxa and femur follow a square wave of their own amplitude, phase and duty
cycle, smoothed over a tenth of its period; the tibia does the opposite of the femur, so
that the foot stays below the knee. A controller samples it at its commands, `PERIOD` of
them a period.
"""

import numpy as np

SIZE = 36
PERIOD = 4
"""commands of a period; assumed"""
REACH = 0.6
"""[rad] largest amplitude; assumed, as far as BNS lets its goals go"""
SMOOTHED = 0.1
"""share of a period over which the wave changes sides (Cully et al. 2015)"""
_POINTS = 20


def goals(genes: np.ndarray, commands: int, reach: float = REACH) -> np.ndarray:
    """Servo goals of gaits.

    Args:
        genes: each from 0 to 1, ``(N, 36)``: leg by leg amplitude, phase and duty cycle
            of the coxa, then of the femur.
        commands: K.
        reach: amplitude of 1 [rad].

    Returns:
        ``(N, K, 18)`` [rad] from half-way, leg by leg coxa, femur, tibia.
    """
    amplitude, phase, duty = np.moveaxis(genes.reshape(-1, 1, 6, 2, 3), -1, 0)
    times = np.arange(commands)[None, :, None, None] / PERIOD + phase
    around = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    wave = np.zeros(np.broadcast_shapes(times.shape, duty.shape))
    for offset in SMOOTHED * around:
        wave += np.where((times + offset) % 1.0 < duty, 1.0, -1.0) / _POINTS
    angles = reach * amplitude * wave
    coxa, femur = angles[..., 0], angles[..., 1]
    found: np.ndarray = np.stack([coxa, femur, -femur], axis=-1)
    return found.reshape(len(genes), commands, 18)


def down(goals: np.ndarray, lifting: np.ndarray) -> np.ndarray:
    """Share of commands in which each leg is not told to be up.

    Args:
        goals: ``(N, K, C)`` [rad] from half-way.
        lifting: the channel of each leg that lifts it, ``(L,)``.

    Returns:
        ``(N, L)``, from 0 to 1: what duty factors a gait asks for.
    """
    found: np.ndarray = (goals[:, :, lifting] <= 0.0).mean(1)
    return found
