"""Any layout method in the loop: the partial grid is reconstructed, and its rooms judge the frontiers.

Rooms of a method with lines (IAS-15, ROSE2, `default`) are unions of faces of the lines, some of them half
seen: the faces complete them (IAS-15, section IV-C; ROSE2, section III-C). A room with a face at the border
of the lines' box is bounded by no wall there: the unknown behind it leads on (Luperto and Amigoni, AAMAS
2021). Rooms of the other methods end where the seen space ends: they reach on as far as the rooms of ROSE2's
lines do.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import unknown_name
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Cells, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.grids.polygons import fill_each
from layoutexplore.layout.doorways import Regions
from layoutexplore.layout.pipeline import LayoutCache, layout_method
from layoutexplore.layout.types import NO_FACES, Layout, RoomFaces
from layoutexplore.options import format_value, read_value, split_pairs
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid, classes_in, with_classes
from layoutexplore.predictors.room_completion import Shape, complete_regions
from layoutexplore.predictors.seen_regions import known_part, labels_on_grid

LINE_METHODS = ("default", "rose2", "ias15")
"""Methods with lines, whose faces complete the rooms."""

COMPLETIONS = ("faces", "lines", "none")
"""How half-seen rooms are completed: by the method's own faces, by rooms of ROSE2's lines, or not at all."""


class ReconstructedRooms(RoomsOnGrid):
    """The rooms of a layout on the grid of a decision, completed when they are first asked for.

    Args:
        grid: What the robot knows; its cells are not copied.
        layout: Its layout; with `outlines`, one of an earlier state with the same walls will do.
        outlines: Polygons that tell how far the rooms reach; one at the border of the lines' box is bounded
            by no wall there. Without any, rooms are what is seen of them.
        follow: Whether seen cells, too, belong to the room whose outline holds them; else to the room that
            the layout gives them, and an outline to the room that has most of its seen cells.

    """

    def __init__(
        self, grid: OccupancyGrid, layout: Layout, outlines: RoomFaces = NO_FACES, *, follow: bool = True
    ) -> None:
        super().__init__(layout.method, grid)
        self._layout, self._outlines, self._follow = layout, outlines, follow

    @cached_property
    def rooms(self) -> RoomLabels:
        """The completed rooms, and the unseen rest of the building as one more."""
        cells = self._grid.cells
        reach = self._painted()
        unbounded = np.unique(self._outlines.room[self._outlines.at_border])
        if self._follow and len(self._outlines.room):
            seen = np.where(cells == FREE, reach, np.int32(0))
        else:
            seen = labels_on_grid(self._layout, self._grid)
            owner = _owners(reach, seen)
            # An outline of which no cell is seen is in no room, nor is one that holds no cell's centre.
            reach, unbounded = owner[reach], owner[unbounded[unbounded < len(owner)]].astype(np.int64)
        count = max((room.id for room in self._layout.rooms), default=0)
        regions = Regions(seen, count, np.zeros(cells.shape, np.float32))
        completed = complete_regions(cells, regions, _unknown_parts(reach, cells))
        return _opened(completed, cells, unbounded[unbounded > 0])

    def _painted(self) -> Ints32:
        """int32 (rows, cols): the outline that holds each cell's centre, seen or not, 0 for none."""
        painted = np.zeros(self._grid.shape, np.int32)
        polygons = _to_local(self._outlines.polygons, self._grid.origin)
        fill_each(painted, polygons, self._outlines.room, self._grid.resolution, (0.0, 0.0))
        return painted

    @property
    def layout(self) -> Layout:
        """As given."""
        return self._layout


class ReconstructedPredictor:
    """Frontiers judged by the rooms that a layout method finds on the partial grid.

    Args:
        method: A method of `layoutexplore.layout.pipeline.reconstruct`.
        completion: How half-seen rooms are completed; empty for "faces" with methods of lines, "lines" with
            others.
        options: Options of the method to change.

    Raises:
        UnknownNameError: No such method, option or completion.
        ConfigError: An option's value makes no sense.
    """

    def __init__(self, method: str, completion: str = "", **options: Any) -> None:
        given = {"completion": completion, **options} if completion else options
        self.name = ";".join([f"reconstruct:{method}", *(f"{k}={format_value(v)}" for k, v in given.items())])
        self._completion = completion or ("faces" if layout_method(method).name in LINE_METHODS else "lines")
        if self._completion not in COMPLETIONS:
            raise unknown_name("completion of rooms", self._completion, COMPLETIONS)
        # Lines stay as they are until a wall changes; rooms that are labels of free cells change with any.
        self._layouts = LayoutCache(method, options or None, exact=self._completion != "faces")
        self._lines = LayoutCache("rose2")
        self.fingerprint = self._layouts.method.digest

    def predict(self, decision: Decision) -> Decision:
        """The decision with the classes that follow from the rooms, and these."""
        if not decision.frontiers:
            return decision
        found = self._reconstruct(decision.grid)
        classes = classes_in(found.rooms, decision)
        # The unseen rest of the building ends where the array does: of it, what is in sight can be expected.
        beyond = classes.room == found.rooms.rest
        area = np.where(beyond, decision.table.visible_area, classes.remaining_area)
        return with_classes(decision, dataclasses.replace(classes, remaining_area=area), found)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The completed rooms."""
        return self._reconstruct(decision.grid).rooms

    def _reconstruct(self, grid: OccupancyGrid) -> ReconstructedRooms:
        part = known_part(grid, walls=self._completion == "faces")
        layout = self._layouts(part)
        if self._completion == "faces":
            return ReconstructedRooms(grid, layout, layout.room_faces)
        lines = self._lines(known_part(grid, walls=True)).rooms if self._completion == "lines" else ()
        outlines = RoomFaces(
            np.array([room.polygon for room in lines], np.object_),
            np.array([room.id for room in lines], np.int64),
            np.array([not room.is_closed for room in lines], np.bool_),
        )
        return ReconstructedRooms(grid, layout, outlines, follow=False)


def predictor_of_method(text: str) -> ReconstructedPredictor:
    """The predictor of `METHOD` or `METHOD;key=value;...`.

    Commas do as well where the text does not stand inside another spec, such as an agent's.

    Raises:
        UnknownNameError: No such method, option or completion.
        ConfigError: The text is not of that form, or a value makes no sense.

    Example:
        >>> predictor_of_method("rose2,sigma=0.20").name
        'reconstruct:rose2;sigma=0.2'
    """
    method, *items = (item.strip() for item in text.replace(",", ";").split(";"))
    known: dict[str, Any] = dataclasses.asdict(layout_method(method).config())
    where, options = f"predictor reconstruct:{text}", dict[str, Any]()
    for key, value in split_pairs(where, items).items():
        if key != "completion" and key not in known:
            raise unknown_name(f"option of the {method} method", key, ["completion", *known])
        options[key] = read_value(f"{where}: {key}", known.get(key, ""), value)
    return ReconstructedPredictor(method, **options)


def _to_local(polygons: NDArray[np.object_], origin: Pose) -> NDArray[np.object_]:
    """Polygons (n,) of the world in metres of the grid's own frame."""
    c, s = np.cos(origin.theta), np.sin(origin.theta)
    turn = np.array([[c, -s], [s, c]])
    moved: Any = shapely.transform(polygons, lambda points: (points - (origin.x, origin.y)) @ turn)
    return np.asarray(moved, np.object_)


