"""Features of frontiers: finite, the same in mirrored and turned maps, remembered."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, UNKNOWN_BIT, draw_bit_map
from layoutexplore.predictors.frontier_model.feature_cache import (
    Clusters,
    FeatureCache,
    Lengths,
    compute_local_features,
)
from layoutexplore.predictors.frontier_model.feature_kernels import TOUCHED, FloodScratch, flood_unknown
from layoutexplore.predictors.frontier_model.features import (
    FEATURES,
    frontier_features,
    home_regions,
    look_around,
)
from tests.predictors.cases import grids, nothing_seen


@settings(max_examples=50, deadline=None)
@given(
    cells=hnp.arrays(
        np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 100])
    )
)
def test_every_free_cell_has_a_region_and_features_are_finite(cells: NDArray[np.int8]) -> None:
    regions = doorway_regions(cells, 0.2)
    assert ((regions.labels > 0) == (cells == 0)).all()
    clusters = find_frontiers(cells)
    if len(clusters):
        features = frontier_features(look_around(cells, clusters, regions, 0.2), np.zeros(len(clusters)))
        assert features.shape == (len(clusters), len(FEATURES)) and np.isfinite(features).all()


def test_mirrored_and_turned_frontiers_look_the_same() -> None:
    cells = np.full((60, 60), -1, np.int8)
    cells[10:40, 10:40] = 100
    cells[12:38, 12:38] = 0
    cells[20:29, 38:40] = 0
    cells[15:20, 40] = -1
    expected = None
    for turns in range(4):
        for mirrored in (False, True):
            seen = np.ascontiguousarray(np.rot90(cells[:, ::-1] if mirrored else cells, turns))
            first, regions = (
                FrontierClusters.of([find_frontiers(seen).cluster(0)]),
                doorway_regions(seen, 0.1),
            )
            features = frontier_features(look_around(seen, first, regions, 0.1), np.zeros(1))
            names = [
                k
                for k, name in enumerate(FEATURES)
                if name.startswith(("open_", "doors_", "size", "width", "region"))
            ]
            expected = features[:, names] if expected is None else expected
            np.testing.assert_allclose(features[:, names], expected, rtol=1e-5)


def features_of(
    cells: NDArray[np.int8], clusters: FrontierClusters, resolution: float, memory: FeatureCache | None = None
) -> NDArray[np.float32]:
    """The features of frontiers with nothing in sight."""
    around = look_around(cells, clusters, doorway_regions(cells, resolution), resolution, memory)
    return frontier_features(around, np.zeros(len(clusters)))


@settings(max_examples=40, deadline=None)
@given(cells=grids, where=st.tuples(st.integers(0, 3), st.integers(0, 3)))
def test_a_larger_grid_tells_nothing_more(cells: NDArray[np.int8], where: tuple[int, int]) -> None:
    clusters = find_frontiers(cells)
    if not len(clusters):
        return
    larger = np.full((cells.shape[0] + 5, cells.shape[1] + 7), -1, np.int8)
    larger[where[0] : where[0] + cells.shape[0], where[1] : where[1] + cells.shape[1]] = cells
    moved = FrontierClusters(clusters.cells + np.array(where, np.int32), clusters.offsets)
    np.testing.assert_array_equal(features_of(larger, moved, 0.2), features_of(cells, clusters, 0.2))


@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_a_memory_changes_nothing(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    cells = rng.choice(np.array([-1, 0, 0, 100], np.int8), (30, 150))
    memory = FeatureCache()
    for _ in range(4):
        clusters = find_frontiers(cells)
        np.testing.assert_array_equal(
            features_of(cells, clusters, 0.4, memory), features_of(cells, clusters, 0.4)
        )
        r, c = rng.integers(0, 26), rng.integers(0, 146)
        cells[r : r + 4, c : c + 4] = rng.choice(np.array([-1, 0, 100], np.int8), (4, 4))


@settings(max_examples=60, deadline=None)
@given(cells=grids, seed=st.integers(0, 1000))
def test_floods_that_meet_no_barrier_are_shared(cells: NDArray[np.int8], seed: int) -> None:
    """Probing all barriers at once writes what floods with each of them write, with few doors or none."""
    clusters = find_frontiers(cells)
    if not len(clusters):
        return
    rng = np.random.default_rng(seed)
    bit_map = draw_bit_map(cells, nothing_seen(cells.shape), 0.2, 3.0)
    bit_map.code[rng.random(bit_map.code.shape) < rng.choice([0.0, 0.01, 0.3])] |= DOOR_BIT
    members = clusters.cluster(0) + np.int32(bit_map.margin)
    depths, barriers = (
        np.array([1, 2, 4], np.int64),
        np.array([0, ALONG_ROWS | ALONG_COLS, DOOR_BIT], np.int64),
    )
    scratch = FloodScratch(*(np.zeros(bit_map.code.size, kind) for kind in (np.uint8, np.int32)))
    clusters_ = Clusters(members, np.array([0, len(members)], np.int64))
    found = np.zeros((1, len(FEATURES)), np.float32)
    _, touched = compute_local_features(
        bit_map.code, clusters_, np.zeros(1, np.int64), Lengths(8, 1, 3, 1, depths), barriers, scratch, found
    )
    first = FEATURES.index("open_area_0.3")
    for b, barrier in enumerate(barriers):
        out, cells_touched = np.zeros(8, np.float32), np.zeros(TOUCHED, np.int32)
        met = flood_unknown(bit_map.code, barrier, members, depths, scratch, out, cells_touched)
        assert not scratch.taken.any()
        np.testing.assert_array_equal(found[0, first + 8 * b : first + 8 * (b + 1)], out)
        np.testing.assert_array_equal(touched[0, b], cells_touched)
        assert met & UNKNOWN_BIT or not out.any()


def test_the_home_of_a_frontier() -> None:
    labels = np.array([[1, 1, 2, 2, 3]], np.int32)
    regions = Regions(labels, 3, np.zeros(labels.shape, np.uint8), 0.1)
    clusters = FrontierClusters.of(
        [np.array([[0, k] for k in part], np.int32) for part in ((0, 2, 3), (1, 2), (4,))]
    )
    assert home_regions(regions, clusters).tolist() == [2, 1, 3]
