"""Any layout method in the loop: the partial grid is reconstructed, and its rooms judge the frontiers.

Rooms of a method with lines (IAS-15, ROSE2, `default`) are unions of faces of the lines, some of them half
seen: the faces complete them (IAS-15, section IV-C; ROSE2, section III-C). A room with a face at the border
of the lines' box is bounded by no wall there: the unknown behind it leads on (Luperto and Amigoni, AAMAS
2021). Rooms of the other methods end where the seen space ends: they reach on as far as the rooms of ROSE2's
lines do.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import shapely

from layoutexplore.errors import unknown_name
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.grids.polygons import fill
from layoutexplore.layout.frame import to_world
from layoutexplore.layout.pipeline import LayoutCache, layout_method
from layoutexplore.layout.types import OUTSIDE, Layout
from layoutexplore.options import format_value, read_value, split_pairs
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid, classes_in, with_classes
from layoutexplore.predictors.room_completion import Shape, complete_regions
from layoutexplore.predictors.seen_rooms import Regions

MARGIN = 1.5
"""Metres around what is known that a method is shown: the grid's own size would tell the building's."""

LINE_METHODS = ("default", "rose2", "ias15")
"""Methods with lines, whose faces complete the rooms."""

COMPLETIONS = ("faces", "lines", "none")
"""How half-seen rooms are completed: by the method's own faces, by rooms of ROSE2's lines, or not at all."""


class ReconstructedRooms(RoomsOnGrid):
    """The rooms of a layout on the grid of a decision, completed when they are first asked for.

    Args:
        grid: What the robot knows; its cells are not copied.
        layout: Its layout; with `outlines`, one of an earlier state with the same walls will do.
        outlines: Room ids, each with a polygon in the world that tells how far the room reaches. Without
            them, rooms are what is seen of them.
        unbounded: Ids of the outlines that no wall bounds on some side.
        follow: Whether seen cells, too, belong to the room whose outline holds them; else to the room that
            the layout gives them, and an outline to the room that has most of its seen cells.

    """

    def __init__(
        self,
        grid: OccupancyGrid,
        layout: Layout,
        outlines: Sequence[tuple[int, shapely.Polygon]] = (),
        unbounded: Iterable[int] = (),
        *,
        follow: bool = True,
    ) -> None:
        super().__init__(layout.method, grid)
        self._layout, self._outlines, self._unbounded, self._follow = layout, outlines, unbounded, follow

    @cached_property
    def _count(self) -> int:
        """The highest room id."""
        return max((room.id for room in self._layout.rooms), default=0)

    @cached_property
    def rooms(self) -> RoomLabels:
        """The completed rooms, and the unseen rest of the building as one more."""
        cells = self._grid.cells
        reach, unbounded = self._painted(), set(self._unbounded)
        if self._follow and self._outlines:
            seen = np.where(cells == FREE, reach, np.int32(0))
        else:
            seen = _on_grid(self._layout, self._grid)
            owner = _owners(reach, seen)
            reach, unbounded = owner[reach], {int(owner[k]) for k in unbounded}
        regions = Regions(seen, self._count, np.zeros(cells.shape, np.float32))
        completed = complete_regions(cells, regions, _unknown_parts(reach, cells))
        return _opened(completed, cells, np.array(sorted(unbounded - {0}), np.int32))

    def _painted(self) -> Ints32:
        """int32 (rows, cols): the outline that holds each cell's centre, seen or not, 0 for none."""
        painted = np.zeros(self._grid.shape, np.int32)
        for k, polygon in self._outlines:
            fill(painted, _to_local(polygon, self._grid.origin), k, self._grid.resolution, (0.0, 0.0))
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
        self._completion = completion or ("faces" if method in LINE_METHODS else "lines")
        if self._completion not in COMPLETIONS:
            raise unknown_name("completion of rooms", self._completion, COMPLETIONS)
        # Lines stay as they are until a wall changes; rooms that are labels of free cells change with any.
        self._layouts = LayoutCache(method, options or None, exact=self._completion != "faces")
        self._lines = LayoutCache("rose2")

    def predict(self, decision: Decision) -> Decision:
        """The decision with the classes that follow from the rooms, and these."""
        if not decision.frontiers:
            return decision
        found = self._reconstruct(decision.grid)
        classes = classes_in(found.rooms, decision)
        return with_classes(decision, classes, found)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The completed rooms."""
        return self._reconstruct(decision.grid).rooms

    def _reconstruct(self, grid: OccupancyGrid) -> ReconstructedRooms:
        part = known_part(grid, walls=self._completion == "faces")
        layout = self._layouts(part)
        if self._completion == "faces":
            outlines = [(face.room, face.polygon) for face in layout.faces if face.room > 0]
            at_border = {
                face.room for face in layout.faces if any(e.neighbour == OUTSIDE for e in face.edges)
            }
            return ReconstructedRooms(grid, layout, outlines, at_border)
        lines = self._lines(known_part(grid, walls=True)).rooms if self._completion == "lines" else ()
        outlines = [(room.id, room.polygon) for room in lines]
        unbounded = [room.id for room in lines if not room.is_closed]
        return ReconstructedRooms(grid, layout, outlines, unbounded, follow=False)


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


def known_part(grid: OccupancyGrid, *, walls: bool = False) -> OccupancyGrid:
    """What is known of a grid, in the same world, with a margin around it that is unknown beyond the grid.

    Args:
        grid: The grid.
        walls: Only the part around occupied cells; it stays the same while these do.
    """
    known = np.where(grid.cells == OCCUPIED, grid.cells, UNKNOWN) if walls else grid.cells
    margin = round(MARGIN / grid.resolution)
    row0, row1, col0, col1 = known_box(known)
    padded = np.pad(grid.cells, margin, constant_values=UNKNOWN)
    cells = np.ascontiguousarray(padded[row0 : row1 + 2 * margin, col0 : col1 + 2 * margin])
    corner = np.array([[col0 - margin, row0 - margin]]) * grid.resolution
    ((x, y),) = to_world(corner, grid.origin).tolist()
    return OccupancyGrid(cells, grid.resolution, Pose(x, y, grid.origin.theta))


def _to_local(polygon: shapely.Polygon, origin: Pose) -> shapely.Polygon:
    """A polygon of the world in metres of the grid's own frame."""
    c, s = np.cos(origin.theta), np.sin(origin.theta)
    turn = np.array([[c, -s], [s, c]])
    return shapely.transform(polygon, lambda points: (points - (origin.x, origin.y)) @ turn)


