"""What is seen from a cell of a known floor plan."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.agents.omniscient.visibility import FloorInView, Visibility, added_sizes, size
from layoutexplore.grids.grid import Pose
from layoutexplore.sensing.lidar import around
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices


@pytest.mark.parametrize("sensor", ["indoor", "stage"])
def test_visibility_agrees_with_the_lidar(sensor: str) -> None:
    """A full turn shows what a scan marks, up to what falls between its fewer beams."""
    simulation = Simulation(offices(), SimulationConfig(sensor=sensor))
    simulation.reset(seed=0)
    truth, raster = simulation.truth, simulation.raster
    visibility = Visibility(FloorInView.of(truth), 0.5)
    cells = np.argwhere(truth.reachable)[:: len(np.argwhere(truth.reachable)) // 12].astype(np.int32)
    everything = np.bitwise_or.reduce(
        visibility.turning(np.argwhere(truth.reachable)[::40].astype(np.int32)), axis=0
    )
    assert size(everything) > 0.98 * visibility.count
    for cell, seen in zip(cells, visibility.turning(cells), strict=True):
        mapper = Mapper(raster.shape, raster.resolution, raster.origin)
        mapper.observe(simulation.lidar, Pose(*raster.cell_to_world(*cell)), full_turn=True)
        share = np.count_nonzero(truth.target & mapper.grid.free) / np.count_nonzero(truth.target)
        assert -0.03 < size(seen) / visibility.count - share < 0.01


def test_visibility_ahead_and_around() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="stage"))
    simulation.reset(seed=0)
    visibility = Visibility(FloorInView.of(simulation.truth), 0.5)
    row, cols = 36, np.arange(30, 60)
    path = np.stack([np.full(len(cols), row), cols], axis=1).astype(np.int32)
    ahead, back = visibility.walking(path), visibility.walking(path[::-1])
    both = ahead | back
    assert 0 < size(ahead) < size(both) and 0 < size(back) < size(both)
    assert size(visibility.walking(path[:4])) == 0, "no scan falls due on a short way"
    assert around(simulation.config.lidar).full_turn


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_copy_follows_a_floor_that_changes(copied: Callable[[Visibility], Visibility]) -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="stage"))
    simulation.reset(seed=0)
    scene = FloorInView.of(simulation.truth)
    visibility = Visibility(scene, 0.5, fixed=False)
    other = copied(visibility)
    walled = scene.occupied.copy()
    walled[:, walled.shape[1] // 2] = True
    path = np.array([[36, col] for col in range(30, 60)], np.int32)
    for each in (visibility, other):
        each.adapt(scene._replace(occupied=walled))
    assert np.array_equal(visibility.turning(path), other.turning(path))
    assert np.array_equal(visibility.walking(path), other.walking(path))


def test_sets_are_counted() -> None:
    rng = np.random.default_rng(0)
    sets: NDArray[np.uint64] = rng.integers(0, 2**64, (5, 7), dtype=np.uint64)
    other: NDArray[np.uint64] = rng.integers(0, 2**64, 7, dtype=np.uint64)
    expected = [
        sum(bin(int(a) & ~int(b) & (2**64 - 1)).count("1") for a, b in zip(row, other, strict=True))
        for row in sets
    ]
    assert added_sizes(sets, np.arange(5), other).tolist() == expected
    assert size(other) == sum(bin(int(b)).count("1") for b in other)
