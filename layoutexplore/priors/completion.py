"""From a registered plan to what is foreseen on the robot's grid; what the robot has seen always wins."""

from __future__ import annotations

from enum import IntEnum

import cv2
import numpy as np

from layoutexplore.errors import checks_arguments
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, in_cells
from layoutexplore.grids.morphology import disc, with_neighbours
from layoutexplore.priors.openings import with_ways_in
from layoutexplore.priors.registration import Hypothesis, Registration, thinned
from layoutexplore.priors.warp import WarpedPlacement

WALL_DEPTH = 0.5
"""Metres of solid behind floor that are foreseen as walls; deeper, a plan is silent."""

CONTRADICTED, LEAST_POINTS = 0.5, 10
"""A plan's room is contradicted where so large a share of the points seen in it, of so many, are walls."""

LEAST_SHARE = 0.02
"""Share of the seen floor that lies in a part of a plan if the robot has been in that part."""

POINT_OFF = 0.6
"""Metres by which a seen wall is off when it disagrees with a plan."""

HELD = 0.2
"""Metres by which a plan's place may change, anywhere in the seen part, without the plan being redrawn."""

LEAST_GAP = 0.25
"""Metres; where a plan's walls are off, foreseen floor into which a disc of this radius (or of twice their
usual error, if that is less) does not fit is the error of a wall's place."""


TOLERANCE = 0.5
"""Metres; half a metre of a wall's error is agreement, what is farther off is a mistake of the plan."""


TRUST, DOUBT = 2.0, 5.0
"""Metres beyond seen floor up to which a plan is trusted none of whose walls are right, and points of walls
that are held for wrong before any is seen."""


class PlanOnMap:
    """The plan on a robot's grid from decision to decision: redrawn when its place or the grid's has changed.

    A planner that works on what is foreseen need not begin anew for every centimetre.
    """

    def __init__(self) -> None:
        self._placed: WarpedPlacement | None = None
        self._drawn: tuple[Cells, Ints32] | None = None
        self._frame: tuple[tuple[int, int], float, Pose] | None = None

    def foresee(
        self, registration: Registration, grid: OccupancyGrid, confidence: float, name: str
    ) -> Foresight:
        """What the best hypothesis says of the cells of a grid.

        Args:
            registration: With at least one hypothesis.
            grid: What the robot knows.
            confidence: Probability that the hypothesis is right.
            name: Of the predictor.
        """
        best, frame = registration.hypotheses[0], (grid.shape, grid.resolution, grid.origin)
        if self._drawn is None or self._placed is None or self._frame != frame:
            moved = np.inf
        else:
            moved = best.distance_to(self._placed, registration.evidence)
        if moved > HELD:
            self._placed, self._drawn = best.placed, drawn_on(registration, best, grid)
            self._frame = frame
        assert self._drawn is not None
        cells, ids = self._drawn[0].copy(), self._drawn[1].copy()
        silent = contradicted_rooms(registration, best) | rooms_apart(registration, best)
        if silent:
            gone = np.isin(ids, sorted(silent))
            cells[gone] = UNKNOWN
        _drop_slivers(cells, grid, min(LEAST_GAP, 2.0 * _usual_error(registration, best)))
        cells = with_ways_in(cells, grid.cells, grid.resolution)
        ids[cells != FREE] = 0
        whole = Foresight(
            cells=cells, room_ids=ids, confidence=confidence, predictor=name, resolution=grid.resolution
        )
        return whole.within(trusted_reach(registration, best), grid.cells)


def trusted_reach(registration: Registration, hypothesis: Hypothesis) -> float:
    """Metres beyond seen floor up to which a plan is trusted: the more of its walls are off, the fewer.

    Far off, a plan that is not quite right misleads more than it tells.
    """
    count = len(registration.evidence.walls)
    off = (1.0 - hypothesis.fit.walls) * count
    return TRUST * (count + DOUBT) / (off + DOUBT)


@checks_arguments
def drawn_on(registration: Registration, hypothesis: Hypothesis, grid: OccupancyGrid) -> tuple[Cells, Ints32]:
    """The plan on a grid's cells: int8 (rows, cols) as of `Foresight`, and rooms int32 (rows, cols)."""
    fields = registration.fields
    x, y = hypothesis.placed.maps(grid.origin, grid.resolution, grid.shape)
    col = (x - np.float32(fields.low)) / np.float32(fields.cell) - np.float32(0.5)
    row = (y - np.float32(fields.low)) / np.float32(fields.cell) - np.float32(0.5)
    depth = cv2.remap(fields.depth, col, row, cv2.INTER_LINEAR, borderValue=-10.0)
    rooms = cv2.remap(fields.room_ids.astype(np.float32), col, row, cv2.INTER_NEAREST, borderValue=0.0)
    cells = np.full(grid.shape, UNKNOWN, np.int8)
    cells[depth > -WALL_DEPTH] = OCCUPIED
    cells[depth > 0] = FREE
    return cells, np.where(depth > 0, rooms.astype(np.int32), 0).astype(np.int32)


