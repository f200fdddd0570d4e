"""The Voronoi graph of the walls."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial import Voronoi

from layoutexplore.layout.survey.voronoi_graph import contour_cells, voronoi_edges


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.bool_, (34, 41), elements=st.sampled_from([True, True, True, False])))
def test_the_voronoi_graph_has_the_edges_of_the_diagram(free: np.ndarray) -> None:
    sites = contour_cells(free)
    if len(sites) < 3 or np.linalg.matrix_rank(sites - sites[0]) < 2:  # on one line: no edge is finite
        assert len(voronoi_edges(sites, free.shape)) == 0
        return
    diagram = Voronoi(sites.astype(float))
    pairs = np.array([pair for pair in diagram.ridge_vertices if min(pair) >= 0], np.int64).reshape(-1, 2)
    ends = diagram.vertices[np.unique(pairs)].round(4)
    inside = ends[(ends >= 0).all(axis=1) & (ends < free.shape).all(axis=1)]
    edges = voronoi_edges(sites, free.shape).reshape(-1, 2)
    assert {tuple(end) for end in inside.tolist()} <= {tuple(end) for end in edges.round(4).tolist()}
