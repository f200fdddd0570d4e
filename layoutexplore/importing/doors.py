"""Wider doors, for thick walls of recorded maps leave hardly two thirds of one of 0.9 m; and new ones."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import shapely
from shapely import LineString, Polygon

from layoutexplore.errors import ConfigError, MapWarning, checks_arguments, counted
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan

NARROWEST, WIDEST = 0.35, 3.0
"""Metres: what is narrower is a gap of the map and no door, and stays; none is made wider than this."""

STEP = 0.03
"""Metres in which a door grows."""

LEAST_GAP = 0.01
"""Metres; what is narrower than twice this is no way through a wall."""

TOUCH = 0.06
"""A door keeps so far from rooms that it does not join [m]."""


@checks_arguments
def widen_doors(plan: FloorPlan, width: float) -> FloorPlan:
    """A floor plan with wider doors; each grows along its wall, at both ends where there is room at both.

    Args:
        plan: The floor plan.
        width: Metres; narrower doors (of `NARROWEST` and more) become as wide, or as wide as other rooms than
            those that they join leave room for.

    Raises:
        ConfigError: No door is so wide.
    """
    if not NARROWEST <= width <= WIDEST:
        raise ConfigError(f"doors are widened to {NARROWEST} to {WIDEST} m, got {width:g}")
    others = _Others(plan)
    doors = [
        _widened(door, width - door.width, others) if NARROWEST <= door.width < width else door
        for door in plan.doors
    ]
    grown = [plan.opening(new) for new, old in zip(doors, plan.doors, strict=True) if new is not old]
    cut = shapely.union_all(grown)
    return replace(
        plan,
        doors=tuple(doors),
        walls=plan.walls.difference(cut),
        passages=shapely.union_all([plan.passages, *polygons_of(plan.walls.intersection(cut))]),
        source=None,
    )


@checks_arguments
def through_walls(plan: FloorPlan) -> FloorPlan:
    """The plan with doors cut through its walls that these shut or narrow, as somebody has drawn them.

    Warns:
        MapWarning: How many there were.
    """
    rooms = {room.id: room.polygon for room in plan.rooms}
    shut = [
        door
        for door in plan.doors
        if door.is_open and not _is_clear(door, plan, [rooms[k] for k in door.rooms if k in rooms])
    ]
    if not shut:
        return plan
    warnings.warn(
        f"{plan.file or plan.name}: {counted(len(shut), 'door')} had no gap as wide in the walls, which are "
        "cut there now",
        MapWarning,
        stacklevel=2,
    )
    cut = shapely.union_all([plan.opening(door) for door in shut])
    return replace(plan, walls=plan.walls.difference(cut))


def _is_clear(door: Door, plan: FloorPlan, rooms: list[Polygon]) -> bool:
    """Whether walls leave a way as wide as a door between its rooms; one far from them counts as clear."""
    opening = plan.opening(door)
    if not all(opening.intersects(room) for room in rooms):
        return True
    walls = shapely.clip_by_rect(plan.walls, *opening.bounds)  # thousands of doors may share one wall
    walls = walls if walls.is_valid else plan.walls
    if 0 not in door.rooms and LineString([door.start, door.end]).intersection(walls).length > TOUCH:
        return False
    left = opening.difference(walls).buffer(-LEAST_GAP)
    parts = polygons_of(left.buffer(LEAST_GAP))
    return any(all(part.dwithin(room, LEAST_GAP) for room in rooms) for part in parts)


class _Others:
    """The rooms that a door does not join."""

    def __init__(self, plan: FloorPlan) -> None:
        self._plan, self._ids = plan, np.array([room.id for room in plan.rooms])
        self._tree = shapely.STRtree([room.polygon for room in plan.rooms])

    def are_apart(self, new: Door, old: Door) -> bool:
        """Whether what a door has grown by keeps away from them."""
        strip = self._plan.opening(new).difference(self._plan.opening(old))
        near = self._ids[self._tree.query(strip, "dwithin", distance=TOUCH)]
        return set(near.tolist()) <= set(old.rooms)


def _widened(door: Door, need: float, others: _Others) -> Door:
    """A door that has grown by so many metres, or by less."""
    steps = np.append(np.arange(0.0, need, STEP), need)[::-1].tolist()
    before = next((s for s in steps if others.are_apart(_grown(door, s, 0.0), door)), 0.0)
    after = next((s for s in steps if others.are_apart(_grown(door, 0.0, s), door)), 0.0)
    first = min(before, max(need / 2, need - after))
    last = min(after, need - first)
    return _grown(door, first, last) if first + last > 0 else door


def _grown(door: Door, before: float, after: float) -> Door:
    """A door that begins so many metres before, and ends so many after."""
    (x0, y0), (x1, y1) = door.start, door.end
    along = ((x1 - x0) / door.width, (y1 - y0) / door.width)
    start = x0 - before * along[0], y0 - before * along[1]
    return replace(door, start=start, end=(x1 + after * along[0], y1 + after * along[1]))
