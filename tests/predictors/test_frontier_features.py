"""What is known, drawn as a chart, and what is probed in it: against slow versions, without the grid's border, remembered."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.layout.merging.door_gaps import free_runs, widens
from layoutexplore.predictors.bit_map import (
    ALONG_COLS,
    ALONG_ROWS,
    DOOR_BIT,
    FREE_BIT,
    UNKNOWN_BIT,
    WALL_BIT,
    draw_chart,
)
from layoutexplore.predictors.cell_model.features import FEATURES as CELL_FEATURES
from layoutexplore.predictors.cell_model.features import add_judgement, find_candidates
from layoutexplore.predictors.frontier_model.feature_kernels import (
    AHEAD,
    ASIDE,
    BACK,
    BESIDE,
    FORTH,
    TOUCHED,
    doors_near,
    flood_unknown,
    walls_in_line,
)
from layoutexplore.predictors.frontier_model.features import (
    BLOCK,
    FEATURES,
    ProbeMemory,
    _changed_blocks,
    _probe,
    frontier_features,
    look_around,
)
from layoutexplore.predictors.seen_rooms import Regions, _gaps, find_doors, seen_regions

grids = hnp.arrays(
    np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 100])
)

wide = st.builds(
    lambda coarse, size: coarse.repeat(size, axis=0).repeat(size, axis=1),
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(2, 5), st.integers(2, 8)),
        elements=st.sampled_from([-1, -1, -1, 0, 0, 100]),
    ),
    st.integers(3, 6),
)
"""Grids with long stretches without walls."""


def nothing_seen(shape: tuple[int, int]) -> Regions:
    return Regions(np.zeros(shape, np.int32), 0, np.zeros(shape, np.float32))


def test_walls_go_on_through_the_unknown() -> None:
    cells = np.full((9, 12), -1, np.int8)
    cells[4, 1:4] = 100
    cells[4, 8] = 0
    chart = draw_chart(cells, nothing_seen(cells.shape), 0.15, 0.3)
    code = chart.code[chart.margin : -chart.margin, chart.margin : -chart.margin]
    assert np.argwhere(code & ALONG_ROWS).tolist() == [[4, 0], [4, 4], [4, 5], [4, 6], [4, 7]]
    assert not (code & ALONG_COLS).any()


@settings(max_examples=40, deadline=None)
@given(cells=grids | wide)
def test_a_chart_against_a_slow_one(cells: NDArray[np.int8]) -> None:
    chart = draw_chart(cells, nothing_seen(cells.shape), 0.2, 0.4)
    padded = np.pad(cells, chart.margin, constant_values=-1)
    expected = np.zeros(padded.shape, np.uint8)
    for turned, bit in ((False, ALONG_ROWS), (True, ALONG_COLS)):
        lines, bits = (padded.T, expected.T) if turned else (padded, expected)
        for line, marked in zip(lines, bits, strict=True):
            text = "".join({-1: "?", 0: ".", 100: "#"}[int(v)] for v in line)
            for c, value in enumerate(text):
                left, right = text[:c].rstrip("?"), text[c + 1 :].lstrip("?")
                if value == "?" and (left.endswith("##") or right.startswith("##")):
                    marked[c] |= bit
    assert (chart.code & (ALONG_ROWS | ALONG_COLS) == expected).all()
    assert ((chart.code & UNKNOWN_BIT > 0) == (padded == -1)).all()


def features_of(
    cells: NDArray[np.int8], clusters: FrontierClusters, resolution: float, memory: ProbeMemory | None = None
) -> NDArray[np.float32]:
    """The features of frontiers with nothing in sight."""
    around = look_around(cells, clusters, seen_regions(cells, resolution), resolution, memory)
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
    memory = ProbeMemory()
    for _ in range(4):
        clusters = find_frontiers(cells)
        np.testing.assert_array_equal(
            features_of(cells, clusters, 0.4, memory), features_of(cells, clusters, 0.4)
        )
        r, c = rng.integers(0, 26), rng.integers(0, 146)
        cells[r : r + 4, c : c + 4] = rng.choice(np.array([-1, 0, 100], np.int8), (4, 4))


@settings(max_examples=40, deadline=None)
@given(cells=grids)
def test_a_flood_against_a_slow_one(cells: NDArray[np.int8]) -> None:
    clusters = find_frontiers(cells)
    if not len(clusters):
        return
    chart = draw_chart(cells, nothing_seen(cells.shape), 0.2, 1.4)
    members = clusters.cluster(0) + np.int32(chart.margin)
    depths = np.array([1, 3, 5], np.int64)
    out, touched = np.zeros(8, np.float32), np.zeros(TOUCHED, np.int32)
    stamp, queue = np.zeros(chart.code.size, np.int32), np.zeros(chart.code.size, np.int32)
    flood_unknown(chart.code, ALONG_ROWS, members, depths, stamp, 1, queue, out, touched)
    open_cells = (chart.code & UNKNOWN_BIT > 0) & (chart.code & ALONG_ROWS == 0)
    reached = np.zeros(chart.code.shape, np.bool_)
    reached[members[:, 0], members[:, 1]] = True
    behind = 0
    for depth in range(1, 6):
        grown = np.pad(reached, 1)
        grown = grown[:-2, 1:-1] | grown[2:, 1:-1] | grown[1:-1, :-2] | grown[1:-1, 2:]
        reached |= grown & open_cells
        behind = int((reached & open_cells).sum())
        if depth in depths:
            assert out[depths.tolist().index(depth)] == behind
    assert (chart.code.ravel()[touched[touched >= 0]] & UNKNOWN_BIT == 0).all()


@settings(max_examples=60, deadline=None)
@given(cells=grids, seed=st.integers(0, 1000))
def test_floods_that_meet_no_barrier_are_shared(cells: NDArray[np.int8], seed: int) -> None:
    """Probing all barriers at once writes what floods with each of them write; doors are scattered thinly, or not at all."""
    clusters = find_frontiers(cells)
    if not len(clusters):
        return
    rng = np.random.default_rng(seed)
    chart = draw_chart(cells, nothing_seen(cells.shape), 0.2, 3.0)
    chart.code[rng.random(chart.code.shape) < rng.choice([0.0, 0.01, 0.3])] |= DOOR_BIT
    members = clusters.cluster(0) + np.int32(chart.margin)
    depths, barriers = (
        np.array([1, 2, 4], np.int64),
        np.array([0, ALONG_ROWS | ALONG_COLS, DOOR_BIT], np.int64),
    )
    stamp, queue = np.zeros(chart.code.size, np.int32), np.zeros(chart.code.size, np.int32)
    one = (
        np.array([0, len(members)], np.int64),
        np.zeros(1, np.int64),
        depths,
        np.array([8, 1, 3, 1], np.int64),
        barriers,
    )
    found = np.zeros((1, len(FEATURES)), np.float32)
    _, touched = _probe(chart.code, members, *one, stamp, 0, queue, found)
    first = FEATURES.index("open_area_0.3")
    for b, barrier in enumerate(barriers):
        out, cells_touched = np.zeros(8, np.float32), np.zeros(TOUCHED, np.int32)
        met = flood_unknown(chart.code, barrier, members, depths, stamp, 10 + b, queue, out, cells_touched)
        np.testing.assert_array_equal(found[0, first + 8 * b : first + 8 * (b + 1)], out)
        np.testing.assert_array_equal(touched[0, b], cells_touched)
        assert met & UNKNOWN_BIT or not out.any()


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


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_gaps_against_a_slow_version(seed: int) -> None:
    """Lines of wall with holes; whether the space widens is told by the runs of all cells."""
    rng = np.random.default_rng(seed)
    occupied = rng.random((25, 60)) < rng.uniform(0, 0.1)
    for r in rng.integers(0, 25, 3):
        occupied[r] |= rng.random(60) < 0.85
    narrowest, widest, wall, widening, depth = sizes = (2, 14, 2, 2, 3)
    runs, expected = free_runs(occupied), []
    for r, line in enumerate(occupied):
        for left, right in itertools.pairwise(np.flatnonzero(line).tolist()):
            n = right - left - 1
            if not narrowest <= n <= widest:
                continue
            near: NDArray[np.bool_] = np.logical_or.reduce(np.pad(occupied, 1)[r : r + 3, 1:-1])
            sides = near[max(left + 1 - wall, 0) : left + 1], near[right : right + wall]
            walled = any(len(part) == wall and part.all() for part in sides)
            middle = left + 1 + n // 2
            if walled and all(widens(runs, r, middle, step, depth, n + widening) for step in (-1, 1)):
                expected.append([r, left + 1, n])
    assert _gaps(occupied, np.array(sizes, np.int64)).tolist() == expected


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_changed_blocks_against_a_slow_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before = rng.integers(0, 64, rng.integers(1, 40, 2), np.uint8)
    after = before.copy()
    after[rng.random(before.shape) < 0.02] ^= 4
    changed = _changed_blocks(before, after)
    expected = np.zeros_like(changed, np.bool_)
    for r, c in np.argwhere(before != after):
        expected[r // BLOCK, c // BLOCK] = True
    assert changed.shape == tuple(-(-n // BLOCK) for n in before.shape) and ((changed > 0) == expected).all()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_sums_of_regions_against_slow_ones(seed: int) -> None:
    """Labels in runs of all lengths, shorter and longer than what is compared at once; doors at few cells."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 5, (6, 60)).repeat(rng.integers(1, 30, 60), axis=1).astype(np.int32)
    width = np.where(rng.random(labels.shape) < 0.02, rng.uniform(0.5, 2.0, labels.shape), 0.0).astype(
        np.float32
    )
    regions = Regions(labels, 4, width)
    for region in range(1, 5):
        rows, cols = np.nonzero(labels == region)
        expected = (
            [len(rows), rows.min(), cols.min(), rows.max() + 1, cols.max() + 1] if len(rows) else [0] * 5
        )
        assert regions.boxes[region].tolist() == expected
        total = 0.0
        for value in width[rows, cols]:
            total += 1.0 / np.float64(value) if value > 0 else 0.0
        assert regions.doors[region] == pytest.approx(total, rel=1e-6)


