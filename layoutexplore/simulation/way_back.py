"""The way back to where an exploration began, over what is known; its metres are counted apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.frontiers.decision import CellPath
from layoutexplore.grids.grid import Cell
from layoutexplore.simulation.simulation import Simulation

ARRIVED = 0.5
"""Metres from the start, as the robot believes, that count as being there."""

_ATTEMPTS = 100
"""So many walls that are not on the map may stop the robot before it gives up."""


class WayBack(NamedTuple):
    """What became of the way back.

    Attributes:
        metres: Travelled on it, with what turning costs.
        arrived: Whether the robot believes to be at its start.
    """

    metres: float
    arrived: bool


@checks_arguments
def return_to_start(simulation: Simulation) -> WayBack:
    """Send the robot of a run that is over back to its start, on the shortest path that its map knows.

    Nothing is scanned on the way. `Simulation.distance`, the curve and every figure that follows from them
    stay what they were when the run ended; the track goes on.

    Args:
        simulation: A run that is `done`.

    Raises:
        ConfigError: The run is not over.
    """
    if not simulation.done:
        raise ConfigError("the run is not over: the robot returns when it has stopped exploring")
    state, robot = simulation.state, simulation.robot
    state.freeze_distance()
    begun = state.charged
    x, y, _ = robot.believed_track[0].tolist()
    home = simulation.mapper.grid.nearest_cell(x, y)
    for _ in range(_ATTEMPTS):
        path = _path(simulation, home)
        if _walked_to_the_end(simulation, path):
            break
    away = float(np.hypot(robot.believed.x - x, robot.believed.y - y))
    return WayBack(state.charged - begun, away <= ARRIVED)


def _path(simulation: Simulation, home: Cell) -> CellPath:
    """The shortest path from where the robot is to the reachable cell nearest to its start."""
    grid = simulation.mapper.grid
    here = grid.nearest_cell(simulation.robot.believed.x, simulation.robot.believed.y)
    field = simulation.state.traversability.distances(grid.cells, here)
    reached = np.argwhere(field.reached)
    nearest = reached[((reached - np.array(home)) ** 2).sum(axis=1).argmin()]
    return field.path_to(Cell(*nearest.tolist()))


def _walked_to_the_end(simulation: Simulation, path: CellPath) -> bool:
    """Follow a path; False where a wall stops the robot, which is on the map then."""
    state, robot, grid = simulation.state, simulation.robot, simulation.mapper.grid
    for row, col in path[1:].tolist():
        x, y = grid.cell_to_world(row, col)
        dx, dy = x - robot.believed.x, y - robot.believed.y
        robot.turn_to(np.arctan2(dy, dx))
        _, collided = robot.translate(dx, dy)
        if collided:
            state.note_change(state.mapper.mark_occupied(robot.touched(dx, dy)).box)
            state.traversability.shut(Cell(row, col))
            return False
    return True
