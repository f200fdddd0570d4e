"""The floor as a robot knows and foresees it: what is left to see, from where, and where that ends."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from layoutexplore.agents.omniscient.places import Places
from layoutexplore.agents.omniscient.visibility import SPARE, Bits, FloorInView, Visibility, size
from layoutexplore.agents.watchful_tour import WatchfulTourOptions
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.frontiers.tour_features import MOST_AREA, area_in_doubt
from layoutexplore.grids.arrays import Cells, Ints, Ints32, Mask, Words
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Cell
from layoutexplore.grids.morphology import grow, inflate
from layoutexplore.grids.rays import is_free_line
from layoutexplore.maps.raster import SIGHT_BEYOND_REACH
from layoutexplore.planning.shortest_paths import geodesic_distances

SAMPLE = 24_000
"""About how many cells of the grid are sampled: of a floor's free ones about half as many."""

SCAN_SPACING = 0.5
"""Metres between scans while walking, as a simulation has them."""

NEAR_FRONTIER = 1.2
"""Metres: a place that is nearer to a frontier's viewpoint, in sight of it, stands for it in a route."""

OPEN_SHARE = 0.3
"""A frontier leads beyond what is foreseen where nothing is foreseen beside so large a share of its cells."""


class ForeseenFloor:
    """What a robot knows and foresees of a floor, at one decision after the other.

    Args:
        lattice: Metres between the places where a route may stop.
        doubted: Square metres to be expected behind a closed frontier, from which on it is open where nothing
            is foreseen: its class may be wrong.

    Attributes:
        places: Where the robot may stop, and what is seen from there.
        seen: What has been seen, need not be seen or has been given up, as a set.
        open: int64 (k,), numbers of the frontiers behind which nothing is foreseen, but something is likely.
    """

    places: Places
    seen: Bits

    def __init__(self, lattice: float, doubted: float = WatchfulTourOptions.doubted) -> None:
        self._lattice, self._doubted = lattice, doubted
        self._cells: Cells | None = None
        self._scene: FloorInView | None = None
        self._given_up: Bits | None = None
        self.open = np.empty(0, np.int64)

    def update(self, decision: Decision, foresight: Foresight) -> None:
        """Take over what is known and foreseen at a decision."""
        cells = foresight.completed(decision.grid.cells)
        if self._cells is None or not np.array_equal(cells, self._cells):
            self._cells, self._scene = cells, floor_in_view(decision, cells)
            if self._given_up is None:
                visibility = Visibility(self._scene, SCAN_SPACING, SAMPLE, fixed=False)
                self.places = Places(self._scene, visibility, self._lattice)
                self._given_up = np.zeros(visibility.words, np.uint64)
            else:
                self.places.adapt(self._scene)
        assert self._scene is not None and self._given_up is not None
        known = decision.grid.cells != UNKNOWN
        visibility, target = self.places.visibility, self._scene.target
        self.seen = visibility.set_of(known) | ~visibility.target | self._given_up
        self._total, self._known = int(np.count_nonzero(target)), int(np.count_nonzero(target & known))
        self._total += self._mark_open(decision, foresight)

    def quotas(self, *shares: float) -> list[int]:
        """How large `seen` must become for these shares of all that is known and foreseen."""
        visibility, seen = self.places.visibility, size(self.seen)
        scale = self.places.resolution**2 / visibility.cell_area
        missing = [max(0, math.ceil((share * self._total - self._known) * scale)) for share in shares]
        return [min(seen + count, 64 * visibility.words) for count in missing]

    @property
    def left_share(self) -> float:
        """The share of the floor that is left to see."""
        return self.left / max(1, self._total)

    @property
    def left(self) -> int:
        """How many cells of the floor are left to see."""
        return self._total - self._known

    def give_up(self, bits: Bits) -> None:
        """Never ask for these again: they were looked at, and are not as foreseen."""
        assert self._given_up is not None
        self._given_up |= bits
        self._given_up[self.places.visibility.spare :] = 0
        self.seen = self.seen | self._given_up

    def frontier_of(self, seen: Bits) -> int | None:
        """The open frontier that a stop shows, by its number among all; None when it shows none."""
        first = 64 * self.places.visibility.spare
        shown = np.unpackbits((seen & ~self.seen).view(np.uint8), bitorder="little")[first:]
        hits = np.flatnonzero(shown)
        return int(self.open[np.searchsorted(self._ends, hits[0], side="right")]) if len(hits) else None

    def left_in(self, seen: Bits) -> Ints32:
        """int32 (n, 2): the sampled cells that are foreseen, left to see, and shown by a stop."""
        visibility = self.places.visibility
        shown = np.unpackbits((seen & ~self.seen).view(np.uint8), bitorder="little")[: visibility.count]
        cells = np.unravel_index(visibility.sample[shown > 0], self.places.traversable.shape)
        return np.stack(cells, axis=1).astype(np.int32)

    def _mark_open(self, decision: Decision, foresight: Foresight) -> int:
        """Let places near open frontiers show what lies behind these: as many cells as are expected there."""
        visibility, views, table = self.places.visibility, self.places.views, decision.table
        beside = foresight.beside(decision.grid.cells, decision.clusters)
        in_view, leads_on = np.minimum(table.visible_area, MOST_AREA), table.closed <= 0.0
        area = np.where(leads_on, in_view, np.minimum(in_view, area_in_doubt(decision)))
        is_open = (beside.nothing >= OPEN_SHARE) & (leads_on | (area >= self._doubted))
        if foresight.confidence < 1.0:  # What is drawn as wall may be a room.
            is_open |= ~beside.is_told & (table.closed < 0.0)
        self.open = np.flatnonzero(is_open)
        views[:, visibility.spare :] = 0
        bits = np.maximum(1, np.round(area[self.open] / visibility.cell_area)).astype(np.int64)
        most = 64 * SPARE
        if bits.sum() > most:
            bits = np.maximum(1, bits * most // (2 * bits.sum()))
            self.open, bits = self.open[:most], bits[:most]
        self._ends = np.cumsum(bits)
        self.seen[visibility.spare :] &= ~_mark(
            decision.grid.cells,
            self.places.cells,
            decision.viewpoints[self.open],
            NEAR_FRONTIER / self.places.resolution,
            self._ends,
            views[:, visibility.spare :],
        )
        return round(float(bits.sum()) * visibility.cell_area / self.places.resolution**2)


def floor_in_view(decision: Decision, cells: Cells) -> FloorInView:
    """The floor to plan on.

    Args:
        decision: Where the robot is, and how large.
        cells: int8 (rows, cols), what is known, and what is foreseen where nothing is known.
    """
    free, resolution = np.equal(cells, FREE), decision.grid.resolution
    here = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
    reachable = reachable_from(here, cells, decision.robot_radius, resolution)
    target = grow(reachable, free, SIGHT_BEYOND_REACH / resolution)
    return FloorInView(~free, target, reachable, resolution, decision.sensor)


def reachable_from(here: Cell, cells: Cells, radius: float, resolution: float) -> Mask:
    """Bool (rows, cols): the cells that a robot's centre can get to, itself included."""
    clear = np.equal(cells, FREE) & ~inflate(np.equal(cells, OCCUPIED), radius, resolution)
    return np.isfinite(geodesic_distances(clear, here, resolution))


@njit(cache=True, nogil=True)
def _mark(cells: Cells, places: Ints32, viewpoints: Ints32, reach: float, ends: Ints, views: Words) -> Words:
    """Set the bits of each open frontier in the views of the places near it; all bits that any has.

    Args:
        cells: int8 (rows, cols), what is known.
        places: int32 (n, 2), as (row, col).
        viewpoints: int32 (k, 2), of the frontiers.
        reach: How near is near, in cells.
        ends: int64 (k,), where the bits of each frontier end.
        views: uint64 (n, words), written to; bit 0 of word 0 is the first of the first frontier.

    Returns:
        uint64 (words,).
    """
    marks = np.zeros(views.shape[1], np.uint64)
    begin = 0
    for k in range(len(ends)):
        row, col = viewpoints[k]
        nearest, best = -1, np.inf
        for n in range(len(places)):
            away = (places[n, 0] - row) ** 2 + (places[n, 1] - col) ** 2
            if away < best:
                nearest, best = n, away
        for n in range(len(places)):
            away = (places[n, 0] - row) ** 2 + (places[n, 1] - col) ** 2
            # The nearest one stands for a frontier that no place is near to.
            if n != nearest and (
                away > reach * reach or not is_free_line(cells, row, col, places[n, 0], places[n, 1])
            ):
                continue
            for bit in range(begin, ends[k]):
                views[n, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
        for bit in range(begin, ends[k]):
            marks[bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
        begin = ends[k]
    return marks
