"""Bit maps that are followed from grid to grid are those that are drawn anew."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.predictors.bit_map import draw_bit_map
from layoutexplore.predictors.frontier_model.followed_bit_map import BLOCK, FollowedBitMap, changed_blocks
from layoutexplore.predictors.region_tracker import RegionTracker
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import rooms


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 2**32), resolution=st.sampled_from([0.1, 0.4, 1.0, 3.0]))
def test_a_bit_map_is_the_one_drawn_anew(seed: int, resolution: float) -> None:
    """Walls of all lengths come and go, up to the grid's edges, and so do doors; once all is another."""
    rng = np.random.default_rng(seed)
    draw, margin = FollowedBitMap(), float(rng.uniform(0.0, 3.0))
    for _ in range(2):
        shape = tuple(rng.integers(1, 90, 2).tolist())
        cells, gaps = np.full(shape, -1, np.int8), np.zeros(shape, np.uint8)
        before = None
        for _ in range(5):
            for _ in range(int(rng.integers(0, 4))):
                row, col, height, width = rng.integers(0, 60, 4).tolist()
                if rng.random() < 0.6:
                    height, width = (min(height, 2), width) if rng.random() < 0.5 else (height, min(width, 2))
                cells[row : row + height, col : col + width] = rng.choice([0, -1, 100, 100])
                at = int(rng.integers(shape[0])), int(rng.integers(shape[1]))
                gaps[at] = rng.integers(5)
            known = np.argwhere(cells != -1)
            seen = np.zeros(shape, np.bool_)
            if len(known):
                (row0, col0), (row1, col1) = known.min(0), known.max(0) + 1
                seen[row0:row1, col0:col1] = True
            regions = Regions(np.zeros(shape, np.int32), 0, gaps * seen, resolution)
            expected = draw_bit_map(cells, regions, resolution, margin)
            found, changed = draw(cells, regions, resolution, margin)
            assert found.margin == expected.margin
            np.testing.assert_array_equal(found.code, expected.code)
            if before is not None:
                assert changed is not None
                np.testing.assert_array_equal(changed > 0, changed_blocks(before, expected.code) > 0)
            before = expected.code


def test_an_exploration_is_followed_to_its_end() -> None:
    """The gaps of seen rooms lie within what is known."""
    simulation = Simulation(rooms(), SimulationConfig(sensor="short"))
    tracker, draw = RegionTracker(), FollowedBitMap()
    decision = simulation.reset(3)
    while not simulation.done:
        cells, resolution = decision.grid.cells, decision.grid.resolution
        found, _ = draw(cells, tracker(cells, resolution), resolution, 8.2)
        expected = draw_bit_map(cells, doorway_regions(cells, resolution), resolution, 8.2)
        np.testing.assert_array_equal(found.code, expected.code)
        decision = simulation.step(len(decision.frontiers) // 2)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_changed_blocks_against_a_slow_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before = rng.integers(0, 64, rng.integers(1, 40, 2), np.uint8)
    after = before.copy()
    after[rng.random(before.shape) < 0.02] ^= 4
    changed = changed_blocks(before, after)
    expected = np.zeros_like(changed, np.bool_)
    for r, c in np.argwhere(before != after):
        expected[r // BLOCK, c // BLOCK] = True
    assert changed.shape == tuple(-(-n // BLOCK) for n in before.shape) and ((changed > 0) == expected).all()
