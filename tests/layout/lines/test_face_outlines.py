"""Faces painted into cells, and the outlines of unions of faces."""

from __future__ import annotations

import itertools

import numpy as np
import shapely
from hypothesis import given, settings

from layoutexplore.grids.grid import Pose
from layoutexplore.layout.frame import to_world
from layoutexplore.layout.lines.assemble import polygons_to_world
from layoutexplore.layout.lines.face_clusters import dissolve
from layoutexplore.layout.lines.face_outlines import outline, paint_faces
from tests.layout.lines.cases import BOX, arrangement_of, lines, seeds


@given(lines)
@settings(max_examples=40, deadline=None)
def test_every_cell_centre_is_painted_with_the_face_that_holds_it(drawn):
    arrangement = arrangement_of(drawn)
    image = paint_faces(arrangement, (33, 41), 0.25)
    corners, offsets = arrangement.rings
    polygons = np.array([shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)])
    rows, cols = np.mgrid[:33, :41]
    centres = shapely.points((cols.ravel() + 0.5) * 0.25, (rows.ravel() + 0.5) * 0.25)
    painted = image.ravel()
    inside = painted >= 0
    assert (shapely.distance(polygons[painted[inside]], centres[inside]) < 1e-4).all()
    box = shapely.box(*BOX)
    assert (shapely.distance(box.exterior, centres[~inside & shapely.contains(box, centres)]) < 1e-4).all()


@given(lines, seeds)
@settings(max_examples=40, deadline=None)
def test_outlines_are_the_union_of_their_faces(drawn, seed):
    arrangement = arrangement_of(drawn)
    rng = np.random.default_rng(seed)
    group, count = dissolve(arrangement, rng.random(len(arrangement.line)) < 0.4)
    corners, offsets = arrangement.rings
    faces = np.array([shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)])
    for index, polygon in enumerate(outline(arrangement, group, count)):
        union = shapely.union_all(faces[group == index])
        assert polygon.is_valid
        assert polygon.symmetric_difference(union).area < 1e-3


def test_a_corner_on_another_side_stays_valid_when_moved() -> None:
    shell, corner = [(0, 0), (7, 1), (6, 9), (1, 8)], (3.5, 0.5)
    touching = shapely.Polygon(shell, [[corner, (4, 4), (3, 4)]])
    angles = np.linspace(0, np.pi, 50)
    origins = [Pose(1.1, 0.7, angle) for angle in angles.tolist()]
    plain = [shapely.transform(touching, lambda p, o=origin: to_world(p, o)) for origin in origins]
    assert not all(polygon.is_valid for polygon in plain)
    for origin in origins:
        (moved,) = polygons_to_world([touching], origin)
        assert moved.is_valid and abs(moved.area - touching.area) < 1e-6
