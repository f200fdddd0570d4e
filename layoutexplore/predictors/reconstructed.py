"""Any layout method in the loop: the partial grid is reconstructed, and its rooms judge the frontiers.

Rooms of a method with lines (IAS-15, ROSE2, `default`) are unions of faces of the lines, some of them half
seen: the faces complete them (IAS-15, section IV-C; ROSE2, section III-C). A room with a face at the border
of the lines' box is bounded by no wall there: the unknown behind it leads on (Luperto, Fochetta and Amigoni,
AAMAS 2021). Rooms of the other methods end where the seen space ends: they reach on as far as the rooms of
ROSE2's lines do.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError, UnknownNameError, checks_calls, checks_making, unknown_name
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Cells, Ints32, Mask
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.layout.pipeline import LayoutCache, layout_method
from layoutexplore.layout.types import Layout
from layoutexplore.metrics.overlaps import most_shared
from layoutexplore.options import format_value, read_value, split_pairs
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid, classes_in, with_classes
from layoutexplore.predictors.room_completion import complete_within
from layoutexplore.predictors.seen_regions import known_part, labels_on_grid, placed

LINE_METHODS = ("default", "rose2", "ias15")
"""Methods with lines, whose faces complete the rooms."""

COMPLETIONS = ("faces", "lines", "none")
"""How half-seen rooms are completed: by the method's own faces, by rooms of ROSE2's lines, or not at all."""

GROWTH = 0.01
"""Lines are kept until the known walls have changed by this share of them."""


@checks_making
class ReconstructedRooms(RoomsOnGrid):
    """The rooms of a layout on the grid of a decision, completed when they are first asked for.

    Args:
        grid: What the robot knows; its cells are not copied.
        layout: Its layout; where its faces complete the rooms, one of an earlier state with the same walls
            will do.
        lines: The layout of which the faces tell how far the rooms reach, the same one or another; a room at
            the border of the lines' box is bounded by no wall there. Without it, rooms are what is seen of
            them.

    """

    def __init__(self, grid: OccupancyGrid, layout: Layout, lines: Layout | None = None) -> None:
        super().__init__(layout.method, grid)
        self._layout, self._lines = layout, lines

    @cached_property
    def rooms(self) -> RoomLabels:
        """The completed rooms, and the unseen rest of the building as one more."""
        cells = self._grid.cells
        reach, at_border = self._reach()
        if self._lines is self._layout and reach.any():
            # Seen cells, too, belong to the room whose faces hold them, whatever has been seen since.
            seen = np.where(cells == FREE, reach, np.int32(0))
        else:
            seen = labels_on_grid(self._layout, self._grid)
            reach, at_border = _by_owner(reach, at_border, seen)
        rest = max(int(self._layout.labels.max(initial=0)), len(at_border) - 1) + 1
        return _opened(complete_within(cells, seen, reach, rest), cells, at_border)

    def _reach(self) -> tuple[Ints32, Mask]:
        """The room of the lines that holds each cell, seen or not; and by room if nothing bounds it."""
        found = None if self._lines is None else self._lines.room_reach
        if self._lines is None or found is None:
            return np.zeros(self._grid.shape, np.int32), np.zeros(1, np.bool_)
        return placed(found.labels, self._lines.clean_grid, self._grid), found.at_border

    @property
    def layout(self) -> Layout:
        """As given."""
        return self._layout


@checks_calls
class ReconstructedPredictor:
    """Frontiers judged by the rooms that a layout method finds on the partial grid.

    Args:
        method: A method of `layoutexplore.layout.pipeline.reconstruct`.
        completion: How half-seen rooms are completed; empty for "faces" with methods of lines, "lines" with
            others.
        growth: Lines are kept until more occupied cells than this share of them have changed; with 0 they are
            found anew as soon as one has.
        options: Options of the method to change.

    Raises:
        UnknownNameError: No such method, option or completion.
        ConfigError: An option's value makes no sense.
    """

    remembers = True
    """Lines that are kept are those of an earlier decision."""

    def __init__(self, method: str, completion: str = "", growth: float = GROWTH, **options: Any) -> None:
        given: dict[str, Any] = {"completion": completion} if completion else {}
        given |= ({"growth": growth} if growth != GROWTH else {}) | options
        self.name = ";".join([f"reconstruct:{method}", *(f"{k}={format_value(v)}" for k, v in given.items())])
        self._completion = completion or ("faces" if layout_method(method).name in LINE_METHODS else "lines")
        if self._completion not in COMPLETIONS:
            raise unknown_name("completion of rooms", self._completion, COMPLETIONS)
        # Lines stay as they are until walls change; rooms that are labels of free cells change with any cell.
        exact = self._completion != "faces"
        self._layouts = LayoutCache(method, options or None, exact=exact, growth=growth)
        self._lines = LayoutCache("rose2", growth=growth)
        self.fingerprint = self._layouts.method.digest

    def predict(self, decision: Decision) -> Decision:
        """The decision with the classes that follow from the rooms, and these."""
        if not decision.frontiers:
            return decision
        found = self._reconstruct(decision.grid)
        return with_classes(decision, classes_in(found.rooms, decision), found)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The completed rooms."""
        return self._reconstruct(decision.grid).rooms

    def _reconstruct(self, grid: OccupancyGrid) -> ReconstructedRooms:
        own = self._completion == "faces"
        layout = self._layouts(grid, lambda: known_part(grid, walls=own))
        if self._completion == "none":
            return ReconstructedRooms(grid, layout)
        lines = layout if own else self._lines(grid, lambda: known_part(grid, walls=True))
        return ReconstructedRooms(grid, layout, lines)


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
    known: dict[str, Any] = {"completion": "", "growth": GROWTH}
    known |= dataclasses.asdict(layout_method(method).config())
    where, options = f"predictor reconstruct:{text}", dict[str, Any]()
    for key, value in split_pairs(where, items).items():
        if key not in known:
            raise unknown_name(f"option of the {method} method", key, [*known])
        options[key] = read_value(f"{where}: {key}", known[key], value)
    try:
        return ReconstructedPredictor(method, **options)
    except UnknownNameError:
        raise
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _by_owner(reach: Ints32, at_border: Mask, seen: Ints32) -> tuple[Ints32, Mask]:
    """Reach and borders in the ids of the seen rooms: that of which most seen cells lie in a room's reach.

    A room of the lines of which no cell is seen is in none.
    """
    both = (reach > 0) & (seen > 0)
    owner = most_shared(reach[both], seen[both], count=len(at_border))[0].astype(np.int32)
    at_border_of_seen = np.zeros(int(seen.max(initial=0)) + 1, np.bool_)
    at_border_of_seen[owner[at_border]] = True
    at_border_of_seen[0] = False
    return owner[reach], at_border_of_seen


def _opened(rooms: RoomLabels, cells: Cells, unbounded: Mask) -> RoomLabels:
    """Rooms without the walls that would close those which nothing bounds.

    Args:
        rooms: Completed rooms; the unseen rest is one of them.
        cells: int8 (rows, cols), what is known.
        unbounded: bool (k,), by id, at most that of the rest: the room reaches the border of the lines' box.
    """
    if not unbounded.any():
        return rooms
    is_open = np.zeros(rooms.rest + 1, np.bool_)
    is_open[: len(unbounded)] = unbounded
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
