"""Details of merged layouts, computed when asked for: scores, lines, faces that follow the rooms.

The rooms come from regions of free space and not from lines, so nothing of this is needed to find them. The
representative lines are those of the walls of the map without its clutter (ROSE2, section III-B), and where a
room ends far from all of them, a line of its own. A cell of their arrangement belongs to the room that most
of its labelled grid cells have; cells of one room make one face where the line between them is hardly
covered.
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats32, Ints, Ints32, shows_shapes
from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.limits import cells_at_most, most_lines
from layoutexplore.layout.lines.assemble import FaceDetails
from layoutexplore.layout.lines.declutter import DeclutterConfig, find_structure
from layoutexplore.layout.lines.face_clusters import dissolve
from layoutexplore.layout.lines.face_model import (
    FaceConfig,
    WallModel,
    arrange_lines,
    face_model,
    open_edges,
    seen_region,
    with_lines,
)
from layoutexplore.layout.lines.face_outlines import paint_faces
from layoutexplore.layout.lines.segments import angle_between
from layoutexplore.layout.lines.topology import quantile_extent
from layoutexplore.layout.types import Details, Face, Line, RoomReach

LINE_DISTANCE = 0.4
"""A room that ends farther than this from every line gets a line of its own [m]."""

SAMPLE = 0.1
"""Distance of the cells that a room's extent is measured on [m]."""


LARGEST_TABLE = 2**23
"""The table of faces and rooms has at most so many entries; larger ones are not made."""


@shows_shapes
@dataclass(frozen=True, eq=False)
class MergingDetails(Details):
    """Lines, faces and scores of a layout of the method `default`, computed when they are first asked for.

    Attributes:
        clean_grid: The grid without its clutter.
        clutter: int64 (n,), flat indices of the cells that the clutter occupies.
        labels: int32 (rows, cols), the rooms.
        model: Walls and lines of the clean grid; None where there is no wall.
        config: When a line parts two faces.
    """

    clean_grid: OccupancyGrid
    clutter: Ints
    labels: Ints32
    model: WallModel | None
    config: FaceConfig

    @cached_property
    def cell_scores(self) -> Floats32:
        """ROSE's score of the surfaces of everything occupied, clutter too; 0 elsewhere."""
        cells = self.clean_grid.cells.copy()
        cells.reshape(-1)[self.clutter] = OCCUPIED
        return find_structure(surfaces(cells), self.clean_grid.resolution, DeclutterConfig()).cell_scores

    @cached_property
    def _found(self) -> Details:
        if self.model is None:
            return Details()
        model = with_room_lines(self.clean_grid, self.model, self.labels, LINE_DISTANCE)
        return faces_of_labels(self.clean_grid, model, self.labels, self.config)

    @property
    def lines(self) -> tuple[Line, ...]:
        """Representative lines, the box's border last."""
        return self._found.lines

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces, by id."""
        return self._found.faces

    @property
    def room_reach(self) -> RoomReach | None:
        """The cells of the rooms' faces; None where there is no wall."""
        return self._found.room_reach

    def faces_of(self, room: int) -> tuple[int, ...]:
        """Indices of the faces of a room, rising."""
        return self._found.faces_of(room)


def with_room_lines(grid: OccupancyGrid, model: WallModel, labels: Ints32, distance: float) -> WallModel:
    """The lines, and the sides of each room's smallest box that lie farther than this from all others.

    Args:
        grid: The grid.
        model: Its lines; the boxes have their directions.
        labels: int32 (rows, cols), rooms from 1, 0 for none.
        distance: Between parallel lines [m].
    """
    step = cells_at_most(SAMPLE, grid.resolution, max(grid.shape))
    of_cell, rows, cols = _labelled(labels, step)
    if not len(of_cell):
        return model
    x, y = (cols + 0.5) * grid.resolution, (rows + 0.5) * grid.resolution
    present = np.bincount(of_cell) > 0
    rank, count = (np.cumsum(present) - 1)[of_cell], int(present.sum())
    angles = model.aligned.directions
    extents = [quantile_extent(y * np.cos(a) - x * np.sin(a), rank, count, 0.01) for a in angles]
    low, high = (np.stack([extent[i] for extent in extents]) for i in (0, 1))
    across = angle_between(angles[:, None] + np.pi / 2, angles[None, :])
    partner = across.argmin(axis=1)
    best = ((high - low) * (high - low)[partner]).argmin(axis=0)
    lines = [np.sort(model.lines.offset[model.lines.direction == d]).tolist() for d in range(len(angles))]
    new: list[tuple[int, float]] = []
    most = most_lines(grid.shape)
    for room, first in enumerate(best.tolist()):
        if len(model.lines) + len(new) >= most:
            break
        for d in (first, int(partner[first])):
            for t in (float(low[d, room]), float(high[d, room])):
                place = bisect.bisect(lines[d], t)
                if all(abs(beside - t) > distance for beside in lines[d][max(place - 1, 0) : place + 1]):
                    lines[d].insert(place, t)
                    new.append((d, t))
    direction = np.array([d for d, _ in new], np.int64)
    offset = np.array([t for _, t in new], np.float64)
    return replace(model, lines=with_lines(model.lines, direction, offset, most))


