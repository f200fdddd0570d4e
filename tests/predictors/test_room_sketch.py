"""Rooms sketched from the areas behind frontiers: against a slow version, and by what a sketch promises."""

from __future__ import annotations

import heapq

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Ints32
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors import make_predictor
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, draw_bit_map
from layoutexplore.predictors.frontier_model.features import Surroundings, home_regions
from layoutexplore.predictors.room_sketch import BOX_COST, WALL_COST, sketch_rooms

RESOLUTION = 0.2
STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))


def surroundings(seed: int) -> Surroundings:
    """Blocks of floor and walls in the unknown; every free cell beside the unknown is a frontier."""
    rng = np.random.default_rng(seed)
    blocks = rng.choice(np.array([-1, -1, 0, 0, 100], np.int8), rng.integers(2, 7, 2))
    cells = np.repeat(np.repeat(blocks, 4, axis=0), 4, axis=1)
    cells[rng.random(cells.shape) < 0.05] = 100
    beside = [
        (r, c)
        for r, c in np.argwhere(cells == 0).tolist()
        if any(unknown(cells, r + dr, c + dc) for dr, dc in STEPS)
    ]
    clusters = FrontierClusters.of([np.array([cell], np.int32) for cell in beside or [(0, 0)]])
    regions = doorway_regions(cells, RESOLUTION)
    count = len(clusters)
    return Surroundings(
        cells,
        clusters,
        regions,
        home_regions(regions, clusters),
        RESOLUTION,
        draw_bit_map(cells, regions, RESOLUTION, RESOLUTION),
        np.zeros((count, 0), np.float32),
        np.zeros((count, 8)),
        np.zeros((count, 0, 0), np.int32),
    )


def unknown(cells: np.ndarray, r: int, c: int) -> bool:
    return bool(0 <= r < cells.shape[0] and 0 <= c < cells.shape[1] and cells[r, c] == -1)


def slow_sketch(around: Surroundings, area: np.ndarray) -> Ints32:
    """The rules, one after the other, with a heap that keeps every request."""
    cells, rooms = around.cells, around.regions.labels.copy()
    code = around.bit_map.code[around.bit_map.margin :, around.bit_map.margin :]
    left: dict[int, int] = {}
    heap: list[tuple[int, int, int, int, int]] = []
    for k, room in enumerate(around.homes.tolist()):
        ((r, c),) = around.frontiers.cluster(k).tolist()
        if not room or code[r, c] & DOOR_BIT:
            continue
        left[room] = max(left.get(room, 0), int(np.rint(area[k] / RESOLUTION**2)))
        for dr, dc in STEPS:
            if unknown(cells, r + dr, c + dc):
                heapq.heappush(heap, (0, len(heap), r + dr, c + dc, room))
    serial = len(heap)
    while heap:
        cost, _, r, c, room = heapq.heappop(heap)
        if rooms[r, c] or not left[room]:
            continue
        rooms[r, c], left[room] = room, left[room] - 1
        _, row0, col0, row1, col1 = around.regions.boxes[room].tolist()
        for dr, dc in STEPS:
            row, col = r + dr, c + dc
            if not unknown(cells, row, col) or rooms[row, col]:
                continue
            lines = [bool(code[place] & (ALONG_ROWS | ALONG_COLS)) for place in ((row, col), (r, c))]
            outward = (row < row0 and dr < 0) or (row >= row1 and dr > 0)
            outward |= (col < col0 and dc < 0) or (col >= col1 and dc > 0)
            price = 1 + round(WALL_COST / RESOLUTION) * (lines[0] and not lines[1])
            price += round(BOX_COST / RESOLUTION) * outward
            heapq.heappush(heap, (cost + price, serial, row, col, room))
            serial += 1
    return rooms


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.0, 6.0, 1e6]))
def test_a_sketch_follows_its_rules(seed: int, most: float) -> None:
    around = surroundings(seed)
    area = np.random.default_rng(seed).uniform(0, most, len(around.frontiers))
    found = sketch_rooms(around, area)
    assert found.dtype == np.int32
    np.testing.assert_array_equal(found, slow_sketch(around, area))
    known = around.cells != -1
    np.testing.assert_array_equal(found[known], around.regions.labels[known])


def test_a_room_grows_by_what_is_predicted_behind_its_frontiers(decision: Decision) -> None:
    predictor = make_predictor("layout")
    assert predictor is not None
    judged = predictor.predict(decision)
    assert judged.rooms is not None
    sketch = judged.rooms.sketch
    cells = decision.grid.cells
    assert sketch.shape == cells.shape and not sketch[cells == 100].any()
    promised: dict[int, float] = {}
    for frontier in judged.frontiers:
        room = frontier.room or 0
        promised[room] = max(promised.get(room, 0.0), frontier.expected_area or 0.0)
    rooms, counts = np.unique(sketch[(sketch > 0) & (cells == -1)], return_counts=True)
    assert len(rooms)
    for room, count in zip(rooms.tolist(), counts.tolist(), strict=True):
        assert count * decision.grid.resolution**2 <= promised[room] + decision.grid.resolution**2


def test_predictors_that_have_rooms_at_once_sketch_nothing(decision: Decision) -> None:
    predictor = make_predictor("rectangle")
    assert predictor is not None
    rooms = predictor.predict(decision).rooms
    assert rooms is not None
    np.testing.assert_array_equal(rooms.sketch, rooms.labels)
