"""The scores of a run, worked out once more from its scans and its way, slowly and from scratch."""

from __future__ import annotations

import heapq
import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.benchmark.rows import prepare
from layoutexplore.metrics.exploration import score_curve
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices

Bools = NDArray[np.bool_]

STEPS = [step for step in itertools.product((-1, 0, 1), repeat=2) if step != (0, 0)]

TURNED = 0.0123
"""Angle of the lidar on the robot: an odd one, so that no ray meets a corner exactly."""

BEAMS = 97


def ways(world: Bools, begin: list[tuple[int, int]]) -> NDArray[np.float64]:
    """Lengths in cells of the shortest ways from some cells, cutting no corner; inf where none leads."""
    found = np.full(world.shape, np.inf)
    queue = [(0.0, cell) for cell in begin]
    while queue:
        length, (r, c) = heapq.heappop(queue)
        if not world[r, c] or length >= found[r, c]:
            continue
        found[r, c] = length
        for dr, dc in STEPS:
            if world[r + dr, c] and world[r, c + dc]:
                heapq.heappush(queue, (length + math.hypot(dr, dc), (r + dr, c + dc)))
    return found


def floor_to_see(simulation: Simulation) -> Bools:
    """Free cells within 0.8 m, along free space, of those that the robot's centre can reach."""
    raster, config = simulation.raster, simulation.config
    walls = np.argwhere(raster.occupied)
    fits = np.zeros(raster.shape, np.bool_)
    for r, c in np.argwhere(raster.free).tolist():
        fits[r, c] = np.hypot(*(walls - (r, c)).T).min() >= config.robot_radius / config.resolution - 1e-9
    reached = np.isfinite(ways(fits, [simulation.truth.start]))
    near = ways(raster.free, [(r, c) for r, c in np.argwhere(reached).tolist()])
    return np.asarray(near <= 0.8 / config.resolution + 1e-4)


def look(seen: Bools, occupied: Bools, x: float, y: float, angle: float, reach: float) -> None:
    """Mark the cells of a ray from (x, y), in cells, up to the first wall or the end of the reach."""
    borders = []
    for axis, (place, move) in enumerate(((x, math.cos(angle)), (y, math.sin(angle)))):
        first, step = (math.floor(place) + 1, 1) if move > 0 else (math.ceil(place) - 1, -1)
        count = math.ceil(reach * abs(move)) + 1
        borders += [((first + step * k - place) / move, axis, step) for k in range(count)]
    cell = [math.floor(x), math.floor(y)]
    seen[cell[1], cell[0]] = True
    for distance, axis, step in sorted(borders):
        if distance > reach or occupied[cell[1], cell[0]]:
            return
        cell[axis] += step
        seen[cell[1], cell[0]] = True


def metres_to(curve: list[tuple[float, float]], level: float) -> float:
    """Metres at which the share reaches a level; between two scans it rises evenly."""
    for (before, less), (after, more) in itertools.pairwise(curve):
        if more >= level > less:
            return before + (after - before) * (level - less) / (more - less)
    raise AssertionError("not between two scans")


@pytest.mark.parametrize("fov", [2 * math.pi, 3.0])
def test_scores_follow_from_scans_and_way(fov: float) -> None:
    """A lidar that looks ahead turns around now and then: a scan is of its beams, or of those all around."""
    lidar = LidarConfig(range_max=6.0, fov=fov, beams=BEAMS, angle_offset=TURNED)
    simulation, agent = prepare(offices(), SimulationConfig(sensor=lidar), "nearest")
    scans: list[tuple[float, float, float, float, Bools]] = []
    simulation.on_scan = lambda run: scans.append((*run.pose, run.distance, run.mapper.grid.cells >= 0))
    episode = play(simulation, agent, seed=5)
    target, seen = floor_to_see(simulation), np.zeros(simulation.raster.shape, np.bool_)
    assert np.array_equal(target, simulation.truth.target)
    ahead = [TURNED - fov / 2 + k * fov / (BEAMS - (fov < 6)) for k in range(BEAMS)]
    beams = round(2 * math.pi / (fov / (BEAMS - 1)))
    around = [TURNED - math.pi + k * 2 * math.pi / beams for k in range(beams)]
    curve, (left, low, _), cell = [], simulation.raster.origin, simulation.config.resolution
    for x, y, theta, metres, known in scans:
        for angles in (ahead, around):
            then = seen.copy()
            for angle in angles:
                look(then, simulation.raster.occupied, (x - left) / cell, (y - low) / cell, theta + angle, 60)
            if np.array_equal(then, known):
                break
        assert np.array_equal(then, known)
        seen = then
        curve.append((metres, np.count_nonzero(seen & target) / np.count_nonzero(target)))
    steps = itertools.pairwise(episode.track[:, :2].tolist())
    assert simulation.distance == pytest.approx(sum(math.dist(a, b) for a, b in steps))
    scores = score_curve(episode.curve, budget=simulation.max_distance, target_area=simulation.target_area)
    for found, level in ((scores.d90, 0.9), (scores.d95, 0.95), (scores.d99, 0.99)):
        assert found == pytest.approx(metres_to(curve, level))
