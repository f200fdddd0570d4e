"""The region adjacency graph: what each region (superpixel) is like, and what lies between two that touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from layoutexplore.grids.arrays import Floats, Floats32, Ints32, Mask
from layoutexplore.grids.bitsets import set_bits, true_cells
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.layout.merging.contact_table import LineStrips, RegionMaps, WallBits, contact_table
from layoutexplore.layout.merging.door_gaps import DoorGaps
from layoutexplore.layout.merging.graph_tables import RegionGraph
from layoutexplore.layout.merging.line_evidence import LineEvidence, count_rooms
from layoutexplore.layout.merging.node_table import label_changes, node_table
from layoutexplore.layout.merging.separator.evidence import add_separator, border_map

NEAR_REACH, FAR_REACH = 1.5, 6.0
"""How far walls in line with a contact are looked for on either side, in metres."""

SLACK = 0.1
"""A wall may step aside by this much [m]."""

MOST_SLACK = 5
"""Beside a contact askew, where it is looked for cell by cell, by at most so many cells."""

BESIDE = 0.3
"""A line lies near a contact within this distance [m]."""

WALL_THICKNESS = 0.5
"""Two regions touch across an obstacle up to twice so thick [m]."""

LARGEST_TABLE = 2**23
"""The table of regions and rooms of the lines has at most so many entries."""


class GraphEvidence(NamedTuple):
    """What is known of rooms besides the regions.

    Attributes:
        lines: The representative lines.
        separator: float32 (squares, squares, OUTPUTS), what the separator network says; empty for nothing.
    """

    lines: LineEvidence
    separator: Floats32


def region_graph(
    labels: Ints32,
    *,
    free: Mask,
    clutter: Mask,
    wall: Mask,
    distance: Floats32,
    gaps: DoorGaps,
    evidence: GraphEvidence,
    resolution: float,
) -> RegionGraph:
    """The graph of a map's regions; without the rooms of the lines where their table would be too large.

    Args:
        labels: int32 (rows, cols), the regions, numbered from 1 without gaps, 0 for none.
        free: bool (rows, cols), known free cells.
        clutter: bool (rows, cols), occupied cells that are no walls.
        wall: bool (rows, cols), occupied cells that are.
        distance: float32 (rows, cols), distance to the edges of the walls' cells, in cells.
        gaps: The door-gap candidates.
        evidence: What lines and the separator network say.
        resolution: Metres a cell.
    """
    lines, separator = evidence
    steps, slack, near, far, beside = (
        cells_at_most(length, resolution, 10**6)
        for length in (WALL_THICKNESS, SLACK, NEAR_REACH, FAR_REACH, BESIDE)
    )
    rows, cols = labels.shape
    along_rows, along_cols = set_bits(true_cells(wall), rows, cols, min(slack, rows + cols))
    spread = labels.copy()
    spread_in_place(spread, wall, steps)
    changes = true_cells(label_changes(spread, wall))
    count = int(labels.max(initial=0))
    nodes = node_table(labels, changes, free, clutter, distance.view(np.int32), count)
    ends, edges = contact_table(
        RegionMaps(
            labels, spread, free, wall, distance, gaps.gap, border_map(separator, (rows, cols), resolution)
        ),
        changes,
        gaps.table.astype(np.float64) * resolution,
        WallBits(along_rows, along_cols, near, far, min(slack, MOST_SLACK) if gaps.askew else -1),
        LineStrips(
            lines.row_strip, lines.col_strip, lines.face, lines.room, lines.above, lines.right, beside
        ),
        nodes,
    )
    add_separator(labels, separator, ends, edges, nodes, resolution)
    if (count + 1) * (int(lines.room.max(initial=0)) + 1) > LARGEST_TABLE:
        return RegionGraph(nodes, ends, edges, np.zeros((count + 1, 1)), resolution)
    return RegionGraph(
        nodes, ends, edges, rooms_of_regions(labels, free, lines, count, resolution), resolution
    )


def rooms_of_regions(
    labels: Ints32, free: Mask, lines: LineEvidence, count: int, resolution: float
) -> Floats:
    """float64 (count + 1, rooms + 1): known free cells of regions in the rooms of the lines, 0 for none."""
    slack = cells_at_most(SLACK, resolution, max(labels.shape))
    return count_rooms(labels, free, lines, count, beside=slack)