def test_doors_are_the_narrower_of_two_gaps() -> None:
    rows = ["#########", "#...#...#", "#.......#", "#...#...#", "#########"]
    cells = np.array([[c == "#" for c in row] for row in rows])
    width = find_doors(np.kron(cells, np.ones((8, 8), np.bool_)), 0.1)
    assert width.dtype == np.float32 and np.unique(width).tolist() == pytest.approx([0.0, 0.8])
    assert (width[18:22, 34:38] > 0).all() and not width[:16].any() and not width[24:].any()


def test_cells_are_offered_to_two_regions_and_judged_by_their_neighbourhood() -> None:
    cells = np.full((40, 60), -1, np.int8)
    cells[:, :20], cells[:, 40:] = 0, 0
    regions = seen_regions(cells, 0.1)
    candidates = find_candidates(cells, regions, 0.1)
    assert sorted(set(candidates.region.tolist())) == [1, 2] and set(candidates.rank.tolist()) == {0, 1}
    assert (cells[candidates.cells[:, 0], candidates.cells[:, 1]] == -1).all()
    inside = (candidates.region == 1).astype(float)
    features = add_judgement(candidates, inside, 0.1)
    at = CELL_FEATURES.index("judged_near")
    assert (features[candidates.region == 1, at] == 1.0).all() and (
        features[candidates.region == 2, at] == 0.0
    ).all()
    total = CELL_FEATURES.index("judged_total")
    assert features[candidates.region == 1, total] == pytest.approx(40 * 20 * 0.01, rel=0.3)
    some = find_candidates(cells, regions, 0.1, wanted=np.array([False, True, False]))
    np.testing.assert_array_equal(some.features, candidates.features[candidates.region == 1])
