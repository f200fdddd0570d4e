"""Looking all around on the way: a lidar that looks ahead sees so into the rooms that are passed.

Turning is free in a simulation unless it is told otherwise (`turn_cost`), and a look takes no time. Where
turning costs, ways are gone as they are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from layoutexplore.frontiers.decision import PATHS, STOP, CellPath, Choice, Decision, Walk, path_of
from layoutexplore.frontiers.table import Frontier
from layoutexplore.frontiers.viewpoints import remaining_share
from layoutexplore.grids.grid import UNKNOWN, Cell
from layoutexplore.planning.first_steps import first_steps
from layoutexplore.simulation.config import SimulationConfig

LOOK_EVERY = (
    "metres after which the robot looks all around on its way, where that shows more and turning is free"
    " (0: never)"
)
"""What the option says of itself, wherever it stands."""

STILL_THERE = 0.5
"""Metres that the middle of a frontier may have moved and be the same one, after a few steps towards it."""

JUMP = 2.0
"""Metres between two looks by which the viewpoint of a frontier moves only where that is long."""

ON_IT = 1.5
"""Metres around where the robot is going within which a part of the frontier is the one it goes to."""

HARDLY = SimulationConfig.gone_share
"""Share of what a walk is for: where less is left to see, it has seen that."""


class LookingAround:
    """Cuts the ways of an agent into pieces, each of which ends in a look all around.

    The agent keeps to what it has chosen until that is gone or reached, or it sees anything new: two goals
    could take turns for ever, each the best one from where the other leads.

    Args:
        every: Metres between looks; 0 for none.
        with_any_lidar: Stop with a lidar that sees all around anyway, too, to decide anew.
    """

    def __init__(self, every: float, *, with_any_lidar: bool = False) -> None:
        self.every = every
        self._with_any_lidar = with_any_lidar
        self._goal: Frontier | CellPath | Walk | None = None
        self._known = 0
        self._aim: tuple[float, float] | None = None
        self._turned = False

    def forget(self) -> None:
        """A new run begins: the robot is on its way to nothing."""
        self._goal, self._known, self._aim, self._turned = None, 0, None, False

    def choose(self, decision: Decision, plan: Callable[[Decision], Choice], *, anew: bool) -> Choice:
        """The next piece of the way that was chosen, or the first one of the way of a new choice.

        Args:
            decision: Where the robot is, and what it can go to.
            plan: Chooses where to go.
            anew: Choose again as soon as anything was seen on the way; without news the robot goes on.
        """
        choice = self.keep_on(decision, anew=anew)
        return self.begin(decision, plan(decision)) if choice is None else choice

    def keep_on(self, decision: Decision, *, anew: bool) -> Choice | None:
        """The next piece of the way that was chosen; None where a choice is due: see `choose`."""
        if anew and self._goal is not None and _known(decision) != self._known:
            self._goal = None
        return self.go_on(decision)

    def go_on(self, decision: Decision) -> Choice | None:
        """The next piece of the way that was chosen; None where its goal is gone, or there is none."""
        goal, self._goal = self._goal, None
        if goal is None:
            return None
        chosen = _still_there(decision, goal) if isinstance(goal, Frontier) else _rest_of(decision, goal)
        return None if chosen is None else self.begin(decision, chosen)

    def begin(self, decision: Decision, choice: Choice) -> Choice:
        """The first piece of the way of a choice; all of it where no look is due before its end."""
        self._goal = None
        if not self.pays(decision):
            return choice
        elsewhere = False
        if isinstance(choice, PATHS):
            path = path_of(choice)
        elif choice == STOP:
            return choice
        else:
            aim = self._aim_at(decision, choice)
            path, elsewhere = decision.field.path_to(aim), aim != decision.frontiers[choice].viewpoint
        steps = first_steps(path, decision.grid.resolution, self.every)
        if steps is None:
            return path if elsewhere and len(path) > 1 else choice
        self._goal = choice if isinstance(choice, PATHS) else decision.frontiers[choice]
        self._known = _known(decision)
        return Walk(steps, choice.sights) if isinstance(choice, Walk) else steps

    def _aim_at(self, decision: Decision, choice: int) -> Cell:
        """Where to walk for a frontier: to its viewpoint, or on to the part of it that the robot walks to.

        The viewpoint of a frontier that runs around a hall lies in its middle: on one side of the robot, and
        with a little more seen on the other. A robot that has once turned round for it turns no more while
        there is a part of it where it is going.
        """
        grid, view = decision.grid, Cell(*decision.viewpoints[choice].tolist())
        last, self._aim = self._aim, grid.cell_to_world(*view)
        if last is None or math.dist(last, self._aim) <= JUMP:
            return view
        cells = decision.frontiers[choice].cells
        cells = cells[decision.traversable[cells[:, 0], cells[:, 1]]]
        away = np.linalg.norm(grid.cells_to_world(cells) - last, axis=1)
        goes_on = len(cells) > 0 and bool(away.min() <= ON_IT)
        if goes_on and self._turned:
            view = Cell(*cells[away.argmin()].tolist())
            self._aim = grid.cell_to_world(*view)
        self._turned = goes_on
        return view

    def pays(self, decision: Decision) -> bool:
        """Whether a stop is worth it, and the look costs nothing."""
        shows_more = self._with_any_lidar or not decision.sensor.full_turn
        return self.every > 0 and shows_more and not decision.turn_cost


def _known(decision: Decision) -> int:
    """Cells that have been seen."""
    return int(np.count_nonzero(decision.grid.cells != UNKNOWN))


def _still_there(decision: Decision, goal: Frontier) -> int | None:
    """The frontier that the robot was going to, if it is still there."""
    same = np.flatnonzero((decision.viewpoints == goal.viewpoint).all(axis=1))
    if len(same):
        return int(same[0])
    (x, y), table = goal.centroid, decision.table
    moved = np.hypot(table.x - x, table.y - y)
    nearest = int(np.argmin(moved))
    return nearest if moved[nearest] < STILL_THERE else None


def _rest_of(decision: Decision, way: CellPath | Walk) -> CellPath | Walk | None:
    """What is left of a path from the robot on; None where it is shut, over, or has shown what it is for."""
    path, here = path_of(way), decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
    reached = np.flatnonzero((path == here).all(axis=1))
    if not len(reached) or reached[0] == len(path) - 1:
        return None
    rest = path[reached[0] :]
    if not decision.traversable[rest[1:, 0], rest[1:, 1]].all():
        return None
    if not isinstance(way, Walk):
        return rest
    return None if remaining_share(decision.grid.cells, way.sights) < HARDLY else Walk(rest, way.sights)
