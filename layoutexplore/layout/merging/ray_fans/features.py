"""What is known of a region: the inputs of the classifier that says whether it lies outside the building."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from layoutexplore.grids.arrays import Floats
from layoutexplore.layout.merging.graph_tables import NODE
from layoutexplore.layout.merging.pair_features import FEATURES, F, describe_map
from layoutexplore.layout.merging.ray_fans.enclosure import Enclosure


class RegionFeatures(NamedTuple):
    """The features in their order, float64 (k + 1,) each; row 0 is no region.

    Attributes:
        log_area: Logarithm of the known free area [m2].
        unseen: Share of its space that is neither free nor clutter.
        unknown: Share of its sides towards unknown space.
        wall: Share towards walls.
        clutter: Share of its space with clutter.
        radius: Largest distance to obstacles [m].
        fill: Its space over that of its bounding box.
        aspect: The box's shorter side over the longer one.
        walled: Share of its cells with walls to all four sides.
        nearly_walled: Share with walls to at least three sides.
        outside: Mean distance beyond the box of the walls [m].
        map_clutter: Clutter over the space of all regions.
        map_unknown: Unknown sides over unknown ones and those towards walls.
        map_radius: Mean radius of the regions, by space [m].
    """

    log_area: Floats
    unseen: Floats
    unknown: Floats
    wall: Floats
    clutter: Floats
    radius: Floats
    fill: Floats
    aspect: Floats
    walled: Floats
    nearly_walled: Floats
    outside: Floats
    map_clutter: Floats
    map_unknown: Floats
    map_radius: Floats


def describe_regions(nodes: Floats, enclosure: Enclosure, resolution: float) -> Floats:
    """The features of the regions, float64 (k + 1, features).

    Args:
        nodes: float64 (k + 1, columns of `NODE`).
        enclosure: How far walls enclose the regions.
        resolution: Metres a cell.
    """
    sides, space = np.maximum(nodes[:, NODE.sides], 1.0), np.maximum(nodes[:, NODE.space], 1.0)
    height = np.maximum(nodes[:, NODE.row1] - nodes[:, NODE.row0], 1.0)
    width = np.maximum(nodes[:, NODE.col1] - nodes[:, NODE.col0], 1.0)
    about_map = np.zeros((1, len(FEATURES)))
    describe_map(nodes, resolution, about_map)
    columns = RegionFeatures(
        log_area=np.log(np.maximum(nodes[:, NODE.area], 1.0) * resolution**2),
        unseen=1.0 - (nodes[:, NODE.area] + nodes[:, NODE.clutter]) / space,
        unknown=nodes[:, NODE.open_end] / sides,
        wall=nodes[:, NODE.wall_sides] / sides,
        clutter=nodes[:, NODE.clutter] / space,
        radius=nodes[:, NODE.peak] * resolution,
        fill=space / (height * width),
        aspect=np.minimum(height, width) / np.maximum(height, width),
        walled=enclosure.walled,
        nearly_walled=enclosure.nearly,
        outside=enclosure.outside,
        **{
            name: np.full(len(nodes), about_map[0, getattr(F, name)])
            for name in ("map_clutter", "map_unknown", "map_radius")
        },
    )
    return np.ascontiguousarray(np.stack(columns, axis=1))