@njit(cache=True, nogil=True)
def _labelled(labels: Ints32, step: int) -> tuple[Ints, Ints, Ints]:
    """Of the cells with a label in every so many rows and columns: labels, rows and columns, int64 (n,)."""
    rows, cols = labels.shape
    found = np.empty((3, ((rows - 1) // step + 1) * ((cols - 1) // step + 1)), np.int64)
    count = 0
    for r in range(0, rows, step):
        for c in range(0, cols, step):
            found[0, count], found[1, count], found[2, count] = labels[r, c], r, c
            count += labels[r, c] != 0  # what has none is written over
    return found[0, :count], found[1, :count], found[2, :count]


def faces_of_labels(grid: OccupancyGrid, model: WallModel, labels: Ints32, config: FaceConfig) -> FaceDetails:
    """The faces of a map's lines, each in the room that most of its labelled cells have.

    Args:
        grid: The grid without clutter.
        model: Its lines.
        labels: int32 (rows, cols), rooms from 1, 0 for none.
        config: Which edges part faces, and which faces are external: those are in no room.
    """
    arrangement = arrange_lines(grid, model, config.margin)
    painted = paint_faces(arrangement, grid.shape, grid.resolution)
    count, rooms = len(arrangement), int(labels.max(initial=0)) + 1
    owners = _owners if count * rooms <= LARGEST_TABLE else _owners_by_sorting
    owner = owners(painted, np.ascontiguousarray(labels), count, rooms, config.inside_share)
    covered, weight, is_open = open_edges(arrangement, model, config)
    left, right = arrangement.sides.T
    group, count = dissolve(arrangement, is_open & (owner[left] == owner[right]))
    region = seen_region(grid, config.region_area)
    faces = face_model(grid, arrangement, covered, weight, group, region, config, painted)
    room = np.zeros(count, np.int64)
    room[group] = owner
    return FaceDetails(model, faces, np.where(faces.kind > 0, room, 0) - 1, grid.origin, rooms - 1)


@njit(cache=True, nogil=True)
def _owners(painted: Ints32, labels: Ints32, count: int, rooms: int, least: float) -> Ints:
    """The commonest label of each cell of the arrangement; 0 where less than `least` of it is labelled."""
    # column 0 counts cells without a label: a cell of the arrangement outside of all rooms has no owner
    total = np.zeros(count, np.int64)
    table = np.zeros((count, rooms), np.int32)
    for r in range(painted.shape[0]):
        for c in range(painted.shape[1]):
            if painted[r, c] >= 0:
                total[painted[r, c]] += 1
                table[painted[r, c], labels[r, c]] += 1
    out = np.zeros(count, np.int64)
    for k in range(count):
        if total[k] > 0 and total[k] - table[k, 0] >= least * total[k]:
            best = 1
            for room in range(2, rooms):
                if table[k, room] > table[k, best]:
                    best = room
            out[k] = best
    return out


def _owners_by_sorting(painted: Ints32, labels: Ints32, count: int, rooms: int, least: float) -> Ints:
    """What `_owners` finds, without a table of all cells of the arrangement and all rooms."""
    inside = painted >= 0
    key, number = np.unique(painted[inside].astype(np.int64) * rooms + labels[inside], return_counts=True)
    face, room = np.divmod(key, rooms)
    total = np.bincount(face, number, count)
    labelled = room > 0
    face, room, number = face[labelled], room[labelled], number[labelled]
    order = np.lexsort((room, -number, face))
    order = order[np.concatenate(([True], np.diff(face[order]) > 0))] if len(order) else order
    out = np.zeros(count, np.int64)
    out[face[order]] = room[order]
    enough = (total > 0) & (np.bincount(face, number, count) >= least * total)
    return np.where(enough, out, 0)
