"""What lies in line with a contact is found whatever way the contact runs."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.layout.merging.adjacency_graph import GraphEvidence, region_graph
from layoutexplore.layout.merging.door_gaps import DoorGapConfig, find_door_gaps
from layoutexplore.layout.merging.graph_tables import EDGE
from layoutexplore.layout.merging.line_evidence import find_evidence


@pytest.mark.parametrize("degrees", [0, 20, 36, 45, 72, 90, 108, 144])
def test_the_wall_in_line_with_a_contact_is_seen_at_any_angle(degrees: int) -> None:
    """A wall of 1 m on one side of an opening and of 4 m on the other, at 0.05 m."""
    angle = math.radians(degrees)
    rows, cols = np.mgrid[0:300, 0:300] - 150.0
    along = cols * math.cos(angle) + rows * math.sin(angle)
    across = rows * math.cos(angle) - cols * math.sin(angle)
    wall = (np.abs(across) <= 2) & (along > -29) & (along < 89) & (np.abs(along) >= 9)
    labels = np.where(across > 0, 1, 2).astype(np.int32)
    labels[wall | ((np.abs(along) >= 9) & (np.abs(across) < 3))] = 0
    cells = np.where(wall, OCCUPIED, FREE).astype(np.int8)
    graph = region_graph(
        labels,
        free=cells == FREE,
        clutter=np.zeros_like(wall),
        wall=wall,
        distance=cv2.distanceTransform((~wall).view(np.uint8), cv2.DIST_L2, 5),
        gaps=find_door_gaps(wall, 0.05, DoorGapConfig(), np.array([angle] if degrees % 90 else [])),
        evidence=GraphEvidence(find_evidence(cells, wall, 0.05), np.zeros((0, 0, 0), np.float32)),
        resolution=0.05,
    )
    edge = graph.edges[graph.edges[:, EDGE.open].argmax()]
    sides = edge[EDGE.open]
    # 20 of 30 cells of the near reach on the short side, all of them on the long one
    assert edge[EDGE.near_min] / sides == pytest.approx(20 / 30, abs=0.17)
    assert edge[EDGE.near] / sides == pytest.approx(20 / 30 + 1, abs=0.4)
    # so few sides tell of a direction that is some degrees off: a long wall is followed for a part of it
    assert 0.2 < edge[EDGE.far] / sides < 0.48
    assert edge[EDGE.door] / sides > 0.8
    assert edge[EDGE.width] / edge[EDGE.door] == pytest.approx(0.85, abs=0.15)
