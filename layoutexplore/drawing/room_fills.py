"""Fills of rooms: neighbours get different colours, and a room keeps its own wherever it can."""

from __future__ import annotations

import heapq
import math
from collections import Counter, defaultdict

import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Labels
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.options import Rule

WALL_THICKNESS = 0.6
"""Metres, along rows and columns, up to which rooms are neighbours."""

_RESOLUTION = Rule(above=0.0)


@checks_arguments
def fills_of_rooms(room_ids: Labels, resolution: float) -> Bytes:
    """The fill of each room of a map, uint8 (largest id + 1, 3) RGB; white for 0.

    Args:
        room_ids: (rows, cols), 1-based, 0 or less for none.
        resolution: Metres a cell.

    Example:
        >>> fills = fills_of_rooms(np.array([[1, 0, 11, 0, 2]], np.int32), 0.5)
        >>> bool((fills[1] == fills[11]).all()), fills[0].tolist() == list(palette.FREE)
        (False, True)
    """
    if room_ids.ndim != 2:
        raise MapError(f"room ids are a table of numbers, got {room_ids.shape}")
    _RESOLUTION.convert("resolution", resolution)
    count = max(int(room_ids.max(initial=0)), 0)
    numbers = (np.arange(count + 1) - 1) % len(palette.ROOMS)
    for room, number in colour_numbers(_neighbours(room_ids, resolution), len(palette.ROOMS)).items():
        numbers[room] = number
    fills = np.array(palette.ROOMS, np.uint8)[numbers]
    fills[0] = palette.FREE
    return fills


@checks_arguments
def colour_numbers(neighbours: dict[int, set[int]], colours: int) -> dict[int, int]:
    """A number of a colour, 0 to `colours` - 1, for each room; no two neighbours share one if that can be.

    The rooms are taken by smallest degree last (Matula and Beck, "Smallest-last ordering and clustering and
    graph coloring algorithms", 1983), so that six colours are enough where walls are thin. Each room takes
    the first free colour from its own, its id modulo the colours, on; where none is free, the one that the
    fewest of its neighbours have.

    Args:
        neighbours: By room its neighbours, each of which has the room among its own.
        colours: How many there are.

    Example:
        >>> colour_numbers({1: {2, 4}, 2: {1, 4}, 4: {1, 2}}, 3)
        {4: 0, 2: 1, 1: 2}
    """
    found: dict[int, int] = {}
    for room in reversed(_smallest_first(neighbours)):
        used = Counter(found[other] for other in neighbours[room] if other in found)
        own = room - 1
        found[room] = min(((own + k) % colours for k in range(colours)), key=lambda number: used[number])
    return found


def _smallest_first(neighbours: dict[int, set[int]]) -> list[int]:
    """The rooms as they are taken out one after the other, always one with the fewest neighbours left."""
    degrees = {room: len(others) for room, others in neighbours.items()}
    # A room has an entry for each degree that it has had: those that are no longer true are passed over.
    heap = [(degree, room) for room, degree in degrees.items()]
    heapq.heapify(heap)
    order = []
    while heap:
        degree, room = heapq.heappop(heap)
        if degrees.get(room) != degree:
            continue
        order.append(room)
        del degrees[room]
        for other in neighbours[room]:
            if other in degrees:
                degrees[other] -= 1
                heapq.heappush(heap, (degrees[other], other))
    return order


def _neighbours(room_ids: Labels, resolution: float) -> dict[int, set[int]]:
    """By room the rooms behind its walls: rooms that touch once each has grown by half of a wall."""
    grown = np.ascontiguousarray(np.maximum(room_ids, 0), np.int32)
    steps = max(1, math.ceil(WALL_THICKNESS / 2 / resolution - 1e-9))
    spread_in_place(grown, grown == 0, steps, consume=True)
    rooms: defaultdict[int, set[int]] = defaultdict(set)
    for first, second in (
        (grown[:-1], grown[1:]),
        (grown[:, :-1], grown[:, 1:]),
        (grown[:-1, :-1], grown[1:, 1:]),
        (grown[:-1, 1:], grown[1:, :-1]),
    ):
        for a, b in _pairs(first, second):
            rooms[a].add(b)
            rooms[b].add(a)
    return dict(sorted(rooms.items()))


def _pairs(first: Ints32, second: Ints32) -> list[tuple[int, int]]:
    """Each two rooms that some cell has in both."""
    differ = first != second
    a, b = first[differ].astype(np.int64), second[differ].astype(np.int64)
    both = (a > 0) & (b > 0)
    codes: Ints = np.unique(a[both] << 32 | b[both])
    return [(code >> 32, code & 0xFFFFFFFF) for code in codes.tolist()]
