"""Arrays in .npz archives: a checksum in each, sizes known before anything is unpacked, nothing unpickled.

An archive that `write_arrays` wrote holds one array more, `checksum`: the version of the format, a digest of
the names, types, shapes and values of all others, and their names. Its comment tells that there must be one;
an archive without a comment was written by an earlier version, or by NumPy.
"""

from __future__ import annotations

import functools
import hashlib
import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ResultsError, checks_arguments, shortened
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.files.reading import MEGA, Kind, is_file, is_there, read_bytes, shown_path
from layoutexplore.files.writing import atomic

CHECKSUM, FORMAT, COMMENT = "checksum", 1, b"layoutexplore"
"""Name of the array with the digest, version of the format, comment of an archive that has one."""

_MOST_ARRAYS = 100_000
_LONGEST_HEADER = 10_000
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class ArrayRule:
    """What an array of an archive must be.

    Attributes:
        kinds: Letters of the kinds of its numbers, as NumPy names them: "b" flags, "i" and "u" whole numbers,
            "f" others, "U" texts.
        shape: Its shape: numbers, or names of sizes that must be the same throughout the archive.
        low: Least value.
        high: Greatest value.
        finite: Whether all values are finite; otherwise NaN and infinities are allowed beside the range.
        optional: Whether it may be missing.
    """

    kinds: str = "f"
    shape: tuple[int | str, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    finite: bool = True
    optional: bool = False

    def __str__(self) -> str:
        bounds = f" in {self.low:g}..{self.high:g}" if (self.low, self.high) != (-math.inf, math.inf) else ""
        kinds = {"b": "flags", "i": "whole numbers", "u": "whole numbers", "f": "numbers", "U": "texts"}
        names = " or ".join(dict.fromkeys(kinds[kind] for kind in self.kinds))
        finite = "finite " if self.finite and "f" in self.kinds else ""
        return f"{finite}{names}{bounds} of the shape ({', '.join(map(str, self.shape))})"

    def allows(self, values: NDArray[Any], sizes: dict[str, int]) -> bool:
        """Whether an array is such a one; sizes that it tells first are added to `sizes`."""
        if values.dtype.kind not in self.kinds or values.ndim != len(self.shape):
            return False
        for size, wanted in zip(values.shape, self.shape, strict=True):
            if size != (sizes.setdefault(wanted, size) if isinstance(wanted, str) else wanted):
                return False
        if values.dtype.kind not in "iuf" or not values.size:
            return True
        known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
        if self.finite and known.size < values.size:
            return False
        return not known.size or bool(self.low <= known.min() and known.max() <= self.high)


@checks_arguments
def write_arrays(path: Path, arrays: Mapping[str, ArrayLike]) -> None:
    """Write arrays by name into a compressed .npz archive, with a checksum."""
    plain = {name: np.asarray(values) for name, values in arrays.items()}
    plain[CHECKSUM] = np.array(checksum(plain))
    with atomic(path) as temporary, temporary.open("w+b") as file:
        np.savez_compressed(file, **plain)  # type: ignore[arg-type]
        with zipfile.ZipFile(file, "a") as archive:
            archive.comment = COMMENT


def checksum(arrays: Arrays) -> str:
    """The version of the format, a digest of arrays, whatever their order, and their names."""
    digest = hashlib.sha256()
    names = sorted(name for name in arrays if name != CHECKSUM)
    for name in names:
        values = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {values.dtype.str} {arrays[name].shape}\n".encode(errors="surrogatepass"))
        digest.update(values.tobytes())
    return " ".join([str(FORMAT), digest.hexdigest(), *names])


@checks_arguments
def read_arrays(
    path: Path,
    *names: str,
    rules: Mapping[str, ArrayRule] | None = None,
    beginnings: Sequence[str] = (),
    error: Kind = ResultsError,
) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz archive by name.

    Args:
        path: The archive.
        names: Those that must be there.
        rules: What arrays must be; others are returned as they are.
        beginnings: Only arrays whose names begin with one of these are read, and only their own checksums,
            those of the archive, are compared; all when none is named.
        error: What is raised.

    Raises:
        LayoutExploreError: Of the kind `error`: it is missing, cut off, damaged, of a later format, larger
            than the limits, or an array is missing or none of its rule.
    """
    if not is_there(path):
        raise error(f"{shown_path(path)} is missing: there is no such file")
    data = read_bytes(path, error, "archive")
    try:
        arrays = _unpack(data, tuple(beginnings), path, error)
    except error:
        raise
    except Exception as problem:  # whatever zipfile, zlib and NumPy say of it
        raise error(f"{path} is damaged: {shortened(str(problem))}") from problem
    needed = [name for name, rule in (rules or {}).items() if not rule.optional]
    needed = [name for name in needed if not beginnings or name.startswith(tuple(beginnings))]
    if lacking := [name for name in (*names, *needed) if name not in arrays]:
        raise error(f"{path} is damaged: the array {lacking[0]!r} is missing")
    check_arrays(arrays, rules or {}, str(path), error)
    return {name: arrays[name] for name in names} if names else arrays


def check_arrays(arrays: Arrays, rules: Mapping[str, ArrayRule], where: str, error: Kind) -> None:
    """Raise an error of that kind unless all arrays that have a rule keep to it.

    Args:
        arrays: By name.
        rules: What they must be.
        where: Their file, for the message.
        error: What is raised.
    """
    sizes: dict[str, int] = {}
    for name, rule in rules.items():
        if name in arrays and not rule.allows(arrays[name], sizes):
            found = f"{arrays[name].dtype} of the shape {arrays[name].shape}"
            raise error(f"{where} is damaged: the array {name} must hold {rule}, and is {found}")


def _check_sum(noted: str, arrays: Arrays, names: list[str], whole: bool) -> None:
    """Raise `ValueError` unless an archive holds the arrays that its checksum names, and no other values."""
    version, _, rest = noted.partition(" ")
    if version != str(FORMAT):
        raise ValueError(f"it has the format {shortened(version)}, and this version reads {FORMAT}")
    if rest.split(" ")[1:] != sorted(set(names) - {CHECKSUM}) or (whole and noted != checksum(arrays)):
        raise ValueError("its checksum does not fit")


def _unpack(data: bytes, beginnings: tuple[str, ...], path: Path, error: Kind) -> dict[str, NDArray[Any]]:
    """Arrays of an archive; sizes are compared with the limits before anything is unpacked."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        total = sum(member.file_size for member in members) / MEGA
        if total > limits().array_mb or len(members) > _MOST_ARRAYS:
            raise error(
                f"{path}: {len(members)} arrays of {total:.4g} MB, and the limit array_mb is "
                f"{limits().array_mb:g}: {raise_it('array_mb', total)}"
            )
        arrays = {}
        for member in members:
            if beginnings and not member.filename.startswith((*beginnings, CHECKSUM)):
                continue
            if member.compress_type not in _PACKED:
                raise ValueError(f"{member.filename!r} is packed in a way that NumPy does not write")
            arrays[member.filename.removesuffix(".npy")] = _array(archive.read(member))
        noted = arrays.pop(CHECKSUM, None)
        if noted is None and archive.comment:
            raise ValueError("its checksum is missing")
        if noted is not None:
            names = [member.filename.removesuffix(".npy") for member in members]
            _check_sum(str(noted), arrays, names, not beginnings)
        return arrays


def _array(data: bytes) -> NDArray[Any]:
    """An array from the content of a .npy file, whose size its header must tell."""
    length, begin = (data[8:10], 10) if data[6:8] == b"\1\0" else (data[8:12], 12)
    begin += int.from_bytes(length, "little")
    if begin > _LONGEST_HEADER:
        raise ValueError(f"an array with a header of {begin} bytes")
    shape, fortran, dtype = _header(data[:begin])
    if math.prod(shape) * dtype.itemsize != len(data) - begin or min(shape, default=0) < 0:
        raise ValueError(f"an array of {dtype} {shape} has another number of bytes")
    values = np.frombuffer(data, dtype, offset=begin)
    return values.reshape(shape, order="F" if fortran else "C").copy()


@functools.lru_cache(maxsize=1024)
def _header(data: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type that the header of a .npy file tells; archives of one kind share many."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        header = np.lib.format.read_array_header_1_0(file, max_header_size=_LONGEST_HEADER)
    elif version == (2, 0):
        header = np.lib.format.read_array_header_2_0(file, max_header_size=_LONGEST_HEADER)
    else:
        raise ValueError(f"an array of the version {version}")
    dtype = header[2]
    if dtype.hasobject or dtype.names or dtype.subdtype or dtype.kind not in "biufU":
        raise ValueError(f"an array of {dtype}: only flags, numbers and texts are read")
    return header


@checks_arguments
def is_whole(path: Path) -> bool:
    """Whether an archive is there and was written to its end: its table of contents comes last."""
    return is_file(path) and zipfile.is_zipfile(path)


@checks_arguments
def is_sound(path: Path, rules: Mapping[str, ArrayRule] | None = None) -> bool:
    """Whether `read_arrays` would read an archive: all of it is there, undamaged, and as the rules say."""
    try:
        read_arrays(path, rules=rules)
    except ResultsError:
        return False
    return True
