"""PACE: a dictionary of tensors saved by PyTorch (`.pt`).

`time` [s] ``(T,)``, `dof_pos` and `des_dof_pos` [rad] ``(T, J)``, sometimes `dof_vel`.
The order of the joints is that of the experiment's configuration, which is not in the
file. It is loaded with `weights_only`: tensors and plain containers, no code.

Format: https://github.com/leggedrobotics/pace-sim2real
"""

import pickle
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table

ENTRIES = {
    "des_dof_pos": (tables.TOLD, tables.POSITION),
    "dof_pos": (tables.SEEN, tables.POSITION),
    "dof_vel": (tables.SEEN, tables.SPEED),
}
NEEDED = ("time", "dof_pos", "des_dof_pos")


def read(path: Path) -> Table:
    """The table in a PACE file; its columns are named as `dof_pos[0]`.

    Raises:
        FormatError: no such file, more than tensors in it, or an entry missing.
    """
    content = _loaded(path)
    times = np.ravel(content["time"])
    columns = []
    for name, (role, quantity) in ENTRIES.items():
        if name not in content:
            continue
        values = content[name]
        if values.ndim != 2 or len(values) != len(times):
            raise FormatError(
                f"{path}: {name} has the shape {values.shape}; it needs a row for each "
                f"of the {len(times)} times and a column for each joint."
            )
        columns += [
            Column(f"{name}[{joint}]", values[:, joint], role, "", quantity)
            for joint in range(values.shape[1])
        ]
    return tables.stamped(times, columns, "PACE file", None)


def _loaded(path: Path) -> dict[str, np.ndarray]:
    import torch

    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        if not isinstance(content, dict):
            raise FormatError(f"{path} holds no dictionary of tensors.")
        found = {
            str(name): np.asarray(value, dtype=float)
            for name, value in content.items()
            if name in ENTRIES or name == "time"
        }
    except FormatError:
        raise
    except (
        OSError,
        EOFError,
        RuntimeError,
        pickle.UnpicklingError,
        KeyError,
        TypeError,
        ValueError,
    ) as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise FormatError(f"{path} cannot be read as a PACE file: {first}") from None
    for name in NEEDED:
        if name not in found:
            raise FormatError(
                f"{path} has no entry {name!r}; a PACE file has {', '.join(NEEDED)}."
            )
    return found