def contradicted_rooms(registration: Registration, hypothesis: Hypothesis) -> set[int]:
    """Rooms of the plan in whose middle most of what has been seen are walls."""
    fields = registration.fields
    votes = np.zeros((2, int(fields.room_ids.max()) + 1))
    walls, floor = thinned(registration.evidence.walls), thinned(registration.evidence.floor)
    for points, is_wall in ((walls, True), (floor, False)):
        row, col = _in_plan(points, registration, hypothesis)
        room = fields.room_ids[row, col]
        np.add.at(votes[0], room, 1.0)
        if is_wall:  # in the middle of a drawn room
            np.add.at(votes[1], room, (fields.to_walls[row, col] > POINT_OFF).astype(np.float64))
    many = votes[0] >= LEAST_POINTS
    wrong = many & (votes[1] > CONTRADICTED * votes[0])
    return set(np.flatnonzero(wrong).tolist()) - {0}


def rooms_apart(registration: Registration, hypothesis: Hypothesis) -> set[int]:
    """Rooms of a plan that draws its doors to which it draws no way from where the robot has been.

    Another flat, or a wing that is entered from outside: a door may be there, but the plan does not say so.
    """
    fields = registration.fields
    wing = fields.wing_of_room
    if not fields.complete or wing.max(initial=0) < 2:
        return set()
    at = _in_plan(thinned(registration.evidence.floor), registration, hypothesis)
    seen = np.bincount(fields.wings[at], minlength=int(fields.wings.max()) + 1)
    visited = seen >= max(LEAST_POINTS, LEAST_SHARE * seen[1:].sum())
    return set(np.flatnonzero((wing > 0) & ~visited[wing]).tolist()) if visited[1:].any() else set()


def _in_plan(points: Floats, registration: Registration, hypothesis: Hypothesis) -> tuple[Ints, Ints]:
    """Rows and columns int64 (m,) in the plan's fields of world points float64 (n, 2) that lie in them."""
    place = _cells_of_plan(points, registration, hypothesis)
    inside = ((place >= 0) & (place < registration.fields.free.shape[::-1])).all(axis=1)
    col, row = place[inside].T
    return row, col


def _cells_of_plan(points: Floats, registration: Registration, hypothesis: Hypothesis) -> Ints:
    """Columns and rows int64 (n, 2) in the plan's fields, or beyond them, of world points float64 (n, 2)."""
    fields = registration.fields
    return np.floor((hypothesis.placed.to_plan(points) - fields.low) / fields.cell).astype(np.int64)


def _usual_error(registration: Registration, hypothesis: Hypothesis) -> float:
    """The median distance in metres of seen walls from those of the plan."""
    fields = registration.fields
    place = _cells_of_plan(thinned(registration.evidence.walls), registration, hypothesis)
    col, row = np.clip(place, 0, np.array(fields.free.shape[::-1]) - 1).T
    return float(np.median(fields.to_walls[row, col])) * hypothesis.world_scale


def _drop_slivers(cells: Cells, grid: OccupancyGrid, radius: float) -> None:
    """Foreseen floor into which a disc (metres) does not fit: between a seen wall and its drawn twin, say."""
    if radius < grid.resolution:
        return
    hidden = (cells == FREE) & (grid.cells == UNKNOWN)
    floor: Mask = hidden | grid.free
    kernel = disc(radius / grid.resolution)
    wide = cv2.morphologyEx(floor.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    cells[hidden & ~wide] = OCCUPIED


class Compared(IntEnum):
    """What a cell is by the map and by the plan."""

    SILENT = 0
    """Neither known nor foreseen."""
    FLOOR = 1
    WALL = 2
    FORESEEN_FLOOR = 3
    FORESEEN_WALL = 4
    OTHER_FLOOR = 5
    """Seen floor that the plan draws as solid."""
    OTHER_WALL = 6
    """A seen wall where the plan draws none."""


def compared(grid: OccupancyGrid, registration: Registration) -> Bytes:
    """uint8 (rows, cols), values of `Compared`, by the best hypothesis; without any, the map alone."""
    cells = grid.cells
    codes = np.full(grid.shape, Compared.SILENT, np.uint8)
    codes[cells == FREE] = Compared.FLOOR
    codes[cells == OCCUPIED] = Compared.WALL
    if registration.hypotheses:
        drawn, _ = drawn_on(registration, registration.hypotheses[0], grid)
        unseen = cells == UNKNOWN
        codes[unseen & (drawn == FREE)] = Compared.FORESEEN_FLOOR
        codes[unseen & (drawn == OCCUPIED)] = Compared.FORESEEN_WALL
        near = in_cells(TOLERANCE, grid.resolution)
        codes[(cells == OCCUPIED) & ~with_neighbours(drawn == OCCUPIED, near)] = Compared.OTHER_WALL
        codes[(cells == FREE) & ~with_neighbours(drawn == FREE, near)] = Compared.OTHER_FLOOR
    return codes
