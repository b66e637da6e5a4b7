"""PACE: a dictionary of tensors saved by PyTorch (`.pt`).

`time` [s] ``(T,)``, `dof_pos` and `des_dof_pos` [rad] ``(T, J)``, sometimes `dof_vel`.
The order of the joints is that of the experiment's configuration, which is not in the
file. It is loaded with `weights_only`: tensors and plain containers, no code.

Format: https://github.com/leggedrobotics/pace-sim2real
"""

import zipfile
from pathlib import Path
from pickle import UnpicklingError  # torch raises it; nothing is unpickled here
from typing import Any, BinaryIO

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.storage import arrays, reading

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
    """The entries of a file as arrays of doubles.

    Raises:
        FormatError: more than tensors in it, too large, or an entry missing.
    """
    import torch

    try:
        with reading.regular(path) as file:
            _check(file, path)
            content = torch.load(file, map_location="cpu", weights_only=True)
        if not isinstance(content, dict):
            raise FormatError(f"{path} holds no dictionary of tensors.")
        found = {
            name: _array(content[name], f"{name} in {path}")
            for name in ("time", *ENTRIES)
            if name in content
        }
    except FormatError:
        raise
    except UnpicklingError:
        raise FormatError(
            f"{path} cannot be read as a PACE file: it holds more than tensors; save a "
            f"dictionary of the tensors {', '.join(NEEDED)}."
        ) from None
    except zipfile.BadZipFile:
        raise FormatError(
            f"{path} cannot be read as a PACE file: it is none that torch.save wrote, "
            "or a part of one."
        ) from None
    except arrays.DAMAGE as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise FormatError(f"{path} cannot be read as a PACE file: {first}") from None
    for name in NEEDED:
        if name not in found:
            raise FormatError(
                f"{path} has no entry {name!r}; a PACE file has {', '.join(NEEDED)}."
            )
    return found


def _check(file: BinaryIO, path: Path) -> None:
    """Stop at an archive that claims too much, before anything is unpacked.

    Every member is read to its end, so that the archive's checksums are compared.

    Raises:
        FormatError: it does, or is packed or encrypted, or a member is damaged.
        zipfile.BadZipFile, ...: it is no archive.
    """
    with zipfile.ZipFile(file) as archive:
        for member in archive.infolist():
            if member.flag_bits & 1 or member.compress_type != zipfile.ZIP_STORED:
                raise FormatError(
                    f"{path}: {member.filename!r} is packed or encrypted; torch.save "
                    "does not do that."
                )
        broken = archive.testzip()
    if broken:
        raise FormatError(f"{path}: {broken!r} is damaged.")
    file.seek(0)


def _array(value: Any, name: str) -> np.ndarray:
    """A tensor of real numbers as doubles.

    Raises:
        FormatError: it is none, or larger than can be read.
    """
    import torch

    plain = isinstance(value, torch.Tensor) and value.layout == torch.strided
    if not plain or value.is_complex() or value.is_quantized:
        raise FormatError(f"{name} is no tensor of real numbers.")
    if value.numel() * 8 > reading.DATA:
        raise FormatError(
            f"{name} has the shape {tuple(value.shape)}; "
            f"{reading.size(reading.DATA)} is the most that is read."
        )
    return value.detach().to(torch.float64).numpy()
