"""Which regions lie outside the building, and the graph without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore import reconstruct
from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.method import MergingConfig, run_merging
from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST, outside_regions, without_regions
from layoutexplore.layout.merging.ray_fans.features import RegionFeatures
from tests.layout.merging.cases import graphs, office


def with_a_fan() -> tuple[OccupancyGrid, np.ndarray]:
    """The office of the tests with a window, and beams that fan out of it over unknown ground."""
    grid = office()
    cells = np.full((260, 420), UNKNOWN, np.int8)
    cells[:, :280] = grid.cells
    cells[40:58, 262:280][cells[40:58, 262:280] == OCCUPIED] = FREE
    fan = np.zeros(cells.shape, bool)
    for angle in np.linspace(-0.6, 0.6, 25):
        for distance in np.arange(0, 140, 0.5):
            row, col = round(49 + distance * np.sin(angle)), round(272 + distance * np.cos(angle))
            if 0 <= row < 260 and col < 420:
                fan[row, col] = True
    fan &= cells == UNKNOWN
    cells[fan] = FREE
    return OccupancyGrid(cells, 0.05), fan


def test_beams_that_leave_the_building_make_no_room() -> None:
    grid, fan = with_a_fan()
    far = fan & (np.arange(420)[None, :] > 300)
    kept = run_merging(grid, MergingConfig(fan_level=np.inf)).labels
    layout = reconstruct(grid, "default")
    assert (kept[far] > 0).mean() > 0.7
    assert (layout.labels[far] > 0).mean() < 0.2
    assert len(layout.rooms) == 7
    alone = reconstruct(office(), "default").labels
    inside = np.pad(alone > 0, ((0, 0), (0, 140)))
    assert (layout.labels[inside] > 0).all()


def test_no_room_of_a_closed_office_lies_outside() -> None:
    grid = office(clutter=True)
    assert np.array_equal(
        run_merging(grid, MergingConfig(fan_level=np.inf)).labels, reconstruct(grid, "default").labels
    )


@given(graphs(), st.integers(0, 10**6))
def test_what_was_open_to_a_lost_region_is_open_to_the_unknown(graph: RegionGraph, seed: int) -> None:
    lost = np.random.default_rng(seed).random(len(graph.nodes)) < 0.4
    lost[0] = False
    left = without_regions(graph, lost)
    for k in range(1, len(graph.nodes)):
        if lost[k]:
            assert not left.nodes[k].any() and not left.rooms[k].any() and not (left.ends == k).any()
            continue
        freed = 0.0
        for (a, b), edge in zip(graph.ends.tolist(), graph.edges, strict=True):
            if k in (a, b) and lost[a + b - k]:
                freed += edge[EDGE.open]
        expected = graph.nodes[k].copy()
        expected[NODE.open_end] += freed
        np.testing.assert_array_equal(left.nodes[k], expected)
    kept = ~lost[graph.ends].any(axis=1)
    np.testing.assert_array_equal(left.edges, graph.edges[kept])


def test_the_graph_is_not_changed() -> None:
    nodes = np.ones((4, len(NODE)))
    graph = RegionGraph(
        nodes, np.array([[1, 2], [2, 3]], np.int32), np.ones((2, len(EDGE))), np.ones((4, 1)), 0.05
    )
    before = replace(graph, nodes=nodes.copy())
    without_regions(graph, np.array([False, False, True, False]))
    assert np.array_equal(graph.nodes, before.nodes)
    assert without_regions(graph, np.zeros(4, bool)) is graph


@given(graphs(), st.integers(0, 10**6))
def test_a_sure_region_takes_along_the_probable_ones_it_leads_to(graph: RegionGraph, seed: int) -> None:
    x = np.random.default_rng(seed).normal(size=(len(graph.nodes), len(RegionFeatures._fields)))
    forest = FAN_FOREST.load()
    odds = forest.score(x)
    level, spread = float(np.quantile(odds, 0.8)), float(np.quantile(odds, 0.3))
    expected = set((np.flatnonzero(odds[1:] >= level) + 1).tolist())
    while True:
        more = set(expected)
        for (a, b), edge in zip(graph.ends.tolist(), graph.edges, strict=True):
            if edge[EDGE.open] > 0:
                more |= {n for m, n in ((a, b), (b, a)) if m in expected and odds[n] >= spread}
        if more == expected:
            break
        expected = more
    found = outside_regions(graph, x, forest, level=level, spread=spread)
    assert set(np.flatnonzero(found).tolist()) == expected
    alone = outside_regions(graph, x, forest, level=level, spread=np.inf)
    assert np.array_equal(alone[1:], odds[1:] >= level) and not alone[0]


def test_the_model_of_pairs_is_none_of_regions() -> None:
    with pytest.raises(ConfigError, match="other features"):
        FAN_FOREST.load(PAIR_FOREST.shipped)
