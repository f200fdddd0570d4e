"""Features are those that the trees and networks that ship have learnt from."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import find_frontiers
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.maps.library import load_plan
from layoutexplore.predictors.cell_model import features as cells_of_rooms
from layoutexplore.predictors.frontier_model import features as frontiers

LEARNT_FROM = Path(__file__).with_name("learnt_features.csv")
"""Of each feature its name, what it is of, its mean and its standard deviation in the maps below."""

RESOLUTION = 0.1


def partial_maps() -> list[tuple[NDArray[np.int8], Regions]]:
    """What may be known of two floors: discs around places on a grid, some of which are left out."""
    found = []
    for name, left_out in (("office-01", 3), ("apartment-02", 2)):
        cells = load_plan(name).rasterize(RESOLUTION).grid.cells
        row, col = np.indices(cells.shape)
        near = (row % 60 - 30) ** 2 + (col % 60 - 30) ** 2 < 38**2
        known = near & ((row // 60 + 2 * (col // 60)) % left_out > 0)
        seen = np.where(known, cells, UNKNOWN).astype(np.int8)
        found.append((seen, doorway_regions(seen, RESOLUTION)))
    return found


def features_of(what: str) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Names of features, and those of all frontiers, or of all cells that a room may be completed with."""
    rows = []
    for cells, regions in partial_maps():
        if what == "frontier":
            clusters = find_frontiers(cells)
            around = frontiers.look_around(cells, clusters, regions, RESOLUTION)
            rows.append(frontiers.frontier_features(around, np.arange(len(clusters)) % 7.0))
        else:
            found = cells_of_rooms.find_candidates(cells, regions, RESOLUTION)
            inside = np.arange(len(found.cells)) % 5 / 4.0
            rows.append(cells_of_rooms.add_first_estimate(found, inside, RESOLUTION))
    names = frontiers.FEATURES if what == "frontier" else cells_of_rooms.FEATURES
    return names, np.concatenate(rows).astype(np.float64)


@pytest.mark.parametrize("what", ["frontier", "cell"])
def test_features_are_those_that_models_have_learnt_from(what: str) -> None:
    with LEARNT_FROM.open(newline="") as file:
        expected = {row["feature"]: row for row in csv.DictReader(file) if row["of"] == what}
    names, found = features_of(what)
    assert names == tuple(expected)
    for name, mean, spread in zip(names, found.mean(axis=0), found.std(axis=0), strict=True):
        assert mean == pytest.approx(float(expected[name]["mean"]), rel=1e-3, abs=1e-3), name
        assert spread == pytest.approx(float(expected[name]["spread"]), rel=1e-3, abs=1e-3), name
