"""The default method: plans with a known answer, symmetries, hard inputs, and the parts it is made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.alignment import main_direction, turn, turn_back
from layoutexplore.layout.merging.agglomeration import FEATURES, merge_pieces
from layoutexplore.layout.merging.door_gaps import LONG, SHORT, WIDTH, OpeningConfig, find_openings
from layoutexplore.layout.merging.merge_forest import load_forest, save_forest
from layoutexplore.layout.merging.method import DefaultConfig
from layoutexplore.layout.merging.watershed import closed_space, distance_basins
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import Layout
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import TrainingConfig, first_forest, train_forest


def office(clutter: bool = False) -> OccupancyGrid:
    """A corridor of 2 m with three rooms of 4 m x 5 m on either side, doors of 0.9 m, at 0.05 m; walls of 0.2 m."""
    cells = np.full((260, 280), -1, np.int8)
    cells[10:250, 10:270] = 100
    cells[110:150, 14:266] = 0
    for k in range(3):
        left = 14 + 84 * k + (2 if k == 2 else 0)
        for rows, door in (((14, 106), (106, 110)), ((154, 246), (150, 154))):
            cells[rows[0] : rows[1], left : left + 80] = 0
            cells[door[0] : door[1], left + 30 : left + 48] = 0
    if clutter:
        rng = np.random.default_rng(3)
        for r, c in rng.integers(20, 240, (25, 2)):
            if (cells[r - 2 : r + 6, c - 2 : c + 6] == 0).all():
                cells[r : r + 3, c : c + 3] = 100
    return OccupancyGrid(cells, 0.05)


def check_layout(layout: Layout, grid: OccupancyGrid) -> None:
    assert layout.labels.shape == grid.shape and layout.labels.dtype == np.int32
    assert not layout.labels[grid.occupied].any()
    assert sorted(np.unique(layout.labels[layout.labels > 0])) == [room.id for room in layout.rooms]
    shapes = [room.polygon for room in layout.rooms]
    assert all(isinstance(s, shapely.Polygon) and s.is_valid and s.area > 0 for s in shapes)
    assert sum(s.area for s in shapes) == pytest.approx(
        shapely.union_all(shapes).area if shapes else 0.0, abs=1e-6
    )
    assert layout.rooms or layout.warnings


@pytest.mark.parametrize("clutter", [False, True])
def test_an_office_is_a_corridor_and_six_rooms(clutter: bool) -> None:
    grid = office(clutter)
    layout = reconstruct(grid)
    check_layout(layout, grid)
    assert len(layout.rooms) == 7
    assert layout.labels[130, 20] == layout.labels[130, 260] > 0
    again = reconstruct(grid)
    assert (again.labels == layout.labels).all()
    assert all(a.polygon.equals(b.polygon) for a, b in zip(again.rooms, layout.rooms, strict=True))


def same_partition(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the cells that differ, at the best naming of the rooms."""
    table = np.zeros((a.max() + 1, b.max() + 1), int)
    np.add.at(table, (a.ravel(), b.ravel()), 1)
    return 1.0 - table.max(axis=1).sum() / a.size


@pytest.mark.parametrize("name", ["rot90", "rot180", "flip", "transpose"])
def test_turned_and_flipped_maps_give_the_same_rooms(name: str) -> None:
    moves = {
        "rot90": np.rot90,
        "rot180": lambda m: np.rot90(m, 2),
        "flip": np.fliplr,
        "transpose": np.transpose,
    }
    move, grid = moves[name], office()
    straight = reconstruct(grid)
    moved = reconstruct(OccupancyGrid(np.ascontiguousarray(move(grid.cells)), 0.05))
    assert len(moved.rooms) == len(straight.rooms)
    assert same_partition(move(straight.labels), moved.labels) < 0.01


