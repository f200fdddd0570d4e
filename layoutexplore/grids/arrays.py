"""Short names for the arrays of the package; docstrings say shapes and units."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, counted, shortened

C = TypeVar("C", bound=type)

Cells = NDArray[np.int8]
"""Cells of an occupancy grid: -1 unknown, 0 free ... 100 occupied; and other int8 arrays."""

Mask = NDArray[np.bool_]
"""Which cells, or which entries."""

ZERO: Any = np.int64(0)
"""0 in kernels that hand it on: a plain 0 is a type of its own, for which others would be compiled, too."""

Ints = NDArray[np.int64]
"""Indices and counts."""

Ints32 = NDArray[np.int32]
"""Labels of cells, and cells as (row, col)."""

Labels = NDArray[np.signedinteger[Any]]
"""Labels of the cells of a large grid: int16 where they fit, else int32."""

Floats = NDArray[np.float64]
"""Numbers with a unit."""

Floats32 = NDArray[np.float32]
"""Numbers with a unit, one a cell: distances, probabilities, scores."""

Bytes = NDArray[np.uint8]
"""Pictures, codes and flags."""

Words = NDArray[np.uint64]
"""Sets as bits, 64 a word."""


def check_alike(what: str, **arrays: NDArray[Any]) -> None:
    """Raise `ConfigError` unless arrays have one shape.

    Args:
        what: Whose arguments they are.
        arrays: By their names.

    Example:
        >>> check_alike("f1", found=np.zeros(2), truth=np.zeros(3))
        Traceback (most recent call last):
        ...
        layoutexplore.errors.ConfigError: f1: found (2,) and truth (3,) must have one shape
    """
    shapes = {name: array.shape for name, array in arrays.items()}
    if len(set(shapes.values())) > 1:
        told = " and ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ConfigError(f"{what}: {told} must have one shape")


def label_type(highest: int) -> type[np.signedinteger[Any]]:
    """The type of labels that are at most so far from 0: int16 where that holds them, else int32.

    Example:
        >>> label_type(40_000)
        <class 'numpy.int32'>
    """
    return np.int16 if highest <= np.iinfo(np.int16).max else np.int32


def small_labels(labels: NDArray[np.integer[Any]], highest: int) -> Labels:
    """Labels that are at most so far from 0, C-contiguous, as int16 where that holds them, else as int32.

    Handed back as they are where they are that already.

    Example:
        >>> small_labels(np.array([[1, 2]]), 2).dtype, small_labels(np.array([[1, 40_000]]), 40_000).dtype
        (dtype('int16'), dtype('int32'))
    """
    return np.ascontiguousarray(labels, label_type(highest))


def dense_ids(ids: NDArray[np.integer[Any]]) -> Ints:
    """Ids from 0 on as 0, 1, 2, ... in their order; 0 stays.

    Example:
        >>> dense_ids(np.array([0, 2**40, 7, 7])).tolist()
        [0, 2, 1, 1]
    """
    return np.searchsorted(np.unique(ids[ids > 0]), ids, side="right")


def stored_places(places: Floats) -> NDArray[np.floating[Any]]:
    """Places in metres as float32, or as they are where that would lose a millimetre, in a country's grid.

    Example:
        >>> stored_places(np.array([[3.0, 4.0]])).dtype, stored_places(np.array([[3.0, 5_654_000.0]])).dtype
        (dtype('float32'), dtype('float64'))
    """
    return places.astype(np.float32) if np.abs(places).max(initial=0.0) < 8192.0 else places


def shows_shapes(cls: C) -> C:
    """A dataclass whose `repr` says of arrays their kind and shape, and of collections their length.

    Example:
        >>> @shows_shapes
        ... @dataclasses.dataclass
        ... class Walls:
        ...     cells: Ints32
        ...     ends: list[tuple[float, float]]
        ...     name: str = "north"
        >>> Walls(cells=np.zeros((90, 2), np.int32), ends=[(0.5, 1.5)] * 12)
        Walls(cells=int32 (90, 2), ends=[12 tuples], name='north')
    """
    type.__setattr__(cls, "__repr__", _with_shapes)
    return cls


def _with_shapes(thing: Any) -> str:
    return _listed(thing, [field.name for field in dataclasses.fields(thing) if field.repr])


def _listed(thing: Any, names: Iterable[str]) -> str:
    values = ", ".join(f"{name}={_as_shape(getattr(thing, name))}" for name in names)
    return f"{type(thing).__name__}({values})"


def _as_shape(value: Any) -> str:
    """A value to six digits, or how large it is where that is shorter."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    if isinstance(value, (float, np.floating)):
        return repr(float(f"{value:.6g}"))
    if hasattr(value, "_fields"):
        return _listed(value, value._fields)
    if isinstance(value, str) or not isinstance(value, (Mapping, Sequence)):
        return shortened(value)
    parts = value.values() if isinstance(value, Mapping) else value
    if isinstance(value, (tuple, list)) and len(value) <= 4 and all(isinstance(p, float) for p in value):
        return f"({', '.join(map(_as_shape, value))})" if value else shortened(value)
    if isinstance(value, (tuple, list, dict)) and all(isinstance(p, (str, int)) for p in islice(parts, 8)):
        return shortened(value)
    return f"[{counted(len(value), type(next(iter(parts))).__name__)}]"
