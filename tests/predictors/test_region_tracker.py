"""Seen rooms that are followed from grid to grid are those that are found anew."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.arrays import Cells
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.region_tracker import RegionTracker, take_changes
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import rooms


def assert_same(tracker: RegionTracker, cells: Cells, resolution: float) -> None:
    found, expected = tracker(cells, resolution), doorway_regions(cells, resolution)
    assert found.count == expected.count
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.door_width, expected.door_width)
    np.testing.assert_array_equal(found.boxes, expected.boxes)
    np.testing.assert_array_equal(found.doors, expected.doors)


@given(seed=st.integers(0, 2**32), resolution=st.sampled_from([0.1, 0.2, 0.5]))
@settings(max_examples=40, deadline=None)
def test_rooms_are_those_found_anew(seed: int, resolution: float) -> None:
    """Walls with gaps come and go in boxes, up to the grid's edges; now and then it is another grid."""
    rng = np.random.default_rng(seed)
    tracker = RegionTracker()
    for _ in range(2):
        shape = tuple(rng.integers(1, 90, 2).tolist())
        cells = np.full(shape, -1, np.int8)
        for _ in range(4):
            for _ in range(int(rng.integers(0, 5))):
                row, col, height, width = rng.integers(0, 60, 4).tolist()
                cells[row : row + height, col : col + width] = rng.choice([0, 0, -1, 100])
                if rng.random() < 0.5:
                    line = cells[int(rng.integers(shape[0]))]
                    line[rng.random(line.size) < 0.8] = 100
            assert_same(tracker, cells, resolution)


def test_an_exploration_is_followed_to_its_end() -> None:
    simulation, tracker = Simulation(rooms(), SimulationConfig(sensor="short")), RegionTracker()
    decision = simulation.reset(3)
    while not simulation.done:
        assert_same(tracker, decision.grid.cells, decision.grid.resolution)
        decision = simulation.step(len(decision.frontiers) // 2)


@given(seed=st.integers(0, 2**32))
@settings(max_examples=60, deadline=None)
def test_changes_lie_in_the_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 40, 2).tolist())
    kept = rng.choice([-1, 0, 100], shape).astype(np.int8)
    cells = kept.copy()
    cells[rng.random(shape) < rng.choice([0.0, 0.02, 0.5])] = 7
    changed = np.argwhere(cells != kept)
    box = take_changes(cells, kept)
    np.testing.assert_array_equal(kept, cells)
    if len(changed):
        (row0, col0), (row1, col1) = changed.min(0).tolist(), (changed.max(0) + 1).tolist()
        assert box == (row0, row1, col0, col1)
    else:
        assert box == (0, 0, 0, 0)


def test_more_regions_than_small_labels_can_number() -> None:
    """They are numbered as before or after when the grid is full of specks, and is not."""
    clear = np.full((300, 300), -1, np.int8)
    clear[100:200, 100:200] = 0
    specks = np.full((300, 300), 100, np.int8)
    specks[::2, ::2] = specks[1::2, 1::2] = 0
    tracker = RegionTracker()
    for cells in (clear, specks, clear):
        assert_same(tracker, cells, 0.1)
    assert tracker(specks, 0.1).count == 45_000
