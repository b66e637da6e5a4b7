"""Numbers as files may give them: finite, of a size that something real can have."""

from typing import Annotated

import msgspec

BEYOND = 1e9

Finite = Annotated[float, msgspec.Meta(ge=-BEYOND, le=BEYOND)]
"""any number; NaN and infinity are none"""

Positive = Annotated[float, msgspec.Meta(ge=1 / BEYOND, le=BEYOND)]
Least = Annotated[float, msgspec.Meta(ge=0, le=BEYOND)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
