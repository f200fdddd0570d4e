"""The Voronoi graph of the walls."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial import Voronoi, cKDTree

from layoutexplore.layout.survey.voronoi_graph import contour_cells, critical_points, voronoi_edges


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.bool_, (34, 41), elements=st.sampled_from([True, True, True, False])))
def test_the_voronoi_graph_has_the_edges_of_the_diagram(free: np.ndarray) -> None:
    sites = contour_cells(free)
    if len(sites) < 3 or np.linalg.matrix_rank(sites - sites[0]) < 2:  # on one line: no edge is finite
        assert len(voronoi_edges(sites, free.shape)) == 0
        return
    diagram = Voronoi(sites.astype(float))
    pairs = np.array([pair for pair in diagram.ridge_vertices if min(pair) >= 0], np.int64).reshape(-1, 2)
    ends = diagram.vertices[np.unique(pairs)]
    rounded = ends.round(4)  # what is a hair beyond the border lies on it
    inside = ends[(rounded >= 0).all(axis=1) & (rounded < free.shape).all(axis=1)]
    edges = voronoi_edges(sites, free.shape).reshape(-1, 2)
    assert len(inside) == 0 or cKDTree(edges).query(inside)[0].max() < 1e-6


def slow_critical_points(graph: np.ndarray, distance: np.ndarray, neighbourhood: int) -> list[list[int]]:
    """As the authors write it: sets of cells, each counted as often as one beside it is met."""
    left, found = {tuple(cell) for cell in np.argwhere(graph).tolist()}, []
    for start in sorted(left):
        if start not in left:
            continue
        stretch, order, count = {start}, [start], 0
        for _ in range(150):
            ring = [
                (r + i, c + j)
                for r, c in order
                for i in (-1, 0, 1)
                for j in (-1, 0, 1)
                if (r + i, c + j) in left - stretch
            ]
            count += len(ring)
            order += [cell for cell in dict.fromkeys(ring) if cell not in stretch]
            stretch |= {*ring}
            if count > neighbourhood // max(int(distance[start]), 1):
                break
        left -= stretch
        found.append(min(order, key=lambda cell: distance[cell]))
    return [list(cell) for cell in found]


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(np.bool_, (12, 14), elements=st.sampled_from([True, False, False])),
    hnp.arrays(np.uint8, (12, 14), elements=st.integers(1, 9)),
    st.integers(1, 60),
)
def test_stretches_of_the_graph_are_counted_as_the_authors_do(
    graph: np.ndarray, distance: np.ndarray, neighbourhood: int
) -> None:
    points = critical_points(graph.astype(np.uint8), distance, neighbourhood, 150)
    assert points.tolist() == slow_critical_points(graph, distance, neighbourhood)
