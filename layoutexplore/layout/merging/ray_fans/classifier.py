"""The forest that says which regions lie outside the building, and the graph without them.

How the one that ships was trained, and what it brings, is told in `fan_model.md` beside its file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.grids.components import components
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph
from layoutexplore.layout.merging.ray_fans.features import RegionFeatures
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import ForestKind

FAN_FOREST = ForestKind("outside", RegionFeatures._fields, Path(__file__).with_name("fan_model.json"))
"""The classifier of regions; `layoutexplore.training.map_noise.ray_fans` makes it."""


def outside_regions(
    graph: RegionGraph, features: Floats, forest: Forest, *, level: float, spread: float
) -> Mask:
    """Which regions lie outside the building: bool (k + 1,), the first is False.

    What beams paint falls into pieces: one that surely lies outside takes along those it leads to that
    probably do.

    Args:
        graph: The regions.
        features: float64 (k + 1, features) of the regions.
        forest: The classifier.
        level: Log-odds from which on a region lies outside ...
        spread: ... or from which on, if one that does can be reached through regions of such log-odds.
    """
    odds = forest.score(features)
    odds[0] = -np.inf
    probable = odds >= min(spread, level)
    # components of the probable regions that touch: those with a sure one lie outside as a whole
    touching = graph.ends[(graph.edges[:, EDGE.open] > 0) & probable[graph.ends].all(axis=1)]
    first, second = touching.astype(np.int64).T
    component = components(first, second, len(odds))
    sure = np.zeros(len(odds), np.bool_)
    sure[component[odds >= level]] = True
    return np.asarray(probable & sure[component])


def without_regions(graph: RegionGraph, left_out: Mask) -> RegionGraph:
    """The graph without some regions, whose numbers stay: what was open to them is open to unknown space.

    Args:
        graph: The regions; not changed.
        left_out: bool (k + 1,).
    """
    if not left_out.any():
        return graph
    nodes, rooms = graph.nodes.copy(), graph.rooms.copy()
    gone = left_out[graph.ends]
    for side in (0, 1):
        # of a contact with one region that is left out, the sides of the other one
        lost = gone[:, 1 - side] & ~gone[:, side]
        np.add.at(nodes[:, NODE.open_end], graph.ends[lost, side], graph.edges[lost, EDGE.open])
    nodes[left_out] = 0.0
    rooms[left_out] = 0.0
    stays = ~gone.any(axis=1)
    return replace(graph, nodes=nodes, ends=graph.ends[stays], edges=graph.edges[stays], rooms=rooms)