def test_resolution_and_grid_scaled_together_leave_the_rooms_in_place() -> None:
    grid = office()
    coarse = reconstruct(OccupancyGrid(grid.cells[::2, ::2], 0.1))
    fine = reconstruct(grid)
    assert len(coarse.rooms) == len(fine.rooms)
    for room in fine.rooms:
        best = max(room.polygon.intersection(other.polygon).area / room.area for other in coarse.rooms)
        assert best > 0.9


def test_a_turned_origin_moves_the_rooms_with_the_grid() -> None:
    grid = office()
    placed = OccupancyGrid(grid.cells, 0.05, Pose(10.0, -3.0, np.pi / 2))
    here, there = reconstruct(grid), reconstruct(placed)
    assert (here.labels == there.labels).all()
    x, y = here.rooms[0].polygon.centroid.coords[0]
    assert there.rooms[0].polygon.centroid.coords[0] == pytest.approx((10.0 - y, -3.0 + x))
    assert np.sort(there.directions) == pytest.approx(
        np.sort(np.mod(here.directions + np.pi / 2, np.pi)), abs=1e-6
    )


def test_walls_askew_are_turned_first() -> None:
    grid = office()
    rows, cols = np.mgrid[0:380, 0:380]
    c, s = np.cos(0.3), np.sin(0.3)
    x, y = (
        np.rint(c * (cols - 190) + s * (rows - 190) + 140).astype(int),
        np.rint(c * (rows - 190) - s * (cols - 190) + 130).astype(int),
    )
    inside = (x >= 0) & (x < 280) & (y >= 0) & (y < 260)
    cells = np.where(inside, grid.cells[np.clip(y, 0, 259), np.clip(x, 0, 279)], -1).astype(np.int8)
    layout = reconstruct(OccupancyGrid(cells, 0.05))
    check_layout(layout, OccupancyGrid(cells, 0.05))
    assert len(layout.rooms) == 7


def hard(name: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:200, 0:200]
    radius = np.hypot(x - 100, y - 100)
    shapes = {
        "all unknown": np.full((50, 60), -1),
        "all free": np.zeros((50, 60)),
        "all occupied": np.full((50, 60), 100),
        "one free cell": np.where((x == 100) & (y == 100), 0, -1),
        "salt": np.where(rng.random((200, 200)) < 0.02, 100, 0),
        "round": np.where(radius < 80, 0, np.where(radius < 84, 100, -1)),
        "two levels": np.where(radius < 60, 0, 100),
        "tiny": np.pad(np.zeros((18, 18)), 1, constant_values=100),
        "scan": np.where((np.mod(np.arctan2(y - 100, x - 100) * 40, 1) < 0.4) & (radius < 90), 0, -1),
        "islands": np.where((x // 20 + y // 20) % 2 == 0, 0, 100),
        "line": np.zeros((1, 300)),
        "probabilities": rng.integers(-1, 101, (60, 60)),
    }
    return np.ascontiguousarray(shapes[name].astype(np.int8))


@pytest.mark.parametrize(
    "name",
    ["all unknown", "all free", "all occupied", "one free cell", "salt", "round", "two levels", "tiny", "scan", "islands", "line",
     "probabilities"],
)  # fmt: skip
def test_hard_maps_give_a_layout(name: str) -> None:
    grid = OccupancyGrid(hard(name), 0.05)
    layout = reconstruct(grid)
    check_layout(layout, grid)
    if name == "round":
        assert len(layout.rooms) == 1


@settings(max_examples=40, deadline=None)
@given(
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(1, 40), st.integers(1, 40)),
        elements=st.sampled_from([-1, 0, 0, 0, 100]),
    )
)
def test_random_grids_never_break_it(cells: np.ndarray) -> None:
    grid = OccupancyGrid(cells, 0.25)
    check_layout(reconstruct(grid), grid)


