"""Layout methods that judge frontiers: on a drawing with known answers, and where they find nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.pipeline import method_names, reconstruct
from layoutexplore.layout.types import Details, RoomReach
from layoutexplore.predictors import make_room_predictor
from layoutexplore.predictors.reconstructed import ReconstructedRooms
from layoutexplore.predictors.seen_regions import known_part, placed
from tests.predictors.cases import decide

HALF_SEEN = """
????????????????????????????
?##########################?
?#........#??????#.........?
?#........#......#.........?
?#...............#.........?
?#...............#.........?
?#........#......#.........?
?#........#......#.........?
?#........####.###..######.?
?#.........................?
?#.........................?
?##########################?
????????????????????????????
"""
"""Half metres. The middle room lacks 3 m by 0.5 m below its upper wall; the right one its right wall."""

SCALE = 5
METHODS = [f"reconstruct:{name}" for name in method_names()]


def drawn(text: str, *, mirror: bool = False) -> OccupancyGrid:
    lines = text.split()[::-1]
    cells = np.array([[{"#": 100, ".": 0, "?": -1}[c] for c in line] for line in lines], np.int8)
    fine = np.kron(cells, np.ones((SCALE, SCALE), np.int8))
    return OccupancyGrid(np.ascontiguousarray(fine[:, ::-1] if mirror else fine), 0.1, Pose(-3.0, 2.0, 0.0))


def at(decision: Decision, row: int, col: int) -> Frontier:
    """The frontier that holds a cell of the drawing, counted from below."""
    here = np.array([row * SCALE + SCALE // 2, col * SCALE + SCALE // 2])
    return min(decision.frontiers, key=lambda f: float(np.abs(f.cells - here).sum(axis=1).min()))


@pytest.mark.parametrize("method", ["rose2", "ias15", "default;completion=lines", "distance"])
def test_lines_complete_a_room_and_close_its_frontier(method: str) -> None:
    judged = make_room_predictor(f"reconstruct:{method}").predict(decide(drawn(HALF_SEEN)))
    inside, corridor = at(judged, 9, 13), at(judged, 2, 26)
    assert inside.is_closed and inside.expected_area == pytest.approx(1.5, abs=0.5)  # 3 m by 0.5 m
    assert not corridor.is_closed  # no wall bounds it on the right
    labels = judged.rooms.labels
    hidden = labels[10 * SCALE + 2, 13 * SCALE]
    assert hidden > 0 and hidden == labels[8 * SCALE, 13 * SCALE]  # the room's own, up to the wall's line


def two_rooms() -> OccupancyGrid:
    """Cells of 0.1 m, walls of one cell; a room of 4.9 m by 4.2 m whose corner of 2 m by 1 m is unseen.

    With the corner, 2 m of the upper wall and 1 m of the right one are unseen. The room beside it opens to
    the outside through a gap of 1 m.
    """
    cells = np.full((64, 94), -1, np.int8)
    cells[10:54, [10, 60, 84]] = cells[[10, 53], 10:85] = 100
    cells[11:53, 11:60] = cells[11:53, 61:84] = 0
    cells[26:35, 60] = cells[20:30, 84:90] = 0
    cells[43:54, 40:61] = -1
    return OccupancyGrid(cells, 0.1)


@pytest.mark.parametrize(
    ("method", "cells"),
    [
        ("rose2", 210),  # lines through the walls' middles; cells on the right line count, on the upper not
        ("distance", 210),  # completed by the same lines
        ("doorways", 210),
        ("default", 231),  # its faces reach into the walls: 20 cells of the upper one, 10 of the right, 1
        ("ias15", 231),  # Canny finds both sides of a wall, the median runs along the outer ones: 21 by 11
    ],
)
def test_class_room_and_area_follow_from_the_lines_by_hand(method: str, cells: int) -> None:
    decision = decide(two_rooms())
    judged = make_room_predictor(f"reconstruct:{method}").predict(decision)
    corner = [f for f in judged.frontiers if f.cells[:, 1].max() < 62]  # from both sides of the unseen wall
    outside = [f for f in judged.frontiers if f.cells[:, 1].min() > 80]
    assert len(corner) == 2 and len(outside) == 1 and not outside[0].is_closed
    seen = judged.rooms.labels[12, 12]
    for frontier in corner:
        assert frontier.is_closed and frontier.room == seen > 0
        assert frontier.expected_area == pytest.approx(0.01 * cells)
    inner = judged.rooms.labels[43:52, 40:59]  # what all methods agree on
    assert (inner == seen).all()


@pytest.mark.parametrize(
    "predictor", [*("reconstruct:rose2", "reconstruct:default", "reconstruct:distance"), *("none", "hull")]
)
def test_what_an_open_frontier_promises_does_not_depend_on_the_size_of_the_array(predictor: str) -> None:
    grid = two_rooms()
    wide = OccupancyGrid(np.pad(grid.cells, 40, constant_values=-1), 0.1, Pose(-4.0, -4.0, 0.0))
    areas = []
    for known in (grid, wide):
        judged = make_room_predictor(predictor).predict(decide(known))
        (outside,) = [f for f in judged.frontiers if f.centroid[0] > 8.0]
        assert not outside.is_closed
        areas.append(outside.expected_area)
    assert areas[0] == pytest.approx(areas[1]) and areas[0] == pytest.approx(outside.visible_area)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_keeps_the_protocol(name: str) -> None:
    decision = decide(drawn(HALF_SEEN))
    before = decision.grid.cells.copy()
    predictor = make_room_predictor(name)
    judged, again = predictor.predict(decision), make_room_predictor(name).predict(decision)
    assert (decision.grid.cells == before).all()
    for first, second in zip(judged.table, again.table, strict=True):
        assert (first == second).all()
    assert isinstance(judged.rooms, ReconstructedRooms)
    rooms, cells = predictor.rooms(decision), decision.grid.cells
    assert rooms.room_ids.dtype == judged.rooms.labels.dtype == np.int32
    assert not rooms.passable[cells == 100].any() and rooms.passable[cells == 0].all()
    assert not judged.rooms.labels[cells == 100].any()
    assert set(np.unique(judged.rooms.inside)) <= {0.0, 1.0} and not judged.rooms.inside[cells != -1].any()
    assert all(f.is_closed is not None and (f.expected_area or 0.0) >= 0.0 for f in judged.frontiers)


@pytest.mark.parametrize("name", METHODS)
def test_a_mirrored_map_has_the_same_classes(name: str) -> None:
    plain = make_room_predictor(name).predict(decide(drawn(HALF_SEEN)))
    mirrored = make_room_predictor(name).predict(decide(drawn(HALF_SEEN, mirror=True)))
    width = plain.grid.shape[1]
    assert plain.frontiers
    for frontier in plain.frontiers:
        row, col = frontier.cells[0].tolist()
        twin = next(f for f in mirrored.frontiers if (f.cells == (row, width - 1 - col)).all(axis=1).any())
        assert twin.is_closed == frontier.is_closed
        assert twin.expected_area == pytest.approx(frontier.expected_area)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("text", ["?????\n?...?\n?...?\n?????", "?????\n?###?\n?...?\n?????"])
def test_where_no_walls_close_a_room_frontiers_are_open(name: str, text: str) -> None:
    judged = make_room_predictor(name).predict(decide(drawn(text)))
    assert len(judged.frontiers) and all(frontier.is_closed is False for frontier in judged.frontiers)


@pytest.mark.parametrize("name", METHODS)
def test_without_frontiers_nothing_is_asked(name: str) -> None:
    decision = decide(drawn("####\n#..#\n#..#\n####"))
    assert not decision.frontiers and make_room_predictor(name).predict(decision) is decision


def test_the_size_of_the_grid_tells_nothing() -> None:
    small = drawn(HALF_SEEN)
    cells = np.full((small.shape[0] + 90, small.shape[1] + 170), -1, np.int8)
    cells[30:-60, 120:-50] = small.cells
    large = OccupancyGrid(cells, 0.1, Pose(small.origin.x - 12.0, small.origin.y - 3.0, 0.0))
    predictor = make_room_predictor("reconstruct:rose2")
    first, second = predictor.predict(decide(small)), predictor.predict(decide(large))
    assert (first.rooms.labels == second.rooms.labels[30:-60, 120:-50]).all()
    assert (first.table.closed == second.table.closed).all()


def test_walls_that_have_not_changed_are_not_reconstructed_again() -> None:
    predictor, grid = make_room_predictor("reconstruct:rose2"), drawn(HALF_SEEN)
    first = predictor.predict(decide(grid)).rooms
    seen = grid.cells.copy()
    seen[seen == -1] = np.where(np.arange((seen == -1).sum()) % 97 == 0, 0, -1)
    seen[:SCALE], seen[-SCALE:] = -1, -1
    second = predictor.predict(decide(OccupancyGrid(seen, 0.1, grid.origin))).rooms
    assert second.layout is first.layout


def test_lines_are_kept_while_walls_hardly_grow_and_rooms_follow_what_is_seen() -> None:
    grid = drawn(HALF_SEEN)
    seen = grid.cells  # a robot's map is written into the same array
    kept, anew = (make_room_predictor(name) for name in ("reconstruct:rose2", "reconstruct:rose2;growth=0"))
    first, other = (predictor.predict(decide(grid)).rooms.layout for predictor in (kept, anew))
    seen[10 * SCALE, 12 * SCALE : 12 * SCALE + 3] = 100  # of 830 wall cells
    seen[9 * SCALE + 2, 10 * SCALE + 2 : 13 * SCALE] = 0
    again = kept.predict(decide(grid))
    assert again.rooms.layout is first and anew.predict(decide(grid)).rooms.layout is not other
    assert (again.rooms.labels[seen == 0] > 0).any() and not again.rooms.labels[seen == 100].any()
    assert at(again, 9, 13).is_closed


@dataclass(frozen=True, eq=False)
class Reaching(Details):
    """Of a layout whose rooms reach over given cells."""

    reach: RoomReach

    @property
    def room_reach(self) -> RoomReach:
        return self.reach


def test_a_room_of_the_lines_of_which_no_cell_is_seen_opens_and_closes_nothing() -> None:
    grid = drawn(HALF_SEEN)
    layout = reconstruct(known_part(grid), "distance")
    labels = np.zeros(layout.labels.shape, np.int32)
    labels[:5, :5] = 9
    assert not labels[layout.clean_grid.cells != -1].any()
    far = replace(layout, details=Reaching(RoomReach(labels, np.arange(10) == 9)))
    with_far, without = ReconstructedRooms(grid, layout, far).rooms, ReconstructedRooms(grid, layout).rooms
    assert (with_far.room_ids == without.room_ids).all() and (with_far.passable == without.passable).all()


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_labels_are_placed_where_their_cells_lie(turn: float) -> None:
    origin = Pose(1.0, 2.0, turn)
    grid = OccupancyGrid(np.zeros((6, 9), np.int8), 0.1, origin)
    frame = OccupancyGrid(np.zeros((5, 20), np.int8), 0.1, Pose(*grid.cell_to_world(1.5, -4.5), turn))
    labels = np.arange(1, 101, dtype=np.int32).reshape(5, 20)
    expected = np.zeros((6, 9), np.int32)
    expected[2:] = labels[:4, 4:13]
    assert (placed(labels, frame, grid) == expected).all()


def test_known_part_keeps_the_world() -> None:
    grid = drawn(HALF_SEEN)
    turned = OccupancyGrid(grid.cells, 0.1, Pose(1.0, 2.0, 0.7))
    part = known_part(turned)
    row, col = np.argwhere(part.cells == 100)[0]
    x, y = part.cell_to_world(row, col)
    assert turned.cells[turned.world_to_cell(x, y)] == 100


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("reconstruct:rose3", "rose2"),
        ("reconstruct:rose2;sigmo=0.1", "sigma"),
        ("reconstruct:rose2;completion=hull", "faces"),
        ("reconstruct:rose2;sigma", "key=value"),
        ("reconstruct:rose2;sigma=0.1;sigma=0.2", "twice"),
        ("reconstruct:rose2,sigma=wide", "a number"),
        ("reconstruct:rose2,sigma=-1", "predictor reconstruct:rose2,sigma=-1: sigma"),
        ("reconstruct:rose2;growth=1", "reconstruct:rose2;growth=1: growth"),
        ("reconstruct:distance;growth=much", "a number"),
    ],
)
def test_bad_specs_are_told(spec: str, said: str) -> None:
    with pytest.raises((ConfigError, UnknownNameError), match=said):
        make_room_predictor(spec)


def test_options_reach_the_method_and_name_the_predictor() -> None:
    assert make_room_predictor("reconstruct:rose2, sigma=0.20").name == "reconstruct:rose2;sigma=0.2"
    assert make_room_predictor("reconstruct:rose2;growth=0").name == "reconstruct:rose2;growth=0"
    assert make_room_predictor("reconstruct:rose2;growth=0.01").name == "reconstruct:rose2"
    assert make_room_predictor("reconstruct").name == "reconstruct:rose2"
