"""Network input of the cell model: all that is known of each lattice cell, as planes.

The network answers whether a lattice cell near a region belongs to the region's room. At most two regions
ask for one lattice cell, so that one pass over the map answers for all regions: the planes of a rank hold
what the trees know of the lattice cell and the region that is the first (or second) to reach it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats32, Ints, Ints32, Labels
from layoutexplore.layout.doorways import Regions
from layoutexplore.predictors.bit_map import (
    ALONG_COLS,
    ALONG_ROWS,
    DOOR_BIT,
    FREE_BIT,
    UNKNOWN_BIT,
    WALL_BIT,
    draw_bit_map,
)
from layoutexplore.predictors.cell_model.features import FEATURES, SIGHT, CandidateCells

_BITS = (FREE_BIT, WALL_BIT, UNKNOWN_BIT, DOOR_BIT, ALONG_ROWS, ALONG_COLS)

_SIDES = ("inward", "outward", "left", "right")
_RAYS = (*_SIDES, *(f"diagonal{k}" for k in range(4)))

_SCALES: dict[str, float] = {
    "way": 10.0, "crossed": 2.0, "outside_long": 6.0, "outside_short": 3.0,
    "box_long": 10.0, "box_short": 10.0, "area": 40.0, "fill": 1.0,
    **{f"{side}_{what}": scale for side in _SIDES for what, scale in (("crossed", 2.0), ("line", 8.0))},
    **{f"{ray}_distance": 8.0 for ray in _RAYS},
    "other_way": 10.0, "region_doors": 20.0,
    "typical_area": 40.0, "typical_long": 10.0, "typical_short": 6.0, "rooms": 10.0,
}  # fmt: skip
"""Features that planes hold as numbers, and what each is divided by."""

_MOST = 3.0
"""Numbers are clipped at this."""

_KINDS = (1, 2, 3)
"""What a ray meets (see `cell_features`), each shown by a plane of its own."""

_NUMBERED = np.array([FEATURES.index(name) for name in _SCALES])
_DIVISORS = np.array(list(_SCALES.values()), np.float32)
_KINDED = np.array([FEATURES.index(f"{ray}_kind") for ray in _RAYS])

SHOWN = len(_SCALES) + len(_KINDS) * len(_RAYS)
"""Planes that tell what is known of a lattice cell and one of its regions."""

PLANES = len(_BITS) + 2 * (SHOWN + 1 + 4)
"""All planes: shares of the bits of a `BitMap`; then those of either rank.