def _on_grid(layout: Layout, grid: OccupancyGrid) -> Ints32:
    """The rooms that a layout gives the free cells of a grid, int32 (rows, cols), 0 for none."""
    labels = np.zeros(grid.shape, np.int32)
    rows, cols = np.nonzero(grid.cells == FREE)
    at = layout.clean_grid.world_to_cells(grid.cells_to_world(np.stack([rows, cols], axis=1)))
    inside = ((at >= 0) & (at < layout.labels.shape)).all(axis=1)
    labels[rows[inside], cols[inside]] = layout.labels[at[inside, 0], at[inside, 1]]
    return labels


def _owners(reach: Ints32, seen: Ints32) -> Ints32:
    """int32 (outlines + 1,): the room that most seen cells of each outline belong to, 0 where none does."""
    both = (reach > 0) & (seen > 0)
    rooms = int(seen.max(initial=0)) + 1
    pairs = reach[both].astype(np.int64) * rooms + seen[both]
    counts = np.bincount(pairs, minlength=(int(reach.max(initial=0)) + 1) * rooms).reshape(-1, rooms)
    return np.where(counts.any(axis=1), counts.argmax(axis=1), 0).astype(np.int32)


def _unknown_parts(painted: Ints32, cells: Cells) -> dict[int, Shape]:
    """The window of each room that has unknown cells, with its mask."""
    shapes = {}
    hidden = np.where(cells == UNKNOWN, painted, 0)
    for room in np.unique(hidden[hidden > 0]).tolist():
        mask = painted == room
        rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        window = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        shapes[int(room)] = Shape(int(rows[0]), int(cols[0]), mask[window])
    return shapes


def _opened(rooms: RoomLabels, cells: Cells, unbounded: Ints32) -> RoomLabels:
    """Rooms without the walls that would close those which nothing bounds.

    Args:
        rooms: Completed rooms; the unseen rest is one of them.
        cells: int8 (rows, cols), what is known.
        unbounded: Ids of the rooms that reach the border of the lines' box.
    """
    if not len(unbounded):
        return rooms
    wall = (cells == UNKNOWN) & ~rooms.passable
    claimed = (cells == UNKNOWN) & (rooms.room_ids > 0) & rooms.passable
    of_open = claimed & np.isin(rooms.room_ids, unbounded)
    of_closed = claimed & ~of_open & (rooms.room_ids != rooms.rest)
    kernel = np.ones((3, 3), np.uint8)
    gone = (
        wall
        & (cv2.dilate(of_open.view(np.uint8), kernel) > 0)
        & (cv2.dilate(of_closed.view(np.uint8), kernel) == 0)
    )
    return RoomLabels(
        np.where(gone, rooms.rest, rooms.room_ids), (rooms.passable | gone) & (cells != OCCUPIED), rooms.rest
    )
