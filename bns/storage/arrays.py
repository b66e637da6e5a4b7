"""Named arrays in an NPZ file: no pickle, nothing unpacked that was not asked for."""

import io
import lzma
import math
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.storage import files, reading

KINDS = "biufUS"  # of NumPy's types: truth values, numbers, text
DAMAGE = (
    *reading.UNREADABLE,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    tokenize.TokenError,
)
"""what archives and the arrays in them raise where they are damaged"""


def write_npz(
    path: Path, arrays: Mapping[str, np.ndarray], *, compressed: bool = False
) -> None:
    """Write arrays without pickle; the same arrays give the same bytes.

    Args:
        path: of the file, replaced whole.
        arrays: name -> array, of any shape.
        compressed: whether to deflate them.

    Raises:
        TypeError: an array holds Python objects.
        StorageError: no space, or no permission.
    """
    objects = [name for name, array in arrays.items() if np.asarray(array).dtype == "O"]
    if objects:
        raise TypeError(f"arrays of Python objects cannot be stored: {objects}")
    buffer = io.BytesIO()
    save: Any = np.savez_compressed if compressed else np.savez
    save(buffer, **arrays)
    files.write_bytes(path, buffer.getvalue())


def read_npz(path: Path | str, *, most: int = reading.DATA) -> dict[str, np.ndarray]:
    """Read arrays, never pickled ones; what they claim to hold is looked at first.

    Every member is read to its end, so that the archive's checksums are compared.

    Args:
        path: of the file.
        most: bytes that the arrays may have.

    Returns:
        name -> array, of the shape and type stored.

    Raises:
        FormatError: absent, torn, damaged, encrypted, too large, or not such a file.
    """
    with reading.regular(path, most=most) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                members = archive.infolist()
                _check(members, path, most)
                return {
                    member.filename.removesuffix(".npy"): _array(
                        archive.read(member), f"{member.filename} in {path}"
                    )
                    for member in members
                }
        except FormatError:
            raise
        except DAMAGE as error:
            raise FormatError(f"{path} cannot be read as NPZ: {error}.") from error


def _check(members: list[zipfile.ZipInfo], path: Path | str, most: int) -> None:
    """Stop at an archive that is none of arrays.

    Raises:
        FormatError: encrypted, packed in another way, a name twice, or too large.
    """
    names = [member.filename for member in members]
    for member in members:
        if not member.filename.endswith(".npy") or names.count(member.filename) > 1:
            raise FormatError(
                f"{path}: {member.filename!r} is no array, or is there twice."
            )
        packed = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        if member.flag_bits & 1 or member.compress_type not in packed:
            raise FormatError(
                f"{path}: {member.filename!r} is encrypted or packed in a way that is "
                "not read: write it with numpy.savez."
            )
    claimed = sum(member.file_size for member in members)
    if claimed > most:
        raise FormatError(
            f"{path} claims {reading.size(claimed)}, {reading.size(most)} is the most "
            "that is unpacked."
        )


def _array(data: bytes, name: str) -> np.ndarray:
    """The array in the bytes of a member.

    Raises:
        FormatError: of another kind, or of another size than its head says.
        ValueError: not in NumPy's format.
    """
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read is None:
        raise FormatError(f"{name} is of version {version}; 1.0 and 2.0 are read.")
    shape, fortran, dtype = read(file)
    count = math.prod(shape)
    fits = file.tell() + count * dtype.itemsize == len(data)
    if dtype.kind not in KINDS or not fits or any(side < 0 for side in shape):
        raise FormatError(
            f"{name} says it holds {dtype} of shape {shape}, which its "
            f"{reading.size(len(data))} are not."
        )
    flat = np.frombuffer(data, dtype, count, file.tell())
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="K")


def alike(
    found: Mapping[str, np.ndarray], wanted: Mapping[str, np.ndarray], name: object
) -> None:
    """Stop at arrays that are not as those of a fresh learner.

    Names, types and shapes have to be the same, but for axes that are empty in a fresh
    one, which grow, and for text; numbers that are finite there have to be finite.

    Args:
        found: as read.
        wanted: those of a fresh learner.
        name: of the file, for messages.

    Raises:
        FormatError: the first that differs.
    """
    for key in sorted({*found} ^ {*wanted}):
        state = "lacks" if key in wanted else "should not hold"
        raise FormatError(f"{name} {state} {key!r}.")
    for key, array in found.items():
        like = wanted[key]
        text = array.dtype == np.uint8 and array.ndim == 1
        fits = array.ndim == like.ndim and (
            text
            or all(b in (a, 0) for a, b in zip(array.shape, like.shape, strict=True))
        )
        if array.dtype != like.dtype or not fits:
            raise FormatError(
                f"{name}: {key} is {array.dtype} of shape {array.shape}, it has to be "
                f"{like.dtype} of shape {like.shape} (0 grows)."
            )
        if array.dtype.kind != "f" or not (like.size and np.isfinite(like).all()):
            continue
        if not np.isfinite(array).all():
            raise FormatError(f"{name}: {key} holds NaN or infinity.")
