"""Pictures: the right colours in the right places, constant sizes, and nothing that changes a run."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.drawing import dashboard, palette
from layoutexplore.drawing import pictures as picture
from layoutexplore.drawing.dashboard import put_text, text_width
from layoutexplore.drawing.pictures import draw_decision, draw_grid, draw_plan, draw_state
from layoutexplore.drawing.view import View
from layoutexplore.envs.viewer import draw_text
from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation
from tests.plans import SUITE


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    return floorplan_from_ascii(SUITE, resolution=1.0, name="three rooms")


def run(plan: FloorPlan, steps: int = 3, **options: Any) -> Simulation:
    simulation = Simulation(plan, SimulationConfig(**{"sensor": "short"} | options))
    simulation.reset(seed=1)
    for _ in range(steps):
        if not simulation.done:
            simulation.step(0)
    return simulation


def count(image: NDArray[np.uint8], colour: palette.Colour) -> int:
    return int((image == np.array(colour, np.uint8)).all(axis=-1).sum())


def test_a_grid_is_drawn_y_up() -> None:
    grid = OccupancyGrid(np.array([[0, 100], [-1, 50]], np.int8), 1.0)
    image = draw_grid(grid, scale=3)
    assert image.shape == (6, 6, 3) and image.dtype == np.uint8
    assert tuple(image[5, 0]) == palette.FREE and tuple(image[5, 5]) == palette.WALL
    assert tuple(image[0, 0]) == palette.CANVAS
    assert tuple(image[0, 5]) == palette.mix(palette.FREE, palette.WALL, 0.5)


@pytest.mark.parametrize("scale", [0, -1, 1.5])
def test_a_scale_is_a_whole_number(scale: float) -> None:
    with pytest.raises(ConfigError, match="scale"):
        draw_grid(OccupancyGrid(np.zeros((2, 2), np.int8), 1.0), scale=scale)  # type: ignore[arg-type]


def test_a_plan_has_a_colour_per_room_and_dark_walls(plan: FloorPlan) -> None:
    raster = plan.rasterize(0.1)
    image = draw_plan(raster, scale=2)
    assert image.shape == (2 * raster.shape[0], 2 * raster.shape[1], 3)
    for room in plan.rooms:
        x, y = room.polygon.representative_point().coords[0]
        row, col = raster.world_to_cell(x, y)
        assert tuple(image[2 * (raster.shape[0] - 1 - row), 2 * col]) == palette.room_colour(room.id)
    assert count(image, palette.WALL) > 1000
    assert tuple(image[0, 0]) == palette.CANVAS  # far from any room


@pytest.mark.parametrize("size", [(960, 720), (641, 481), (320, 240)])
def test_every_frame_of_a_run_has_the_size_that_was_asked_for(plan: FloorPlan, size: tuple[int, int]) -> None:
    simulation = run(plan, steps=0)
    while not simulation.done:
        assert draw_state(simulation, size=size, agent="nearest", target=0).shape == (size[1], size[0], 3)
        simulation.step(0)
    assert draw_state(simulation, size=size).shape == (size[1], size[0], 3)


def test_a_size_that_suits_the_plan_is_even(plan: FloorPlan) -> None:
    height, width, _ = draw_state(run(plan)).shape
    assert width == 960 and height % 2 == 0 and 480 <= height <= 1080


def test_too_small_a_frame_is_refused(plan: FloorPlan) -> None:
    with pytest.raises(ConfigError, match="320 x 240"):
        draw_state(run(plan), size=(100, 100))


def test_what_is_drawn_is_there(plan: FloorPlan) -> None:
    simulation = run(plan, steps=1)
    full = draw_state(simulation, target=0)
    bare = draw_state(simulation, frontiers=False, truth=False)
    for colour in (palette.FREE, palette.WALL, palette.CANVAS, palette.ROBOT):
        assert count(full, colour) > 20 and count(bare, colour) > 20
    for colour in (palette.FRONTIER, palette.UNSEEN, palette.PLANNED):
        assert count(full, colour) > 20
    assert count(bare, palette.FRONTIER) == count(bare, palette.UNSEEN) == 0


def test_frontier_classes_have_colours(plan: FloorPlan) -> None:
    simulation = run(plan, steps=1)
    decision = simulation.decision
    judged = tuple(replace(f, is_closed=k % 2 == 0) for k, f in enumerate(decision.frontiers))
    assert len(judged) >= 2
    simulation.state.decision = replace(decision, frontiers=judged)
    image = draw_state(simulation)
    assert count(image, palette.CLOSED) > 20
    assert count(image, palette.OPEN) > 20
    assert count(image, palette.FRONTIER) == 0


def test_what_is_predicted_is_drawn_where_it_is_and_told_right_from_wrong(plan: FloorPlan) -> None:
    class Guess:
        """Takes everything for one room."""

        name = "guess"

        def predict(self, decision: Decision) -> Decision:
            return replace(decision, rooms=SimpleNamespace(labels=np.ones(decision.grid.shape, np.int32)))

    simulation = Simulation(plan, SimulationConfig(sensor="short"), Guess())
    simulation.reset(seed=1)
    unknown = simulation.mapper.grid.cells < 0
    right, wrong = (unknown & (simulation.truth.target == is_floor) for is_floor in (True, False))
    assert right.any() and wrong.any()
    hinted = draw_state(simulation, size=(700, 450))
    assert count(hinted, palette.PREDICTED) > 5 * right.sum()
    assert count(hinted, palette.MISTAKEN) > 5 * wrong.sum()
    plain = draw_state(simulation, size=(700, 450), truth=False)
    assert count(plain, palette.MISTAKEN) == 0 and count(plain, palette.PREDICTED) > count(
        hinted, palette.PREDICTED
    )


def test_a_decision_is_drawn_in_the_frame_of_its_map(plan: FloorPlan) -> None:
    decision = replace(run(plan).decision, track=np.array([(1.5, 1.5, 0.0), (2.0, 1.5, 0.0)]))
    image = draw_decision(decision, width=700, target=0)
    assert image.shape[1] == 700 and count(image, palette.FRONTIER) > 30 and count(image, palette.ROBOT) > 30
    grid, c, s = decision.grid, math.cos(0.5), math.sin(0.5)
    origin = Pose(c * grid.origin.x - s * grid.origin.y, s * grid.origin.x + c * grid.origin.y, 0.5)
    x, y, theta = decision.pose
    turned = replace(
        decision,
        grid=OccupancyGrid(grid.cells, grid.resolution, origin),
        pose=Pose(c * x - s * y, s * x + c * y, theta + 0.5),
        track=decision.track @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]),
    )
    assert (draw_decision(turned, width=700, target=0) != image).mean() < 0.001  # the last bit of a corner
    with pytest.raises(ConfigError, match="target"):
        draw_decision(decision, target=99)
    with pytest.raises(ConfigError, match="width"):
        draw_decision(decision, width=10)


def test_nothing_is_written_over_the_map_of_a_decision(plan: FloorPlan) -> None:
    simulation = Simulation(plan, SimulationConfig(sensor="short"), make_predictor("oracle"))
    simulation.reset(seed=1)
    decision = simulation.decision
    image = draw_decision(decision, width=700)
    legend, below = image[:45], image[45:]
    assert count(legend, palette.CLOSED) > 30 and count(legend, palette.OPEN) > 30
    assert not count(legend, palette.WALL) and (below[:5] == palette.CANVAS).all()
    way = np.array([(1.5, 1.5), (2.0, 1.5), (2.5, 1.5), (3.0, 1.5)])
    assert count(draw_decision(decision, width=700, way=way), palette.PLANNED) > count(image, palette.PLANNED)


def test_the_legend_stands_in_the_corner_with_the_least_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    places: list[tuple[float, int]] = []
    monkeypatch.setattr(picture, "put_keys", lambda _i, _k, left, middle, _h: places.append((left, middle)))
    half, whole = f"#{29 * 'a'}{30 * '#'}", f"#{58 * 'a'}#"
    rows = [60 * "#", *17 * [half], *17 * [whole], 60 * "#"]
    for way, side in itertools.product((1, -1), (1, -1)):
        plan = floorplan_from_ascii("\n".join(row[::side] for row in rows[::way]), resolution=0.5)
        simulation = Simulation(plan, SimulationConfig(sensor="short"), make_predictor("oracle"))
        simulation.reset(seed=1)
        draw_state(simulation, size=(960, 700))
    assert [(left > 400, middle > 300) for left, middle in places] == [
        (True, False),
        (False, False),
        (True, True),
        (False, True),
    ]


def test_a_long_name_of_an_agent_does_not_cut_off_the_state(
    plan: FloorPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    monkeypatch.setattr(dashboard, "put_text", lambda _image, text, *_, **__: told.append(text))
    draw_state(run(plan), agent="plan-tour:predictor=prior:a-plan-with-a-name.png")
    assert any(re.fullmatch(r"plan-tour:pred.*\.\.\., short lidar, explor(ing|ed)", text) for text in told)


def test_cells_land_where_their_coordinates_do(plan: FloorPlan) -> None:
    raster = plan.rasterize(0.1)
    view = View.fit(raster.shape, (900, 700), raster.resolution, raster.origin)
    cells = np.zeros((*raster.shape, 3), np.uint8)
    row, col = raster.world_to_cell(3.05, 2.05)
    cells[row, col] = 255
    image = view.place(cells)
    x, y = view.pixels(np.array([[3.05, 2.05]]))[0]
    rows, cols = np.nonzero((image == 255).all(axis=-1))
    assert cols.mean() == pytest.approx(x - 0.5, abs=1.0) and rows.mean() == pytest.approx(y - 0.5, abs=1.0)


def test_the_robot_points_where_it_heads(plan: FloorPlan) -> None:
    raster = plan.rasterize(0.1)
    view = View.fit(raster.shape, (900, 700), raster.resolution, raster.origin)
    x, y = view.pixels(np.array([[4.0, 2.0]]))[0]
    for theta, (dx, dy) in (
        (0.0, (1, 0)),
        (math.pi / 2, (0, -1)),
        (math.pi, (-1, 0)),
        (-math.pi / 2, (0, 1)),
    ):
        image = np.full((700, 900, 3), 255, np.uint8)
        picture._draw_robot(image, view, Pose(4.0, 2.0, theta), 0.2)
        rows, cols = np.nonzero((image == palette.ROBOT).all(axis=-1))
        tip = max(((c - x) * dx + (r - y) * dy) for r, c in zip(rows, cols, strict=True))
        back = max((-(c - x) * dx - (r - y) * dy) for r, c in zip(rows, cols, strict=True))
        assert tip > back


def test_noise_does_not_touch_the_picture_or_the_run(plan: FloorPlan) -> None:
    lidar = LidarConfig(range_max=6.0, fov=3.0, beams=90, range_noise_std=0.02, dropout=0.05)
    options: dict[str, Any] = {
        "sensor": lidar,
        "odometry_noise": OdometryNoise(translation=0.02, rotation=0.01),
    }
    watched, alone = run(plan, steps=0, **options), run(plan, steps=0, **options)
    for _ in range(3):
        np.testing.assert_array_equal(draw_state(watched), draw_state(watched))
        if not watched.done:
            watched.step(0)
            alone.step(0)
    np.testing.assert_array_equal(watched.track, alone.track)
    np.testing.assert_array_equal(watched.mapper.grid.cells, alone.mapper.grid.cells)


def test_what_lies_outside_of_the_region_is_pale(plan: FloorPlan) -> None:
    (x0, y0, x1, y1), walls = plan.bounds, []
    for right in (None, x1 + 9, (x0 + x1) / 2):
        corners = ((x0 - 9, y0 - 9), (right, y0 - 9), (right, y1 + 9), (x0 - 9, y1 + 9))
        simulation = run(plan, region=None if right is None else corners)
        frame = draw_state(simulation, frontiers=False)
        height, width = frame.shape[:2]
        walls.append(count(frame[: height // 2, width // 2 + 4 :], palette.WALL))
    assert walls[0] == walls[1] > walls[2] == 0


def test_text_shows_walls_robot_and_frontiers(plan: FloorPlan) -> None:
    simulation = run(plan, steps=1)
    text = draw_text(simulation)
    head, *lines = text.splitlines()
    assert head.startswith("three rooms: ") and "m, exploring" in head
    assert max(len(line) for line in lines) <= 100
    body = "\n".join(lines)
    assert set("#.?") <= set(body)
    assert len(re.findall("[><^v]", body)) == 1
    assert "?" not in draw_text(simulation, frontiers=False)


def test_text_of_a_wide_map_is_cut_to_the_columns(plan: FloorPlan) -> None:
    lines = draw_text(run(plan), columns=20).splitlines()[1:]
    assert 10 <= max(len(line) for line in lines) <= 20


def test_letters_without_an_ascii_form_do_not_break_the_caption() -> None:
    image = np.full((40, 400, 3), 255, np.uint8)
    put_text(image, "Büro Łódź 教室", 5, 30, 12, palette.INK)
    assert (image < 255).any()
    assert text_width("Büro", 12) == text_width("Buro", 12)
    assert text_width("MM", 24) > text_width("MM", 12) > 10


def test_the_palette_converts() -> None:
    assert palette.to_hex(palette.VERMILLION) == "#d55e00"
    assert palette.mix(palette.WHITE, palette.BLACK, 0.0) == palette.WHITE
    assert palette.room_colour(1) == palette.room_colour(1 + len(palette.ROOMS))
    assert len(set(palette.QUALITATIVE)) == len(palette.QUALITATIVE)
    assert len(set(palette.ROOMS)) == len(palette.ROOMS)


@pytest.mark.parametrize(("x", "y"), [(1e3, 0.0), (-3.0, 1.0), (1.0, -40.0)])
def test_a_robot_that_believes_to_be_outside_stands_at_the_border(
    plan: FloorPlan, x: float, y: float
) -> None:
    simulation = run(plan)
    assert simulation.decision.frontiers
    lines = draw_text(simulation).splitlines()[1:]
    simulation.robot.relocate(Pose(x, y, 0.0))
    there = draw_text(simulation, frontiers=False).splitlines()[1:]
    rows, cols = np.argwhere([[letter == ">" for letter in line.ljust(200)] for line in there]).T
    assert len(rows) == 1 and len(there) == len(lines)
    assert cols[0] in (0, max(map(len, there)) - 1) or rows[0] in (0, len(there) - 1)
