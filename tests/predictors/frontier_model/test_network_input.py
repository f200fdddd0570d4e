"""The network's input around a frontier, against a slow version."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, FREE_BIT, UNKNOWN_BIT, WALL_BIT
from layoutexplore.predictors.frontier_model.features import Surroundings, look_around
from layoutexplore.predictors.frontier_model.network_input import (
    BEHIND,
    CROP_CELL,
    DOORWAY,
    KNOWN,
    OTHER_ROOM,
    PLANES,
    ROOM_BEHIND,
    SIDE,
    SOLID,
    draw_crops,
    draw_truth,
)

GRIDS = hnp.arrays(
    np.int8,
    st.tuples(st.integers(6, 40), st.integers(6, 40)),
    elements=st.sampled_from([-1, -1, 0, 0, 0, 100]),
)


def around_of(cells: NDArray[np.int8], clusters: FrontierClusters, resolution: float = 0.1) -> Surroundings:
    return look_around(cells, clusters, doorway_regions(cells, resolution), resolution)


def slow_window(around: Surroundings, k: int) -> NDArray[np.float64]:
    """Shares 0..1 of the window of a frontier, cell by cell."""
    bit_map, labels, resolution = (
        around.bit_map,
        np.pad(around.regions.labels, around.bit_map.margin),
        around.resolution,
    )
    row, col, *axes = around.frames[k, :6].tolist()
    forward, sideways = axes[:2], axes[2:]
    across, along = (ALONG_COLS, ALONG_ROWS) if forward[0] == 0 else (ALONG_ROWS, ALONG_COLS)
    bits = (FREE_BIT, WALL_BIT, UNKNOWN_BIT, DOOR_BIT, across, along)
    codes, labels = bit_map.code.tolist(), labels.tolist()
    members = {tuple(cell) for cell in (around.frontiers.cells + bit_map.margin).tolist()}
    mine = {tuple(cell) for cell in (around.frontiers.cluster(k) + bit_map.margin).tolist()}
    home = int(around.homes[k])
    sums, cells = np.zeros((SIDE, SIDE, PLANES)), np.zeros((SIDE, SIDE, 1))
    reach = int(SIDE * CROP_CELL / resolution)
    for i in range(-reach, reach):
        for j in range(-reach, reach):
            a = math.floor(i * resolution / CROP_CELL + 0.5 + 1e-9) + BEHIND
            s = math.floor(j * resolution / CROP_CELL + 0.5 + 1e-9) + SIDE // 2
            if not (0 <= a < SIDE and 0 <= s < SIDE):
                continue
            r = int(row + i * forward[0] + j * sideways[0])
            c = int(col + i * forward[1] + j * sideways[1])
            inside = 0 <= r < bit_map.code.shape[0] and 0 <= c < bit_map.code.shape[1]
            code, label = (codes[r][c], labels[r][c]) if inside else (UNKNOWN_BIT, 0)
            regions = [label > 0 and label == home, label > 0 and label != home]
            sums[a, s, :8] += [*(code & bit > 0 for bit in bits), *regions]
            sums[a, s, 8] = max(sums[a, s, 8], (r, c) in mine)
            sums[a, s, 9] = max(sums[a, s, 9], (r, c) in members)
            cells[a, s] += 1
    sums[..., :8] /= cells
    return sums


@settings(max_examples=12, deadline=None)
@given(cells=GRIDS, resolution=st.sampled_from([0.05, 0.1, 0.15, 0.3]))
def test_windows_against_slow_ones(cells: NDArray[np.int8], resolution: float) -> None:
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    around = around_of(cells, clusters, resolution)
    windows, last = draw_crops(around), len(clusters) - 1
    np.testing.assert_allclose(windows[last] / 255, slow_window(around, last), atol=0.51 / 255)
    np.testing.assert_array_equal(draw_crops(around, np.array([last, 0])), windows[[last, 0]])


@settings(max_examples=5, deadline=None)
@given(cells=GRIDS)
def test_squares_finer_and_coarser_than_cells(cells: NDArray[np.int8]) -> None:
    """A square of half a cell shows the cell; one of 37 x 37 cells, by some of them."""
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    coarse = draw_crops(around_of(cells, clusters, 0.6))
    assert set(np.unique(coarse[..., :3]).tolist()) <= {0, 255}
    assert (coarse[..., :3].astype(int).sum(axis=3) == 255).all(), "free, occupied or unknown"
    fine = draw_crops(around_of(cells, clusters, 0.008))
    assert (np.abs(fine[..., :3].astype(int).sum(axis=3) - 255) <= 1).all()


@settings(max_examples=30, deadline=None)
@given(cells=GRIDS, where=st.tuples(st.integers(0, 3), st.integers(0, 3)))
def test_windows_do_not_tell_where_the_grid_ends(cells: NDArray[np.int8], where: tuple[int, int]) -> None:
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    larger = np.full((cells.shape[0] + 5, cells.shape[1] + 7), -1, np.int8)
    larger[where[0] : where[0] + cells.shape[0], where[1] : where[1] + cells.shape[1]] = cells
    moved = FrontierClusters(clusters.cells + np.array(where, np.int32), clusters.offsets)
    np.testing.assert_array_equal(
        draw_crops(around_of(larger, moved)), draw_crops(around_of(cells, clusters))
    )


def test_mirrored_and_turned_frontiers_have_one_window() -> None:
    cells = np.full((61, 61), -1, np.int8)
    cells[10:40, 10:40] = 100
    cells[12:38, 12:38] = 0
    cells[20:29, 38:40] = 0
    cells[15:20, 40] = -1
    windows = []
    for turns in range(4):
        for mirrored in (False, True):
            seen = np.ascontiguousarray(np.rot90(cells[:, ::-1] if mirrored else cells, turns))
            windows.append(
                draw_crops(around_of(seen, FrontierClusters.of([find_frontiers(seen).cluster(0)])))[0]
            )
    for window in windows:
        # The middle of the frontier has one more square to one side than to the other.
        assert any(np.array_equal(window[:, 1:], way) for way in (windows[0][:, 1:], windows[0][:, :0:-1]))
    assert windows[0][: BEHIND - 2, ..., 0].sum() > windows[0][BEHIND + 2 :, ..., 0].sum() == 0, (
        "ahead nothing is known"
    )


@settings(max_examples=25, deadline=None)
@given(cells=GRIDS, rooms=st.integers(1, 3), seed=st.integers(0, 99))
def test_truth_of_squares(cells: NDArray[np.int8], rooms: int, seed: int) -> None:
    """With squares of three cells, each is what the cell in its middle is."""
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    rng = np.random.default_rng(seed)
    around, free = around_of(cells, clusters), rng.random(cells.shape) < 0.7
    room_ids = rng.integers(0, rooms + 1, cells.shape, np.int32)
    behind = rng.integers(0, rooms + 1, len(clusters), np.int32)
    drawn = draw_truth(around, behind, room_ids, free)
    for k in range(len(clusters)):
        row, col, *axes = (
            (around.frames[k, :6] - ([around.bit_map.margin] * 2 + [0] * 4)).astype(int).tolist()
        )
        for a in range(SIDE):
            for s in range(SIDE):
                i, j = 3 * (a - BEHIND), 3 * (s - SIDE // 2)
                r, c = row + i * axes[0] + j * axes[2], col + i * axes[1] + j * axes[3]
                if not (0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]):
                    expected = SOLID
                elif cells[r, c] >= 0:
                    expected = KNOWN
                elif not free[r, c]:
                    expected = SOLID
                elif room_ids[r, c] == 0:
                    expected = DOORWAY
                else:
                    expected = ROOM_BEHIND if room_ids[r, c] == behind[k] else OTHER_ROOM
                assert drawn[k, a, s] == expected, (k, a, s)
