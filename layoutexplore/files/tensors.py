"""Weights in safetensors files: plain numbers, all finite, nothing unpickled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ResultsError, shortened
from layoutexplore.files.documents import parse_json
from layoutexplore.files.reading import Kind, read_bytes
from layoutexplore.files.schema import Record, TableOf, Text

MOST_TENSORS = 10_000
"""A checkpoint of the largest network has fewer."""

_LONGEST_HEADER = 1 << 22
_LONGEST_NAME = 200
_HEADER = Record({}, {"__metadata__": TableOf(Text(most=_LONGEST_HEADER))})


def read_tensors(
    path: Path,
    shapes: Mapping[str, tuple[int, ...]] | None = None,
    *,
    error: Kind = ResultsError,
    what: str = "file of weights",
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Tensors and metadata of a safetensors file.

    Args:
        path: The file.
        shapes: Tensors that it must hold, and their shapes; any when None.
        error: What is raised.
        what: What it is to be, for messages.

    Returns:
        Arrays by name, all of them finite, and the texts of the header.

    Raises:
        LayoutExploreError: Of the kind `error`: it cannot be read, is cut off or damaged, lacks a tensor, or
            a number is not finite.
    """
    import safetensors.numpy

    data = read_bytes(path, error, what)
    metadata = _metadata(data, path, error, what)
    try:
        tensors = safetensors.numpy.load(data)
    except Exception as problem:  # its own class, and that of NumPy for types that NumPy does not have
        raise error(f"{path} is damaged: {shortened(str(problem))}; copy or train it again") from problem
    for name, values in tensors.items():
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise error(f"{path}: {shortened(name)} is not finite throughout: train it again")
    check_shapes(tensors, shapes or {}, path, error)
    return tensors, metadata


def check_shapes(
    tensors: Mapping[str, NDArray[Any]], shapes: Mapping[str, tuple[int, ...]], path: Path, error: Kind
) -> None:
    """See whether tensors are there and have their shapes.

    Args:
        tensors: By name; others may be among them.
        shapes: What there must be.
        path: The file that they are from.
        error: Raised where one is missing or has another shape.

    Raises:
        LayoutExploreError: Of the kind `error`.
    """
    for name, shape in shapes.items():
        if name not in tensors or tensors[name].shape != shape:
            found = "is missing" if name not in tensors else f"has the shape {tensors[name].shape}"
            raise error(f"{path}: {name} {found}, expected {shape}: train it again with this version")


def read_metadata(path: Path, *, what: str = "file of weights") -> dict[str, str]:
    """The texts in the header of a safetensors file that is whole; see `read_tensors`."""
    return _metadata(read_bytes(path, ResultsError, what), path, ResultsError, what)


def _metadata(data: bytes, path: Path, error: Kind, what: str) -> dict[str, str]:
    size = int.from_bytes(data[:8], "little")
    if len(data) < 8 or not 0 < size <= min(_LONGEST_HEADER, len(data) - 8):
        raise error(f"{path} is not a {what}: it does not begin like a safetensors file, or is cut off")
    text = data[8 : 8 + size].decode("utf-8", errors="replace")
    count = text.count('"data_offsets"')  # of every tensor; a header that is too large is not even parsed
    header = parse_json(text, f"{path}: the header", _HEADER, error=error) if count <= MOST_TENSORS else {}
    if (count := max(count, len(header))) > MOST_TENSORS:
        raise error(f"{path} is not a {what}: it has {count} tensors, and {MOST_TENSORS} is the most")
    for name in (*header, *header.get("__metadata__", {})):
        if len(name) > _LONGEST_NAME:
            raise error(
                f"{path} is not a {what}: the name {shortened(name)} has {len(name)} characters, and "
                f"{_LONGEST_NAME} is the most"
            )
    metadata: dict[str, str] = header.get("__metadata__", {})
    return metadata
