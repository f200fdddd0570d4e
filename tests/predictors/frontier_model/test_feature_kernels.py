"""What is looked for around a frontier, against slow versions."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import find_frontiers
from layoutexplore.predictors.bit_map import (
    ALONG_COLS,
    ALONG_ROWS,
    DOOR_BIT,
    FREE_BIT,
    UNKNOWN_BIT,
    WALL_BIT,
    draw_bit_map,
)
from layoutexplore.predictors.frontier_model.feature_kernels import (
    AHEAD,
    ASIDE,
    BACK,
    BESIDE,
    FORTH,
    TOUCHED,
    FloodScratch,
    doors_near,
    flood_unknown,
    walls_in_line,
)
from tests.predictors.cases import grids, nothing_seen


@settings(max_examples=40, deadline=None)
@given(cells=grids)
def test_a_flood_against_a_slow_one(cells: NDArray[np.int8]) -> None:
    clusters = find_frontiers(cells)
    if not len(clusters):
        return
    bit_map = draw_bit_map(cells, nothing_seen(cells.shape), 0.2, 1.4)
    members = clusters.cluster(0) + np.int32(bit_map.margin)
    depths = np.array([1, 3, 5], np.int64)
    out, touched = np.zeros(8, np.float32), np.zeros(TOUCHED, np.int32)
    scratch = FloodScratch(*(np.zeros(bit_map.code.size, kind) for kind in (np.uint8, np.int32)))
    flood_unknown(bit_map.code, ALONG_ROWS, members, depths, scratch, out, touched)
    open_cells = (bit_map.code & UNKNOWN_BIT > 0) & (bit_map.code & ALONG_ROWS == 0)
    reached = np.zeros(bit_map.code.shape, np.bool_)
    reached[members[:, 0], members[:, 1]] = True
    behind = 0
    for depth in range(1, 6):
        grown = np.pad(reached, 1)
        grown = grown[:-2, 1:-1] | grown[2:, 1:-1] | grown[1:-1, :-2] | grown[1:-1, 2:]
        reached |= grown & open_cells
        behind = int((reached & open_cells).sum())
        if depth in depths:
            assert out[depths.tolist().index(depth)] == behind
    assert (bit_map.code.ravel()[touched[touched >= 0]] & UNKNOWN_BIT == 0).all()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_doors_near_against_a_slow_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    reach = int(rng.integers(1, 7))
    code = rng.choice(np.array([FREE_BIT, WALL_BIT, UNKNOWN_BIT], np.uint8), (20, 21))
    code[rng.random(code.shape) < rng.choice([0.0, 0.02, 0.3])] |= DOOR_BIT
    members = rng.integers(reach, 20 - reach, (4, 2)).astype(np.int32)
    frame, out = np.concatenate([members[0], np.zeros(6)]), np.zeros(4, np.float32)
    doors_near(code, members, frame, reach, out)
    rows, cols = np.indices(code.shape)
    away = (rows - members[0, 0]) ** 2 + (cols - members[0, 1]) ** 2
    near = (code & DOOR_BIT > 0) & (away <= reach**2)
    inside = (code[members[:, 0], members[:, 1]] & DOOR_BIT > 0).mean()
    nearest = np.sqrt(away[near].min()) if near.any() else reach
    assert (
        out.tolist()
        == np.array([inside, nearest, *((near & (code & b > 0)).sum() for b in (1, 4))], np.float32).tolist()
    )


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000), turn=st.integers(0, 3), mirrored=st.booleans())
def test_walls_in_line_against_a_slow_version(seed: int, turn: int, mirrored: bool) -> None:
    rng = np.random.default_rng(seed)
    unit = int(rng.integers(1, 3))
    size = 20 * unit
    code = rng.choice(
        np.array([FREE_BIT, WALL_BIT, 4, 4 | ALONG_ROWS, 4 | ALONG_COLS], np.uint8),
        (2 * size + 1, 2 * size + 1),
    )
    forward = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)][turn])
    side = forward[::-1] * (-1 if mirrored else 1)
    out = np.zeros(2 * AHEAD + 2 * BESIDE, np.float32)
    walls_in_line(code, np.array([size, size, *forward, *side, 0, 0], np.float64), unit, out)

    def most(
        bits: int, across: range, along: range, ways: tuple[NDArray[np.int64], NDArray[np.int64]]
    ) -> int:
        places = size + np.array([[u * ways[0] + v * ways[1] for v in along] for u in across])
        return int((code[places[..., 0], places[..., 1]] & bits > 0).sum(axis=1).max())

    aside = range(-ASIDE * unit, ASIDE * unit + 1)
    extension = ALONG_ROWS if forward[0] else ALONG_COLS
    for k in range(AHEAD):
        slices = range(k * unit, (k + 1) * unit)
        assert out[k] == most(WALL_BIT, slices, aside, (forward, side))
        assert out[AHEAD + k] == most(extension, slices, aside, (forward, side))
    for k in range(2 * BESIDE):
        slices = range((k - BESIDE) * unit, (k - BESIDE + 1) * unit)
        assert out[2 * AHEAD + k] == most(
            WALL_BIT, slices, range(-BACK * unit, FORTH * unit), (side, forward)
        )
