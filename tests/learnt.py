"""Features of fixed maps beside what they were when the models that ship learnt from them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.maps.library import load_plan

RESOLUTION = 0.1


def partly_seen(name: str, left_out: int) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
    """What may be known of a floor, and its rooms: discs around places on a grid, some of them left out."""
    raster = load_plan(name).rasterize(RESOLUTION)
    row, col = np.indices(raster.shape)
    near = (row % 60 - 30) ** 2 + (col % 60 - 30) ** 2 < 38**2
    known = near & ((row // 60 + 2 * (col // 60)) % left_out > 0)
    return np.where(known, raster.grid.cells, UNKNOWN).astype(np.int8), raster.room_ids.astype(np.int32)


def check_features(path: Path, of: str, names: Sequence[str], found: NDArray[np.floating]) -> None:
    """Compare features (n, names) with a table: of each its name, what it is of, its mean and its spread.

    Where models have been trained anew, the lines that it fails with belong into the table.
    """
    with path.open(newline="") as file:
        expected = {row["feature"]: row for row in csv.DictReader(file) if row["of"] == of}
    assert tuple(names) == tuple(expected), f"the features of {path} are others"
    other = []
    for name, mean, spread in zip(names, found.mean(axis=0), found.std(axis=0), strict=True):
        learnt = pytest.approx(
            [float(expected[name][what]) for what in ("mean", "spread")], rel=1e-3, abs=1e-3
        )
        if [mean, spread] != learnt:
            other.append(f"{of},{name},{mean:.6g},{spread:.6g}")
    assert not other, "\n".join(other)