def _owners(reach: Ints32, seen: Ints32) -> Ints32:
    """int32 (outlines + 1,): the room that most seen cells of each outline belong to, 0 where none does."""
    both = (reach > 0) & (seen > 0)
    rooms = int(seen.max(initial=0)) + 1
    pairs = reach[both].astype(np.int64) * rooms + seen[both]
    counts = np.bincount(pairs, minlength=(int(reach.max(initial=0)) + 1) * rooms).reshape(-1, rooms)
    return np.where(counts.any(axis=1), counts.argmax(axis=1), 0).astype(np.int32)


def _unknown_parts(painted: Ints32, cells: Cells) -> dict[int, Shape]:
    """The window of each room that has unknown cells, with its mask."""
    boxes, hidden = _boxes(painted, cells, int(painted.max(initial=0)) + 1)
    shapes = {}
    for room in np.flatnonzero(hidden).tolist():
        row0, row1, col0, col1 = boxes[room].tolist()
        shapes[room] = Shape(row0, col0, painted[row0:row1, col0:col1] == room)
    return shapes


@njit(cache=True, nogil=True)
def _boxes(painted: Ints32, cells: Cells, count: int) -> tuple[Ints, Mask]:
    """Per room its half-open box int64 (row0, row1, col0, col1), and whether it has unknown cells."""
    rows, cols = painted.shape
    boxes, hidden = np.zeros((count, 4), np.int64), np.zeros(count, np.bool_)
    boxes[:, 0], boxes[:, 2] = rows, cols
    for r in range(rows):
        for c in range(cols):
            k = painted[r, c]
            if k:  # 0 is no room
                box = boxes[k]
                box[0], box[1] = min(box[0], r), r + 1
                box[2], box[3] = min(box[2], c), max(box[3], c + 1)
                hidden[k] |= cells[r, c] == UNKNOWN
    return boxes, hidden


def _opened(rooms: RoomLabels, cells: Cells, unbounded: Ints) -> RoomLabels:
    """Rooms without the walls that would close those which nothing bounds.

    Args:
        rooms: Completed rooms; the unseen rest is one of them.
        cells: int8 (rows, cols), what is known.
        unbounded: int64 (k,), ids of the rooms that reach the border of the lines' box.
    """
    if not len(unbounded):
        return rooms
    is_open = np.zeros(rooms.rest + 1, np.bool_)
    is_open[unbounded] = True
    ids, passable = rooms.room_ids.copy(), rooms.passable.copy()
    _open_walls(cells, rooms.room_ids, rooms.passable, is_open, (ids, passable))
    return RoomLabels(ids, passable, rooms.rest)


@njit(cache=True, nogil=True)
def _open_walls(
    cells: Cells, room_ids: Ints32, passable: Mask, is_open: Mask, out: tuple[Ints32, Mask]
) -> None:
    """Make predicted walls beside unseen cells of open rooms, and of no closed one, part of the rest."""
    rows, cols = cells.shape
    rest = len(is_open) - 1
    ids, free = out
    for r in range(rows):
        for c in range(cols):
            if cells[r, c] != UNKNOWN or passable[r, c]:
                continue
            # only what was predicted counts: seen cells of a room have no predicted wall
            beside_open = beside_closed = False
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, cols)):
                    if cells[i, j] == UNKNOWN and passable[i, j] and room_ids[i, j] > 0:
                        beside_open |= is_open[room_ids[i, j]]
                        beside_closed |= not is_open[room_ids[i, j]] and room_ids[i, j] != rest
            if beside_open and not beside_closed:
                ids[r, c], free[r, c] = rest, True
