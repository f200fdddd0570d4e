"""The outside of a building in a picture of it: what the picture's border reaches through free space.

A plan on white paper shows the garden in the grey of the floor. Walls tell the two apart, but for the gaps of
outer doors and windows. Such gaps are closed, no wider than it takes: the narrowest closing that encloses
nearly as much as the widest does. Narrow bays between the wings of a building then stay outside.
"""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.errors import MapError, checks_arguments, shortened
from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid, check_resolution
from layoutexplore.grids.morphology import with_neighbours

OPENING = 3.0
"""Metres; gaps of outer walls up to this width are closed."""

_MOST_OPENING = 100.0
"""Metres: nothing wider is an opening, and closing it would take much memory."""

MOSTLY = 0.9
"""Share of what the widest closing encloses that a narrower one must enclose to be chosen."""

_SHORT = 12
"""A reach up to which squares are laid around cells; beyond, sums over squares are faster."""

MARGIN_SHARE, INSIDE_SHARE, UNKNOWN_SHARE = 0.4, 0.05, 0.2
"""A picture has margins where so much of its border is free, and a building in it where walls enclose so much
of its free area at least; with more unknown on its border than this, it is a robot's map."""


@checks_arguments
def find_outside(walls: Mask, resolution: float, *, opening: float = OPENING) -> Mask:
    """The cells, bool (rows, cols), that the border of a picture reaches past its walls.

    Args:
        walls: bool (rows, cols).
        resolution: Side of a cell in metres.
        opening: Gaps of walls up to this width in metres are closed.

    Example:
        >>> walls = np.zeros((7, 7), np.bool_)
        >>> walls[1:6, 1] = walls[1:6, 5] = walls[1, 1:6] = walls[5, 1:6] = True
        >>> int((~find_outside(walls, 1.0, opening=0.0) & ~walls).sum())
        9
        >>> walls[5, 3] = False  # an open door
        >>> [int((~find_outside(walls, 1.0, opening=o) & ~walls).sum()) for o in (0.0, 2.0)]
        [0, 10]
    """
    check_resolution(resolution)
    if walls.ndim != 2 or not walls.size or not 0.0 <= opening <= _MOST_OPENING:
        raise MapError(
            f"walls are 2-d and not empty, the opening from 0 to {_MOST_OPENING:g} m, "
            f"got {walls.shape} and {shortened(opening)}"
        )
    widest = _outside(walls, round(opening / resolution / 2))
    enough = MOSTLY * np.count_nonzero(~widest & ~walls)
    for share in (0.0, 0.25, 0.5):
        narrow = _outside(walls, round(share * opening / resolution / 2))
        if np.count_nonzero(~narrow & ~walls) >= max(enough, 1):
            return narrow
    return widest


def without_outside(grid: OccupancyGrid) -> OccupancyGrid:
    """The grid with the free space outside of the building unknown; the same grid where it shows no outside.

    There is an outside where much of the picture's border is free, hardly any of it unknown (robots leave the
    outside unknown), and walls enclose something substantial.

    Example:
        >>> cells = np.zeros((40, 40), np.int8)
        >>> cells[10:30, 10] = cells[10:30, 29] = cells[10, 10:30] = cells[29, 10:30] = 100
        >>> without_outside(OccupancyGrid(cells, 0.1)).free.sum()
        np.int64(324)
    """
    edge = np.concatenate([grid.cells[0], grid.cells[-1], grid.cells[:, 0], grid.cells[:, -1]])
    if (edge == FREE).mean() < MARGIN_SHARE or (edge == UNKNOWN).mean() > UNKNOWN_SHARE:
        return grid
    outside = find_outside(~grid.free, grid.resolution) & grid.free
    inside = np.count_nonzero(grid.free & ~outside)
    if not outside.any() or inside < INSIDE_SHARE * np.count_nonzero(grid.free):
        return grid
    cells = np.where(outside, np.int8(UNKNOWN), grid.cells)
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def _outside(walls: Mask, reach: int) -> Mask:
    """What the border reaches once gaps of walls up to twice `reach` cells are closed, bool (rows, cols)."""
    reach = min(reach, (max(walls.shape) + 1) // 2)  # all gaps: a further reach closes no other ones
    closed = _widened(np.pad(walls, reach + 1), reach)
    _, part = cv2.connectedComponents((~closed).view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    outside = (part == part[0, 0]) & ~closed
    grown = _widened(outside, reach)
    return np.asarray(grown[reach + 1 : -reach - 1, reach + 1 : -reach - 1] & ~walls)


def _widened(mask: Mask, reach: int) -> Mask:
    """The same as `with_neighbours`, in a time that does not depend on how far it reaches."""
    if reach <= _SHORT:
        return with_neighbours(mask, reach)
    side = 2 * reach + 1
    sums = cv2.boxFilter(
        mask.view(np.uint8), cv2.CV_32S, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(sums > 0)
