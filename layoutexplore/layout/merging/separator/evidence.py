"""What the separator network says of regions and of their contacts, added to their tables."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Floats32, Ints32
from layoutexplore.layout.merging.contact_table import BorderMap
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, edge_slots, find_slot
from layoutexplore.layout.merging.separator.network import BORDER, FIRST_PAIR, NEAR, OFFSETS, OUTSIDE
from layoutexplore.layout.merging.separator.planes import fine_index, square_middles

MOST = 4.0
"""Log-odds count up to this much for or against."""


def border_map(odds: Floats32, shape: tuple[int, int], resolution: float) -> BorderMap:
    """Where a room's border passes on a map of such a shape; nowhere where `odds` are empty."""
    if not odds.size:
        return BorderMap(np.zeros((1, 1), np.float32), *(np.zeros(size, np.int32) for size in shape))
    likely = np.asarray(1 / (1 + np.exp(-odds[:, :, BORDER])), np.float32)
    # two fine squares lie along a square
    return BorderMap(likely, *(fine_index(size, resolution) // 2 for size in shape))


def add_separator(
    labels: Ints32, odds: Floats32, ends: Ints32, edges: Floats, nodes: Floats, resolution: float
) -> None:
    """Add what the network says of pairs of squares to the tables of the regions that they lie in.

    Args:
        labels: int32 (rows, cols), the regions.
        odds: float32 (squares, squares, OUTPUTS).
        ends: int32 (m, 2), of the contacts.
        edges: float64 (m, columns of `EDGE`), changed.
        nodes: float64 (k + 1, columns of `NODE`), changed.
        resolution: Metres a cell.
    """
    rows, cols = (square_middles(squares, resolution) for squares in odds.shape[:2])
    high, wide = (int(np.searchsorted(m, size)) for m, size in zip((rows, cols), labels.shape, strict=True))
    at = np.zeros(odds.shape[:2], np.int32)  # no region beyond the map
    at[:high, :wide] = labels[np.ix_(rows[:high], cols[:wide])]
    _add_pairs(at, odds, np.array(OFFSETS, np.int64), ends, edges, nodes)


@njit(cache=True, nogil=True)
def _add_pairs(
    at: Ints32, odds: Floats32, offsets: Ints32, ends: Ints32, edges: Floats, nodes: Floats
) -> None:
    """`at` (squares, squares) is the region of each square, 0 for none."""
    # contacts are looked up by their ends, of which the lower comes first
    slots = edge_slots(len(ends))
    for e in range(len(ends)):
        slots[find_slot(ends[e, 0], ends[e, 1], ends, slots)] = e
    rows, cols = at.shape
    for r in range(rows):
        for c in range(cols):
            a = at[r, c]
            if a == 0:
                continue
            nodes[a, NODE.squares] += 1
            nodes[a, NODE.outside] += 1.0 / (1.0 + np.exp(-odds[r, c, OUTSIDE]))
            for k in range(len(offsets)):
                rr, cc = r + offsets[k, 0], c + offsets[k, 1]
                if rr >= rows or cc >= cols or cc < 0:
                    continue
                b = at[rr, cc]
                if b == 0:
                    continue
                value = min(max(odds[r, c, FIRST_PAIR + k], -MOST), MOST)
                if a == b:
                    if k >= NEAR:
                        nodes[a, NODE.alike] += value
                        nodes[a, NODE.pairs] += 1
                    continue
                # regions that do not touch have no contact that it could count for
                e = slots[find_slot(min(a, b), max(a, b), ends, slots)]
                if e < 0:
                    continue
                if k < NEAR:
                    edges[e, EDGE.alike_near] += value
                    edges[e, EDGE.pairs_near] += 1
                else:
                    edges[e, EDGE.alike_far] += value
                    edges[e, EDGE.pairs_far] += 1
