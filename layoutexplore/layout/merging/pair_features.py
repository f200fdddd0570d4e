"""What is known of two touching regions: the inputs of the classifier that says whether they are one room."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.layout.merging.graph_tables import EDGE, NODE


class PairFeatures(NamedTuple):
    """The features in their order; the small region has less known free space, the union is of both.

    A model's file names them: another order, or another name, is another model.
    """

    log_area_small: int
    log_area_large: int
    openness: int
    contact: int
    contact_share_small: int
    contact_share_large: int
    pass_: int
    pass_ratio_small: int
    pass_ratio_large: int
    radius_small: int
    radius_large: int
    door_share: int
    door_width: int
    door_long_run: int
    door_short_run: int
    fill_small: int
    fill_large: int
    fill_union: int
    fill_change: int
    aspect_small: int
    aspect_large: int
    aspect_union: int
    misalignment: int
    line_near: int
    line_near_min: int
    line_far: int
    unknown_small: int
    unknown_large: int
    clutter_small: int
    clutter_large: int
    wall_small: int
    wall_large: int
    straightness: int
    through: int
    facing_small: int
    facing_large: int
    only_way_small: int
    only_way_large: int
    parted: int
    covered: int
    apart: int
    seen: int
    same_room: int
    room_share_small: int
    room_share_large: int
    room_overlap: int
    room_fit: int
    border: int
    alike_near: int
    alike_far: int
    alike_small: int
    alike_large: int
    outside_small: int
    outside_large: int
    map_clutter: int
    map_unknown: int
    map_radius: int


FEATURES = tuple(name.rstrip("_") for name in PairFeatures._fields)
"""Their names in the files of models."""

OF_NETWORK = (
    *("border", "alike_near", "alike_far", "alike_small", "alike_large"),
    *("outside_small", "outside_large"),
)
"""Those that come from the separator network."""

F = PairFeatures(*range(len(FEATURES)))
"""The index of each feature, constants to the compiler."""


DOUBT = 3.0
"""Pairs of squares of which nothing is known count besides: the mean of a few is worth less."""


class GraphTables(NamedTuple):
    """Tables of a `RegionGraph` for kernels, float64 (k + 1, ...), (m, ...) and (k + 1, r + 1)."""

    nodes: Floats
    edges: Floats
    rooms: Floats


@njit(cache=True, nogil=True)
def _aspect(rows: float, cols: float) -> float:
    """The shorter side of a box over its longer one."""
    return min(rows, cols) / max(max(rows, cols), 1.0)


@njit(cache=True, nogil=True)
def _smaller(a: Floats, b: Floats) -> bool:
    """Whether region a is the small one; of equal ones it is, so that a pair has one order."""
    return bool(
        a[NODE.area] < b[NODE.area] or (a[NODE.area] == b[NODE.area] and a[NODE.space] <= b[NODE.space])
    )


@njit(cache=True, nogil=True)
def _contact_features(s: Floats, t: Floats, e: Floats, resolution: float, out: Floats) -> None:
    """What the contact of a small and a large region is like."""
    n = max(e[EDGE.open], 1.0)
    out[F.openness] = e[EDGE.open] / max(e[EDGE.open] + e[EDGE.through], 1.0)
    out[F.contact] = e[EDGE.open] * resolution
    out[F.contact_share_small] = e[EDGE.open] / max(s[NODE.sides], 1.0)
    out[F.contact_share_large] = e[EDGE.open] / max(t[NODE.sides], 1.0)
    out[F.pass_] = e[EDGE.clearance] * resolution
    out[F.pass_ratio_small] = e[EDGE.clearance] / max(s[NODE.peak], 0.5)
    out[F.pass_ratio_large] = e[EDGE.clearance] / max(t[NODE.peak], 0.5)
    # what a contact adds up side by side is divided by its sides, of doors by those in a gap
    doors = max(e[EDGE.door], 1.0)
    out[F.door_share] = e[EDGE.door] / n
    out[F.door_width] = e[EDGE.width] / doors
    out[F.door_long_run] = min(e[EDGE.long] / doors, 5.0)
    out[F.door_short_run] = min(e[EDGE.short] / doors, 5.0)
    out[F.line_near] = e[EDGE.near] / n
    out[F.line_near_min] = e[EDGE.near_min] / n
    out[F.line_far] = e[EDGE.far] / n
    out[F.straightness] = abs(2 * e[EDGE.across_rows] - e[EDGE.open]) / n
    out[F.through] = e[EDGE.through] * resolution
    out[F.only_way_small] = e[EDGE.open] / _ways_out(s, e)
    out[F.only_way_large] = e[EDGE.open] / _ways_out(t, e)
    out[F.parted] = e[EDGE.parted] / n
    out[F.covered] = e[EDGE.covered] / n
    out[F.apart] = e[EDGE.apart] / n
    out[F.seen] = e[EDGE.seen] / n
    out[F.border] = e[EDGE.border] / n
    out[F.alike_near] = e[EDGE.alike_near] / (e[EDGE.pairs_near] + DOUBT)
    out[F.alike_far] = e[EDGE.alike_far] / (e[EDGE.pairs_far] + DOUBT)


@njit(cache=True, nogil=True)
def _ways_out(node: Floats, e: Floats) -> float:
    """Sides of a region towards others, at least those of the contact."""
    others = node[NODE.sides] - node[NODE.wall_sides] - node[NODE.open_end]
    return float(max(others, e[EDGE.open], 1.0))


@njit(cache=True, nogil=True)
def _shape_features(s: Floats, t: Floats, e: Floats, resolution: float, out: Floats) -> None:
    """What the shapes of a small and a large region and of their union are like, by their bounding boxes."""
    hs, ws = s[NODE.row1] - s[NODE.row0], s[NODE.col1] - s[NODE.col0]
    ht, wt = t[NODE.row1] - t[NODE.row0], t[NODE.col1] - t[NODE.col0]
    hu = max(s[NODE.row1], t[NODE.row1]) - min(s[NODE.row0], t[NODE.row0])
    wu = max(s[NODE.col1], t[NODE.col1]) - min(s[NODE.col0], t[NODE.col0])
    space = s[NODE.space] + t[NODE.space]
    out[F.fill_small] = s[NODE.space] / (hs * ws)
    out[F.fill_large] = t[NODE.space] / (ht * wt)
    out[F.fill_union] = space / (hu * wu)
    out[F.fill_change] = out[F.fill_union] - space / (hs * ws + ht * wt)
    out[F.aspect_small] = _aspect(hs, ws)
    out[F.aspect_large] = _aspect(ht, wt)
    out[F.aspect_union] = _aspect(hu, wu)
    rows = abs(s[NODE.row0] - t[NODE.row0]) + abs(s[NODE.row1] - t[NODE.row1])
    cols = abs(s[NODE.col0] - t[NODE.col0]) + abs(s[NODE.col1] - t[NODE.col1])
    out[F.misalignment] = min(rows, cols) * resolution
    # a contact that runs along the rows faces the width of a region, one along the columns its height
    lying = e[EDGE.across_rows] / max(e[EDGE.open], 1.0)
    out[F.facing_small] = e[EDGE.open] / max(lying * ws + (1 - lying) * hs, 1.0)
    out[F.facing_large] = e[EDGE.open] / max(lying * wt + (1 - lying) * ht, 1.0)


@njit(cache=True, nogil=True)
def _own_features(s: Floats, t: Floats, resolution: float, out: Floats) -> None:
    """What a small and a large region are like, each by itself."""
    out[F.log_area_small] = np.log(max(s[NODE.area], 1.0) * resolution**2)
    out[F.log_area_large] = np.log(max(t[NODE.area], 1.0) * resolution**2)
    out[F.radius_small] = s[NODE.peak] * resolution
    out[F.radius_large] = t[NODE.peak] * resolution
    out[F.unknown_small] = s[NODE.open_end] / max(s[NODE.sides], 1.0)
    out[F.unknown_large] = t[NODE.open_end] / max(t[NODE.sides], 1.0)
    out[F.clutter_small] = s[NODE.clutter] / s[NODE.space]
    out[F.clutter_large] = t[NODE.clutter] / t[NODE.space]
    out[F.wall_small] = s[NODE.wall_sides] / max(s[NODE.sides], 1.0)
    out[F.wall_large] = t[NODE.wall_sides] / max(t[NODE.sides], 1.0)
    out[F.alike_small] = s[NODE.alike] / (s[NODE.pairs] + DOUBT)
    out[F.alike_large] = t[NODE.alike] / (t[NODE.pairs] + DOUBT)
    out[F.outside_small] = s[NODE.outside] / max(s[NODE.squares], 1.0)
    out[F.outside_large] = t[NODE.outside] / max(t[NODE.squares], 1.0)


@njit(cache=True, nogil=True)
def _room_features(a: Floats, b: Floats, size: Floats, out: Floats) -> None:
    """What the rooms of the lines say of a small and a large region; `size` (r + 1,) is each room's.

    A region fits a room by intersection over union.
    """
    total_a, total_b = max(a.sum(), 1.0), max(b.sum(), 1.0)
    same = overlap = most_a = most_b = fit_a = fit_b = fit = 0.0
    # column 0 is no room: cells in none agree with nothing
    for k in range(1, len(size)):
        x, y = a[k], b[k]
        if x == 0 and y == 0:
            continue
        same += x * y
        overlap += min(x / total_a, y / total_b)
        most_a, most_b = max(most_a, x), max(most_b, y)
        fit_a, fit_b = max(fit_a, x / (total_a + size[k] - x)), max(fit_b, y / (total_b + size[k] - y))
        fit = max(fit, (x + y) / (total_a + total_b + size[k] - x - y))
    out[F.same_room] = same / (total_a * total_b)
    out[F.room_share_small] = most_a / total_a
    out[F.room_share_large] = most_b / total_b
    out[F.room_overlap] = overlap
    out[F.room_fit] = fit - max(fit_a, fit_b)


@njit(cache=True, nogil=True)
def describe_map(nodes: Floats, resolution: float, out: Floats) -> None:
    """Write what is typical of a map to every row of `out` (n, features).

    That is clutter and unknown borders over its space, and its regions' mean radius by area.
    """
    space = max(nodes[:, NODE.space].sum(), 1.0)
    ends = nodes[:, NODE.open_end].sum()
    out[:, F.map_clutter] = nodes[:, NODE.clutter].sum() / space
    out[:, F.map_unknown] = ends / max(ends + nodes[:, NODE.wall_sides].sum(), 1.0)
    out[:, F.map_radius] = (nodes[:, NODE.peak] * nodes[:, NODE.space]).sum() / space * resolution


@njit(cache=True, nogil=True)
def describe_pairs(
    pairs: Ints32, ends: Ints32, tables: GraphTables, resolution: float, size: Floats, out: Floats
) -> None:
    """Write the features of some contacts, but not those of the map, to `out` (len(pairs), features)."""
    for n in range(len(pairs)):
        i, j = ends[pairs[n], 0], ends[pairs[n], 1]
        if not _smaller(tables.nodes[i], tables.nodes[j]):
            i, j = j, i
        s, t, e = tables.nodes[i], tables.nodes[j], tables.edges[pairs[n]]
        _own_features(s, t, resolution, out[n])
        _contact_features(s, t, e, resolution, out[n])
        _shape_features(s, t, e, resolution, out[n])
        _room_features(tables.rooms[i], tables.rooms[j], size, out[n])