The planes of a rank are what is known, whether a region asks, and whether the lattice cells above, below, to
the left and to the right have the same region.
"""


_Number = TypeVar("_Number", np.uint8, np.int32)


@dataclass(frozen=True, eq=False)
class NetworkInput:
    """A decision in places.

    Attributes:
        bits: float16 (6, rows, cols), share of each lattice cell that has a bit of the bit map.
        labels: Of the type of those of `Regions` (rows, cols), the highest in each lattice cell, 0 for none.
        lattice_cells: int16 (n, 2), row and column of those that are asked for.
        region: Of the same type (n,), the region that asks.
        rank: int8 (n,), 0 for the first region of a lattice cell, 1 for the second.
        features: float16 (n, features), of `CandidateCells`.
    """

    bits: NDArray[np.float16]
    labels: Labels
    lattice_cells: NDArray[np.int16]
    region: Labels
    rank: Cells
    features: NDArray[np.float16]


def make_network_input(
    cells: Cells, regions: Regions, candidates: CandidateCells, resolution: float
) -> NetworkInput:
    """A decision in places.

    Args:
        cells: int8 (rows, cols), what is known.
        regions: The seen rooms of these cells.
        candidates: All lattice cells of these regions.
        resolution: Metres per cell.
    """
    bit_map, stride = draw_bit_map(cells, regions, resolution, SIGHT + resolution), candidates.stride
    inner = slice(bit_map.margin, -bit_map.margin)
    code = _by_lattice_cell(bit_map.code[inner, inner], stride)
    bits = np.stack([((code & bit) > 0).mean(axis=(1, 3), dtype=np.float32) for bit in _BITS])
    return NetworkInput(
        bits=bits.astype(np.float16),
        labels=_by_lattice_cell(regions.labels, stride).max(axis=(1, 3)),
        lattice_cells=(candidates.cells // stride).astype(np.int16),
        region=candidates.region.astype(regions.labels.dtype),
        rank=candidates.rank.astype(np.int8),
        features=candidates.features.astype(np.float16),
    )


def _by_lattice_cell(cells: NDArray[_Number], stride: int) -> NDArray[_Number]:
    """Cells (rows, stride, cols, stride) by lattice cell; those beyond the last row and column are 0."""
    rows, cols = (-(-size // stride) for size in cells.shape)
    whole = np.zeros((rows * stride, cols * stride), cells.dtype)
    whole[: cells.shape[0], : cells.shape[1]] = cells
    return whole.reshape(rows, stride, cols, stride)


def reoriented(scene: NetworkInput, orientation: int) -> NetworkInput:
    """The scene in one of the 8 orientations of a grid.

    Args:
        scene: A decision.
        orientation: 0..7; bit 0 reverses the rows, bit 1 the columns, bit 2 then swaps rows and columns.
    """
    bits, labels, places = scene.bits, scene.labels, scene.lattice_cells.copy()
    if orientation & 1:
        bits, labels, places[:, 0] = bits[:, ::-1], labels[::-1], labels.shape[0] - 1 - places[:, 0]
    if orientation & 2:
        bits, labels, places[:, 1] = bits[:, :, ::-1], labels[:, ::-1], labels.shape[1] - 1 - places[:, 1]
    if orientation & 4:
        swapped = [_BITS.index(ALONG_ROWS), _BITS.index(ALONG_COLS)]
        bits, labels, places = bits.transpose(0, 2, 1).copy(), labels.T, places[:, ::-1]
        bits[swapped] = bits[swapped[::-1]]
    return replace(scene, bits=bits, labels=labels, lattice_cells=places)


@dataclass(frozen=True, eq=False)
class Planes:
    """A crop of a scene as planes.

    Attributes:
        values: float32 (rows, cols, PLANES).
        row, col: First lattice cell of the crop.
        asked: int64 (m,), the entries of the scene that lie in it.
    """

    values: Floats32
    row: int
    col: int
    asked: Ints


def draw_planes(scene: NetworkInput, corner: tuple[int, int] | None = None, size: int = 0) -> Planes:
    """The crop of all lattice cells that are asked for, with a rim of one.

    Args:
        scene: A decision.
        corner: First lattice cell of another crop, of `size` lattice cells a side.
        size: See `corner`.
    """
    places = scene.lattice_cells.astype(np.int64)
    low = np.maximum(places.min(axis=0) - 1, 0)
    high = np.minimum(places.max(axis=0) + 2, scene.labels.shape)
    if corner is not None:
        low = np.array(corner)
        high = np.minimum(low + size, scene.labels.shape)
    asked = np.flatnonzero(((places >= low) & (places < high)).all(axis=1))
    (row, col), (rows, cols) = low.tolist(), (high - low).tolist()
    at = (scene.rank[asked], *(places[asked] - low).T)
    window = np.s_[row : row + rows, col : col + cols]
    values = np.zeros((rows, cols, PLANES), np.float32)
    values[..., : len(_BITS)] = scene.bits[:, *window].transpose(1, 2, 0)
    owner = np.zeros((2, rows, cols), np.int32)
    owner[at] = scene.region[asked]
    shown = _shown(scene.features[asked])
    for rank in range(2):
        mine, first = at[0] == rank, len(_BITS) + rank * (SHOWN + 5)
        here = at[1][mine], at[2][mine]
        values[*here, first : first + SHOWN] = shown[mine]
        values[*here, first + SHOWN] = 1.0
        known = np.where(owner[rank] == 0, scene.labels[window], owner[rank]) if rank == 0 else owner[rank]
        _mark_same(known, values[..., first + SHOWN + 1 : first + SHOWN + 5])
    return Planes(values, row, col, asked)


def _shown(features: NDArray[np.float16]) -> Floats32:
    """Features float32 (n, SHOWN) as they are shown."""
    numbers = np.clip(features[:, _NUMBERED].astype(np.float32) / _DIVISORS, 0.0, _MOST)
    kinds = features[:, _KINDED, None] == np.array(_KINDS, np.float16)
    return np.hstack([numbers, kinds.reshape(len(features), len(_KINDED) * len(_KINDS)).astype(np.float32)])


def _mark_same(owner: Ints32, planes: Floats32) -> None:
    """Mark where the lattice cell above, below, to the left or to the right has the same region."""
    rows = (owner[1:] == owner[:-1]) & (owner[1:] > 0)
    cols = (owner[:, 1:] == owner[:, :-1]) & (owner[:, 1:] > 0)
    planes[1:, :, 0], planes[:-1, :, 1] = rows, rows
    planes[:, 1:, 2], planes[:, :-1, 3] = cols, cols
