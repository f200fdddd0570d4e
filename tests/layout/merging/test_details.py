"""Details of merged layouts: lines, faces and scores, and that they agree with the rooms."""

from __future__ import annotations

import itertools
import json
import pickle

import numpy as np
import pytest
import shapely

from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.export import layout_to_geojson
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import BORDER, FaceKind, Layout


def plan(furniture: bool = False) -> OccupancyGrid:
    """A corridor of 2 m, rooms of 4 m and 6 m by 5 m beside it, a hall of 10 m by 4 m opposite; 0.05 m."""
    cells = np.full((254, 232), -1, np.int8)
    cells[10:246, 10:222] = 100
    for rows, cols in (
        ((14, 114), (14, 94)),
        ((14, 114), (98, 218)),
        ((118, 158), (14, 218)),
        ((162, 242), (14, 218)),
    ):
        cells[rows[0] : rows[1], cols[0] : cols[1]] = 0
    for rows, col in (((114, 118), 40), ((114, 118), 150), ((158, 162), 100)):
        cells[rows[0] : rows[1], col : col + 18] = 0
    if furniture:
        cells[60:70, 30:44] = cells[190:196, 60:90] = 100
    return OccupancyGrid(cells, 0.05, Pose(3.0, -2.0, 0.4))


def union(layout: Layout, room: int) -> shapely.Geometry:
    return shapely.union_all([layout.faces[i].polygon for i in layout.rooms[room].faces])


def test_the_faces_of_a_room_cover_it() -> None:
    layout = reconstruct(plan())
    assert len(layout.rooms) == 4
    for room in layout.rooms:
        assert room.faces and all(layout.faces[i].room == room.id for i in room.faces)
        faces = union(layout, room.id - 1)
        assert faces.intersection(room.polygon).area > 0.85 * faces.union(room.polygon).area
    assert {face.kind for face in layout.faces} >= {FaceKind.INTERNAL, FaceKind.EXTERNAL}
    assert all(face.room == 0 for face in layout.faces if face.kind is FaceKind.EXTERNAL)


def test_faces_fill_the_box_and_know_their_neighbours() -> None:
    layout = reconstruct(plan())
    corners = [point for line in layout.lines[-4:] for point in (line.start, line.end)]
    box = shapely.MultiPoint(corners).convex_hull
    assert sum(line.is_border for line in layout.lines) == 4
    assert sum(face.polygon.area for face in layout.faces) == pytest.approx(box.area)
    for a, b in itertools.combinations(layout.faces, 2):
        assert a.polygon.intersection(b.polygon).area < 1e-6
    for face in layout.faces:
        assert all(face.id in layout.faces[other].neighbours for other in face.neighbours)
        assert all(
            0 <= edge.weight <= 1 and (edge.line == BORDER or edge.line < len(layout.lines) - 4)
            for edge in face.edges
        )
    for wall in layout.walls:
        line = layout.lines[wall.line]
        assert line.direction == wall.direction and not line.is_border
        assert line.angle == layout.directions[wall.direction]


def test_walls_between_rooms_are_covered_and_doors_are_not() -> None:
    layout = reconstruct(plan())
    hall, corridor = (layout.room_labels()[row, 60] for row in (200, 140))
    edges = [e for i in layout.rooms[hall - 1].faces for e in layout.faces[i].edges]
    between = [e for e in edges if e.neighbour >= 0 and layout.faces[e.neighbour].room == corridor]
    lengths = np.array([np.hypot(e.end[0] - e.start[0], e.end[1] - e.start[1]) for e in between])
    assert lengths.sum() > 9.5
    assert np.average([e.weight for e in between], weights=lengths) > 0.8


def test_a_room_without_walls_of_its_own_gets_lines() -> None:
    grid = plan()
    cells = grid.cells.copy()
    cells[:, 130:] = -1  # half of the large room, of the corridor and of the hall have not been seen
    layout = reconstruct(OccupancyGrid(cells, grid.resolution))
    assert all(room.faces for room in layout.rooms)
    assert any(line.weight < 0.05 and not line.is_border for line in layout.lines)
    assert any(
        layout.faces[i].kind is FaceKind.PARTIAL
        for room in layout.rooms
        if room.is_partial
        for i in room.faces
    )


def test_scores_tell_walls_from_furniture() -> None:
    grid = plan(furniture=True)
    layout = reconstruct(grid)
    scores = layout.cell_scores
    assert scores is not None and scores.shape == grid.shape and scores.max() == 1.0
    assert not scores[~grid.occupied].any()
    furniture = grid.occupied & plan().free
    assert np.median(scores[furniture & (scores > 0)]) < np.median(scores[~furniture & (scores > 0)])


def test_details_are_computed_late_from_what_the_layout_keeps() -> None:
    grid = plan(furniture=True)
    first, second = reconstruct(grid), reconstruct(grid)
    eager = json.dumps(layout_to_geojson(first)), first.cell_scores
    grid.cells[:] = -1  # the mapper writes into the same array
    late = pickle.loads(pickle.dumps(second))
    assert json.dumps(layout_to_geojson(late)) == eager[0]
    assert np.array_equal(late.cell_scores, eager[1])
    kinds = {feature["properties"]["kind"] for feature in layout_to_geojson(late)["features"]}
    assert kinds == {"room", "face", "line", "wall"}
    assert draw_layout(late, panel=120).shape[1] % 5 == 0  # map, clean map, lines, faces, rooms


def test_exported_faces_know_their_neighbours() -> None:
    layout = reconstruct(plan())
    features = [
        f["properties"] for f in layout_to_geojson(layout)["features"] if f["properties"]["kind"] == "face"
    ]
    weights = {(f["id"], n["face"]): n["weight"] for f in features for n in f["neighbours"]}
    for face in layout.faces:
        assert [n["face"] for n in features[face.id]["neighbours"]] == list(face.neighbours)
    assert all(weights[b, a] == weight and 0 <= weight <= 1 for (a, b), weight in weights.items())
    hall, corridor = (layout.room_labels()[row, 60] for row in (200, 140))
    between = [
        w for (a, b), w in weights.items() if (layout.faces[a].room, layout.faces[b].room) == (hall, corridor)
    ]
    assert between and max(between) > 0.8


def test_a_map_without_walls_has_no_lines() -> None:
    layout = reconstruct(OccupancyGrid(np.zeros((60, 60), np.int8), 0.05))
    assert layout.lines == layout.faces == ()
    assert all(room.faces == () for room in layout.rooms)
    assert layout.cell_scores is not None and not layout.cell_scores.any()