def test_bad_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="door_min"):
        DefaultConfig(door_min=2.0, door_max=1.0)
    with pytest.raises(ConfigError, match="basin_share"):
        reconstruct(office(), config={"basin_share": 0.0})
    with pytest.raises(ConfigError, match="openings"):
        DefaultConfig(reach=-1.0)


def test_a_door_is_found_with_its_walls() -> None:
    found = find_openings(office().occupied, 0.05, OpeningConfig())
    door = found.table[found.gap[108, 50]]
    assert found.table[0].tolist() == [0, 0, 0]
    assert door[WIDTH] == 18 and door[LONG] >= door[SHORT] > 5
    assert found.gap[130, 50] == 0 and found.gap[60, 50] == 0


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.bool_, (12, 14)))
def test_basins_cover_the_open_cells(blocked: np.ndarray) -> None:
    labels = distance_basins(blocked, 0.1, share=0.85, wide=1.5)
    assert ((labels > 0) == ~blocked).all()
    assert sorted(np.unique(labels[labels > 0])) == list(range(1, labels.max() + 1))


def test_a_passage_parts_two_basins_and_a_wide_one_does_not() -> None:
    blocked = np.ones((42, 82), bool)
    blocked[1:41, 1:40] = False
    blocked[1:41, 42:81] = False
    blocked[18:24, 40:42] = False
    assert distance_basins(blocked, 0.1, share=0.85, wide=3.0).max() == 2
    blocked[1:41, 40:42] = False
    assert distance_basins(blocked, 0.1, share=0.85, wide=3.0).max() == 1


def test_chinks_of_unknown_space_are_closed_and_wide_ones_stay() -> None:
    cells = np.zeros((60, 60), np.int8)
    cells[:, 20:24] = -1
    cells[:, 40:55] = -1
    space = closed_space(cells, 0.05, 0.25)
    assert space[30, 22] and not space[30, 47]


@pytest.mark.parametrize("angle", [0.1, -0.4, 0.7])
def test_labels_turn_there_and_back(angle: float) -> None:
    grid = office()
    turned = turn(grid.cells, angle, (0, 0))
    back = turn_back((turned.cells == 0).astype(np.int32), turned, grid.shape) > 0
    assert (back != grid.free).mean() < 0.05


def test_the_main_direction_is_the_peak_modulo_a_right_angle() -> None:
    profile = np.zeros(720)
    profile[[80, 440]] = 1.0
    assert main_direction(profile) == pytest.approx(np.radians(20))
    profile = np.zeros(720)
    profile[700] = 1.0
    assert main_direction(profile) == pytest.approx(np.radians(-5))
    assert main_direction(np.ones(720)) == 0.0


def test_a_judge_can_be_trained_stored_and_read(tmp_path: Path) -> None:
    grid = office(clutter=True)
    truth = reconstruct(office()).labels
    example = make_example(grid.cells, truth, 0.05, building="a", kind="x")
    forest = train_forest([example, example], TrainingConfig(rounds=1, trees=5, leaves=4))
    save_forest(forest, tmp_path / "model.json", note="test")
    again = load_forest(tmp_path / "model.json")
    assert (
        (again.feature == forest.feature).all()
        and (again.threshold == forest.threshold).all()
        and again.bias == forest.bias
    )
    assert (merge_pieces(example.graph, again) == merge_pieces(example.graph, forest)).all()
    (tmp_path / "other.json").write_text('{"features": ["x"], "bias": 0, "trees": []}')
    with pytest.raises(ConfigError, match="train"):
        load_forest(tmp_path / "other.json")


def test_the_judge_is_asked_in_order_of_certainty() -> None:
    example = make_example(office().cells, office().cells.astype(np.int32) * 0, 0.05, building="a", kind="x")
    nothing, everything = (merge_pieces(example.graph, first_forest(), level=v) for v in (1e9, -1e9))
    assert (nothing == np.arange(len(nothing))).all()
    assert len(set(everything[1:].tolist())) == 1
    assert len(FEATURES) == len(set(FEATURES))
