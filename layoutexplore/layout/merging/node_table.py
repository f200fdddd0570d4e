"""The table of regions, filled run by run along the rows of a map; and where the runs end."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Floats, Ints, Ints32, Mask
from layoutexplore.layout.merging.graph_tables import NODE


@njit(cache=True, nogil=True)
def label_changes(spread: Ints32, wall: Mask) -> Mask:
    """Cells whose right or upper neighbour belongs elsewhere; a region ends where it was spread into walls.

    What lies outside the grid is elsewhere for the cells of a region.
    """
    rows, cols = spread.shape
    out = np.zeros((rows, cols), np.bool_)
    for r in range(rows - 1):
        # bitwise, and without the last row and column: the compiler takes many cells at once
        here, above, wall_here, wall_above = spread[r], spread[r + 1], wall[r], wall[r + 1]
        for c in range(cols - 1):
            out[r, c] = (
                (here[c] != above[c])
                | (here[c] != here[c + 1])
                | ((here[c] > 0) & ((wall_here[c] != wall_above[c]) | (wall_here[c] != wall_here[c + 1])))
            )
    for r in range(rows):
        out[r, cols - 1] = (spread[r, cols - 1] > 0) | (
            r + 1 < rows and spread[min(r + 1, rows - 1), cols - 1] > 0
        )
    for c in range(cols):
        out[rows - 1, c] = (spread[rows - 1, c] > 0) | (
            c + 1 < cols and spread[rows - 1, min(c + 1, cols - 1)] > 0
        )
    return out


@njit(cache=True, nogil=True)
def _add_run(node: Floats, free: Mask, clutter: Mask, r: int, begin: int, end: int) -> None:
    """Add the cells begin <= c < end of row r to a region."""
    known = furniture = 0
    free_here, clutter_here = free[r, begin:end], clutter[r, begin:end]
    for c in range(free_here.size):
        known += free_here[c]
        furniture += clutter_here[c]
    node[NODE.space] += end - begin
    node[NODE.area] += known
    node[NODE.clutter] += furniture
    node[NODE.row0] = min(node[NODE.row0], r)
    node[NODE.row1] = max(node[NODE.row1], r + 1)
    node[NODE.col0] = min(node[NODE.col0], begin)
    node[NODE.col1] = max(node[NODE.col1], end)


@njit(cache=True, nogil=True)
def add_side(nodes: Floats, label: int, other: int, blocked: bool) -> None:
    """Add a side of a cell of a region; behind it lies another region, or a wall, or nothing seen."""
    if label > 0:
        nodes[label, NODE.sides] += 1
        if other == 0:
            nodes[label, NODE.wall_sides if blocked else NODE.open_end] += 1


@njit(cache=True, nogil=True)
def node_table(
    labels: Ints32, changes: Ints, free: Mask, clutter: Mask, heights: Ints32, count: int
) -> Floats:
    """The table of `count` regions, without the sides but those on the left and lower border of the grid.

    `changes` are the flat indices of `label_changes`, rising; `heights` the bits of the distances.
    """
    rows, cols = labels.shape
    nodes = np.zeros((count + 1, len(NODE)))
    peak = np.zeros(count + 1, np.int32)
    nodes[:, NODE.row0] = rows
    nodes[:, NODE.col0] = cols
    k = 0
    for r in range(rows):
        begin = ZERO
        while begin < cols:
            a = labels[r, begin]
            # a run of one label begins at the row's first cell or after a change to another label
            end = cols
            while k < len(changes) and changes[k] < (r + 1) * cols:
                c = changes[k] - r * cols + 1
                k += 1
                if c < cols and labels[r, c] != a:
                    end = c
                    break
            if a > 0:
                _add_run(nodes[a], free, clutter, r, begin, end)
                # bits of floats above 0 rise as the floats do: whole numbers are compared many at once
                top, here = peak[a], heights[r, begin:end]
                for c in range(here.size):
                    top = max(top, here[c])
                peak[a] = top
            begin = end
    nodes[:, NODE.peak] = peak.view(np.float32)
    # sides to the right and above are added with the contacts, these two borders are nobody's right or above
    for r in range(rows):
        add_side(nodes, labels[r, 0], 0, False)
    for c in range(cols):
        add_side(nodes, labels[0, c], 0, False)
    return nodes
