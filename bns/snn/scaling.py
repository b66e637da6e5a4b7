"""Inputs and outputs of the motion SNN, scaled to about -1..1.

Inputs (thesis Fig 4.4): previous left and right wheel speed, new left and right wheel
speed [m/s], duration [s]; the previous speeds are 0 at the start. Outputs: forward,
left [m] and turn [rad] in the body frame at the command's start.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from bns.evolution.chromosome import Encoding

INPUTS = 5
OUTPUTS = 3
AXLE = 0.0884  # [m] Khepera III axle, only to scale the turn (not fitted)


@dataclass(frozen=True)
class Scaling:
    """Offsets and scales, from the encoding's bounds.

    Attributes:
        centre, half: of the inputs, ``(5,)`` [m/s x4, s].
        output: scale of the outputs, ``(3,)`` [m, m, rad].
    """

    centre: Tensor
    half: Tensor
    output: Tensor

    @classmethod
    def of(cls, encoding: Encoding) -> "Scaling":
        """Scaling for commands inside an encoding's bounds."""
        top = encoding.high[0].item()
        shortest, longest = encoding.low[2].item(), encoding.high[2].item()
        middle, width = (shortest + longest) / 2, (longest - shortest) / 2
        device = encoding.low.device
        return cls(
            centre=torch.tensor([0.0, 0.0, 0.0, 0.0, middle], device=device),
            half=torch.tensor([top, top, top, top, width], device=device),
            output=torch.tensor(
                [top * longest, top * longest, top * longest / AXLE], device=device
            ),
        )

    def inputs(self, decoded: Tensor) -> Tensor:
        """Network inputs of command lists.

        Args:
            decoded: commands after the dead band, ``(..., K, 3)``.

        Returns:
            ``(..., K, 5)``, scaled.
        """
        speeds = decoded[..., :2]
        before = torch.nn.functional.pad(speeds, (0, 0, 1, 0))[..., :-1, :]
        return (torch.cat([before, decoded], dim=-1) - self.centre) / self.half
