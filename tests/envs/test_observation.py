"""What environments show of a decision: images against slow versions, the vectors' documented meaning."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.envs import egocentric_maps as map_images
from layoutexplore.envs.egocentric_maps import (
    CHANNELS,
    LAYOUT_CHANNELS,
    Trail,
    draw_global_map,
    draw_local_map,
)
from layoutexplore.envs.motion import MotionConfig
from layoutexplore.envs.observation import (
    FRONTIER_FEATURES,
    ROBOT_FEATURES,
    ObservationConfig,
    Observer,
    encode_frontiers,
)
from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.tour_features import tour_features
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors.robot_map import RobotMap
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices

ALL = len(CHANNELS) + len(LAYOUT_CHANNELS)


def random_world(seed: int) -> tuple[OccupancyGrid, NDArray[np.uint8], Pose]:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 40, 2))
    cells = rng.choice(np.array([UNKNOWN, FREE, FREE, OCCUPIED], np.int8), shape)
    marks = (rng.integers(0, 32, shape) * (rng.random(shape) < 0.2)).astype(np.uint8)
    grid = OccupancyGrid(cells, float(rng.uniform(0.05, 0.3)), Pose(*rng.uniform(-5, 5, 2), 0.0))
    x, y = grid.cell_to_world(*(rng.uniform(0, n) for n in shape))
    return grid, marks, Pose(x, y, float(rng.uniform(-4, 4)))


def paint(image: NDArray[np.uint8], i: int, j: int, seen: list[tuple[int, int]], bits: int) -> None:
    """The rules of a pixel: the share of free samples, then whether there is any of each."""
    for k in range(2, len(image)):
        image[k, i, j] = 255 * bool(bits & 1 << (k - 2))
    image[1, i, j] = 255 * any(value == OCCUPIED for value, _ in seen)


def slow_local(
    grid: OccupancyGrid, marks: NDArray[np.uint8], pose: Pose, size: int, span: float, detect: bool
) -> NDArray[np.uint8]:
    image = np.zeros((ALL, size, size), np.uint8)
    samples = max(1, math.ceil(span / size / grid.resolution - 1e-9))
    step = span / size / samples
    for i in range(size):
        for j in range(size):
            seen, bits = [], 0
            for a in range(samples):
                for b in range(samples):
                    ahead = span / 2 - (i * samples + a + 0.5) * step
                    right = (j * samples + b + 0.5) * step - span / 2
                    x = pose.x + ahead * math.cos(pose.theta) + right * math.sin(pose.theta)
                    y = pose.y + ahead * math.sin(pose.theta) - right * math.cos(pose.theta)
                    cell = grid.world_to_cell(x, y)
                    if not grid.contains(*cell):
                        continue
                    seen.append((grid.cells[cell], 0))
                    bits |= int(marks[cell])
                    if detect and grid.cells[cell] == FREE:
                        beside = [(cell.row + r, cell.col + c) for r, c in ((1, 0), (-1, 0), (0, 1), (0, -1))]
                        bits |= any(grid.contains(*n) and grid.cells[n] == UNKNOWN for n in beside)
            paint(image, i, j, seen, bits)
            image[0, i, j] = 255 * sum(value == FREE for value, _ in seen) // samples**2
    return image


def slow_global(
    grid: OccupancyGrid, marks: NDArray[np.uint8], size: int, min_span: float
) -> NDArray[np.uint8]:
    image = np.zeros((ALL, size, size), np.uint8)
    known = np.argwhere(grid.cells != UNKNOWN)
    low, high = (known.min(axis=0), known.max(axis=0) + 1) if len(known) else (np.zeros(2), np.zeros(2))
    span = max(*(high - low), min_span / grid.resolution, size)
    corner = (low + high - span) / 2
    pixels_per_cell = 1.0 / (span / size)

    def holds(pixel: int, cell: int, first: float) -> bool:
        return first + pixel / pixels_per_cell - 0.5 <= cell < first + (pixel + 1) / pixels_per_cell - 0.5

    for i in range(size):
        for j in range(size):
            inside = [
                (r, c)
                for r in range(grid.shape[0])
                for c in range(grid.shape[1])
                if holds(size - 1 - i, r, corner[0]) and holds(j, c, corner[1])
            ]
            paint(
                image,
                i,
                j,
                [(grid.cells[cell], 0) for cell in inside],
                int(np.bitwise_or.reduce([marks[n] for n in inside] or [0])),
            )
            if inside:
                image[0, i, j] = 255 * sum(grid.cells[cell] == FREE for cell in inside) // len(inside)
    return image


@given(st.integers(0, 2**32), st.integers(4, 12), st.floats(0.5, 8.0), st.booleans())
@settings(max_examples=40, deadline=None)
def test_the_local_map_is_what_sampling_finds(seed: int, size: int, span: float, detect: bool) -> None:
    grid, marks, pose = random_world(seed)
    image = draw_local_map(grid, marks, pose, size=size, span=span, channels=ALL, detect=detect)
    np.testing.assert_array_equal(image, slow_local(grid, marks, pose, size, span, detect))


@given(st.integers(0, 2**32), st.integers(4, 12), st.floats(0.1, 6.0))
@settings(max_examples=25, deadline=None)
def test_the_global_map_is_what_gathering_finds(seed: int, size: int, min_span: float) -> None:
    grid, marks, _ = random_world(seed)
    image, _ = draw_global_map(grid, marks, size=size, min_span=min_span, channels=ALL)
    np.testing.assert_array_equal(image, slow_global(grid, marks, size, min_span))


def test_the_local_map_looks_ahead() -> None:
    cells = np.full((41, 41), FREE, np.int8)
    cells[20, 30] = OCCUPIED  # one metre in direction +x of the robot
    grid = OccupancyGrid(cells, 0.1)
    marks = np.zeros(cells.shape, np.uint8)
    for theta, pixel in (
        (0.0, (5, 15)),
        (math.pi / 2, (15, 25)),
        (-math.pi / 2, (15, 5)),
        (math.pi, (25, 15)),
    ):
        image = draw_local_map(grid, marks, Pose(2.05, 2.05, theta), size=31, span=3.1, channels=4)
        assert np.argwhere(image[1]).tolist() == [list(pixel)]


def test_the_global_map_shows_only_what_is_known() -> None:
    small = np.full((50, 60), UNKNOWN, np.int8)
    small[20:28, 20:40] = FREE
    large = np.full((500, 900), UNKNOWN, np.int8)
    large[320:328, 220:240] = FREE
    images = [
        draw_global_map(
            OccupancyGrid(cells, 0.1), np.zeros(cells.shape, np.uint8), size=20, min_span=4.0, channels=4
        )[0]
        for cells in (small, large)
    ]
    np.testing.assert_array_equal(*images)
    rows, cols = np.nonzero(images[0][0])
    assert (rows.max() - rows.min() + 1, cols.max() - cols.min() + 1) == (4, 10)  # the aspect is kept


def test_the_trail_follows_what_the_robot_believes() -> None:
    grid = OccupancyGrid(np.zeros((30, 30), np.int8), 0.1)
    trail = Trail(grid)
    trail.extend(np.array([[0.55, 0.55, 0.0], [1.55, 0.55, 0.0]]))
    assert np.argwhere(trail.marks).tolist() == [[5, col] for col in range(5, 16)]
    trail.extend(np.array([[1.55, 0.55, 0.0], [1.55, 0.75, 0.0]]))
    assert np.argwhere(trail.marks).tolist()[-2:] == [[6, 15], [7, 15]]
    # A pose that has drifted beyond the edge, by less than a cell, is in no cell.
    trail.extend(np.array([[-0.08, 2.05, 0.0], [-0.02, 2.05, 0.0]]))
    assert not trail.marks[20].any()


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    return offices()


@pytest.fixture
def decision(plan: FloorPlan) -> Decision:
    simulation = Simulation(plan, SimulationConfig(sensor="short"))
    decision = simulation.reset(seed=3)
    while len(decision.frontiers) < 3:
        decision = simulation.step(0)
    return decision


def columns(decision: Decision, config: ObservationConfig) -> dict[str, NDArray[np.float32]]:
    table = encode_frontiers(decision, config).reshape(config.max_frontiers, -1)
    return dict(zip(FRONTIER_FEATURES, table.T, strict=True))


def test_frontier_columns_mean_what_they_say(decision: Decision) -> None:
    config = ObservationConfig(length_scale=2.0, area_scale=5.0)
    table, count = columns(decision, config), len(decision.frontiers)
    assert table["valid"].tolist() == [1.0] * count + [0.0] * (64 - count)
    assert all((column[count:] == 0).all() for column in table.values())
    x, y, theta = decision.pose
    for k, frontier in enumerate(decision.frontiers):
        ahead, left = 2.0 * table["ahead"][k], 2.0 * table["left"][k]
        there = (
            x + ahead * math.cos(theta) - left * math.sin(theta),
            y + ahead * math.sin(theta) + left * math.cos(theta),
        )
        assert there == pytest.approx(frontier.centroid, abs=1e-5)
        bearing = math.atan2(frontier.centroid[1] - y, frontier.centroid[0] - x)
        assert math.remainder(math.pi * table["turn"][k] - (bearing - theta), 2 * math.pi) == pytest.approx(
            0, abs=1e-5
        )
        assert 2.0 * table["path_length"][k] == pytest.approx(frontier.path_length, rel=1e-5)
        assert 2.0 * table["straight_distance"][k] == pytest.approx(frontier.straight_distance, rel=1e-5)
        assert 2.0 * table["size"][k] == pytest.approx(frontier.size, rel=1e-5)
        assert 5.0 * table["visible_area"][k] == pytest.approx(frontier.visible_area, rel=1e-5)
    for name in ("detour", "tour_rank", "class", "expected_area", "confidence"):
        assert not table[name].any()


def test_a_prediction_fills_its_columns(decision: Decision) -> None:
    judged = tuple(
        replace(f, is_closed=k == 0, expected_area=5.0, confidence=0.75, room=k + 1)
        for k, f in enumerate(decision.frontiers)
    )
    table = columns(replace(decision, frontiers=judged), ObservationConfig())
    assert table["class"][:3].tolist() == [1.0, -1.0, -1.0]
    assert table["expected_area"][:3].tolist() == [0.5] * 3
    assert table["confidence"][:3].tolist() == [0.75] * 3


def test_far_and_large_values_are_clipped_to_the_space(decision: Decision) -> None:
    config = ObservationConfig(length_scale=0.001, area_scale=0.0001)
    observation = Observer(config).observe(decision)
    assert config.space.contains(observation)
    assert observation["robot"].shape == (len(ROBOT_FEATURES),)


def test_the_tour_is_computed_on_request(decision: Decision) -> None:
    table, count = columns(decision, ObservationConfig(detour=True)), len(decision.frontiers)
    features = tour_features(decision)
    np.testing.assert_allclose(10.0 * table["detour"][:count], features.detour, rtol=1e-5)
    np.testing.assert_allclose(table["tour_rank"][:count], features.rank, rtol=1e-5)
    assert table["detour"].any() and table["tour_rank"].max() == 1.0 and not table["tour_rank"][count:].any()


def test_without_a_predictor_the_layout_channels_are_there_and_empty(decision: Decision) -> None:
    with_layout, without = ObservationConfig(), ObservationConfig(layout_channels=False)
    rich, plain = (Observer(config).observe(decision) for config in (with_layout, without))
    for name in ("local_map", "global_map"):
        assert rich[name].shape[0] == ALL and plain[name].shape[0] == len(CHANNELS)
        np.testing.assert_array_equal(rich[name][: len(CHANNELS)], plain[name])
        assert not rich[name][len(CHANNELS) :].any()
        assert plain[name][2].any()


def test_a_layout_fills_its_channels_where_nothing_is_known(decision: Decision) -> None:
    labels = np.zeros(decision.grid.shape, np.int32)
    labels[5:15, 5:15], labels[5:15, 15:25] = 1, 2
    closed = (
        replace(decision.frontiers[0], is_closed=True, room=2),
        replace(decision.frontiers[1], is_closed=False, room=1),
    )
    predicted = replace(decision, rooms=SimpleNamespace(labels=labels), frontiers=closed)
    marks = map_images.layout_marks(predicted)
    unknown = decision.grid.cells == UNKNOWN
    np.testing.assert_array_equal(marks & map_images.ROOM > 0, (labels > 0) & unknown)
    np.testing.assert_array_equal(marks & map_images.CLOSED > 0, (labels == 2) & unknown)
    assert not (marks & map_images.WALL)[6:13, 6:13].any()
    assert ((marks & map_images.WALL > 0)[6:13, 14] == unknown[6:13, 14]).all()
    observation = Observer(ObservationConfig()).observe(predicted)
    assert all(observation["global_map"][len(CHANNELS) + k].any() for k in range(2))


def test_maps_show_sketched_or_completed_rooms(decision: Decision) -> None:
    labels, sketch = (np.zeros(decision.grid.shape, np.int32) for _ in range(2))
    labels[5:15, 5:15], sketch[5:15, 15:25] = 1, 1
    predicted = replace(decision, rooms=SimpleNamespace(labels=labels, sketch=sketch))
    unknown = decision.grid.cells == UNKNOWN
    assert unknown[5:15, 5:25].any()
    for rooms, drawn in (("sketched", sketch), ("completed", labels)):
        marks = map_images.layout_marks(predicted, rooms)
        np.testing.assert_array_equal(marks & map_images.ROOM > 0, (drawn > 0) & unknown)
    images = [
        Observer(ObservationConfig(rooms=rooms)).observe(predicted)["global_map"]
        for rooms in ("sketched", "completed")
    ]
    assert (images[0] != images[1]).any()
    with pytest.raises(ConfigError, match="rooms"):
        ObservationConfig(rooms="drawn")


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_marks_of_rooms_follow_their_rules(seed: int) -> None:
    grid, _, pose = random_world(seed)
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 4, grid.shape).astype(np.int32)
    frontiers = tuple(
        SimpleNamespace(is_closed=closed, room=room) for closed, room in ((True, 2), (False, 1), (True, 0))
    )
    rooms = SimpleNamespace(labels=labels, sketch=labels)
    decision: Any = SimpleNamespace(grid=grid, frontiers=frontiers, rooms=rooms, pose=pose)
    marks = map_images.layout_marks(decision)
    for (r, c), mark in np.ndenumerate(marks):
        expected = 0
        if grid.cells[r, c] == UNKNOWN:
            beside = [labels[n] for n in ((r + 1, c), (r, c + 1)) if grid.contains(*n)]
            expected |= map_images.ROOM * (labels[r, c] > 0) | map_images.CLOSED * (labels[r, c] == 2)
            expected |= map_images.WALL * any(other != labels[r, c] for other in beside)
        assert mark == expected


def test_maps_can_be_left_out(decision: Decision) -> None:
    config = ObservationConfig(local_map=False, global_map=False)
    observation = Observer(config).observe(decision)
    assert set(observation) == {"frontiers", "robot", "action_mask"}
    assert config.space.contains(observation)


@pytest.mark.parametrize(
    "options",
    [
        {"max_frontiers": 0},
        {"local_size": 7},
        {"global_size": 8.5},
        {"local_span": 0.0},
        {"length_scale": math.nan},
    ],
)
def test_observation_options_are_checked(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(options))):
        ObservationConfig(**options)


@pytest.mark.parametrize("options", [{"forward": 0.0}, {"turn": math.inf}, {"scan_beams": 0}])
def test_motion_options_are_checked(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(options))):
        MotionConfig(**options)


@pytest.mark.parametrize("yaw", [0.7, -2.0, math.pi / 2])
def test_a_turned_map_is_shown_as_it_would_be_upright(yaw: float) -> None:
    """That of a robot of one's own: where its origin has a yaw, robot and trail were drawn elsewhere."""
    grid = offices().rasterize(0.1).grid
    cells = grid.cells.copy()
    cells[:, cells.shape[1] // 2 :] = UNKNOWN
    free = np.argwhere(cells == FREE)
    shown = []
    for angle in (0.0, yaw):
        turned = OccupancyGrid(cells, 0.1, Pose(30.0, -20.0, angle))
        robot_map, observer = RobotMap("none", clean=False), Observer(ObservationConfig())
        for row, col in free[[len(free) // 3, len(free) // 2]].tolist():
            x, y = turned.cell_to_world(row, col)
            decision = robot_map.decide(turned, Pose(x, y, 0.4 + angle))
            observation = observer.observe(decision)
        shown.append(observation)
    assert shown[0]["local_map"][CHANNELS.index("trail")].any()
    for name, upright in shown[0].items():
        # A corner of the trail on a border of cells may be rounded to either side.
        assert (np.abs(shown[1][name].astype(float) - upright.astype(float)) > 1e-4).mean() < 1e-3, name
