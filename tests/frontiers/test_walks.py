"""Walks: left when their sights have been seen, or where the way is blocked; wrong ones are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision, Walk
from layoutexplore.frontiers.walks import checked_walk
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import FREE, UNKNOWN, Cell, Pose
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

CORRIDOR = "\n".join(["#" * 42, "#" + "a" * 40 + "#", "#" + "a" * 40 + "#", "#" * 42])
"""40 m by 2 m at a metre a letter; a sensor of 5 m range sees an eighth of it."""

HERE = Pose(3.0, 2.0)


def begun(**options: Any) -> tuple[Simulation, Decision, Ints32]:
    """A robot at the left end of the corridor, and its path as far as it sees."""
    plan = floorplan_from_ascii(CORRIDOR, resolution=1.0)
    simulation = Simulation(plan, SimulationConfig(sensor="short", coverage_goal=1.0, **options))
    decision = simulation.reset(start=HERE)
    here = decision.grid.nearest_cell(HERE.x, HERE.y)
    ahead = np.flatnonzero(decision.traversable[here.row, here.col :])
    path = np.stack([np.full(len(ahead), here.row), here.col + ahead], axis=1).astype(np.int32)
    return simulation, decision, path


def stretch(decision: Decision, path: Ints32, begin: float, length: float) -> Ints32:
    """The unknown cells of the path's row, from so many metres beyond its end on."""
    first = path[-1, 1] + round(begin / decision.grid.resolution)
    cols = np.arange(first, first + round(length / decision.grid.resolution))
    cells = np.stack([np.full(len(cols), path[0, 0]), cols], axis=1).astype(np.int32)
    return cells[decision.grid.cells[cells[:, 0], cells[:, 1]] == UNKNOWN]


@pytest.mark.parametrize("noisy", [False, True])
def test_a_walk_is_left_when_its_sights_are_seen(noisy: bool) -> None:
    """What lies a metre beyond sight is seen a metre or two on, far from the end of the path."""
    noise: dict[str, Any] = {"noise": "low"} if noisy else {}
    simulation, decision, path = begun(**noise)
    sights = stretch(decision, path, 0.5, 0.5)
    simulation.step(Walk(path, sights))
    seen = simulation.mapper.grid.cells[sights[:, 0], sights[:, 1]]
    assert (seen == FREE).mean() > 0.8
    assert 0.4 < simulation.distance < 2.5
    assert simulation.decision.grid is simulation.mapper.grid


def test_a_walk_whose_sights_are_not_seen_is_followed_to_its_end() -> None:
    simulation, decision, path = begun()
    whole, _, same = begun()
    simulation.step(Walk(path, stretch(decision, path, 20.0, 1.0)))
    whole.step(same)
    assert np.array_equal(simulation.track, whole.track)
    assert np.array_equal(simulation.mapper.grid.cells, whole.mapper.grid.cells)
    assert simulation.distance > 3.0


def test_a_walk_ends_where_it_is_blocked() -> None:
    """A path through the end of the corridor: a walk stops before the wall, without touching it."""
    simulation, decision, path = begun()
    cols = np.arange(path[0, 1], decision.grid.cells.shape[1])
    through = np.stack([np.full(len(cols), path[0, 0]), cols], axis=1).astype(np.int32)
    unseen = np.array([[0, 0]], np.int32)  # The corner of the grid lies in the outer wall.
    assert decision.grid.cells[0, 0] == UNKNOWN
    simulation.step(Walk(through, unseen))
    assert simulation.robot.collisions == 0
    assert 30.0 < simulation.robot.pose.x < 41.0


@pytest.mark.parametrize(
    ("sights", "told"),
    [
        (np.empty((0, 2), np.int32), "n > 0"),
        (np.zeros((3, 3), np.int32), "n, 2"),
        (np.zeros((1, 2)), "float64"),
        (None, "None"),
        (np.array([[0, 4]]), "outside of the grid of 3 x 4"),
        (np.array([[-1, 0]]), "outside"),
    ],
)
def test_wrong_sights_are_refused(sights: Any, told: str) -> None:
    path = np.array([[1, 1], [1, 2]], np.int32)
    assert checked_walk(Walk(path, np.array([[2, 3]])), Cell(1, 1), (3, 4)).sights.dtype == np.int32
    with pytest.raises(ConfigError, match=told):
        checked_walk(Walk(path, sights), Cell(1, 1), (3, 4))


@pytest.mark.parametrize("path", [None, [(1, 1), (1, 2)]])
def test_a_walk_needs_an_array_of_cells(path: Any) -> None:
    with pytest.raises(ConfigError, match="a path is an integer array"):
        checked_walk(Walk(path, np.array([[2, 3]])), Cell(1, 1), (3, 4))
