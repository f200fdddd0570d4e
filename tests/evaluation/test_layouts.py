"""School layouts against stretched floor plans, and ROSE's clutter study."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.evaluation.clutter import (
    SHAPES,
    ClutterConfig,
    ClutterTrial,
    add_clutter,
    line_error,
    run_study,
    summarise,
    table,
)
from layoutexplore.evaluation.layouts import read_outlines, score_layout, score_polygons, stretch
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import empty_layout

XML = """<building><floor><spaces>
<space><bounding_polygon>
<point x="0" y="0"/><point x="10" y="0"/><point x="10" y="5"/><point x="0" y="5"/>
</bounding_polygon></space>
<space><bounding_polygon><point x="10" y="0"/><point x="20" y="0"/><point x="20" y="5"/></bounding_polygon></space>
</spaces></floor></building>"""


def test_coverages_of_a_hand_case():
    truth = [shapely.box(0, 0, 4, 4), shapely.box(4, 0, 8, 4)]
    found = [shapely.box(0, 0, 6, 4), shapely.box(6, 0, 8, 4)]
    scores = score_polygons(found, truth)
    assert scores.a_fc == pytest.approx((16 + 8) / 32)
    assert scores.a_bc == pytest.approx((16 + 8) / 32)
    assert scores.precision == pytest.approx((16 / 24 + 1) / 2)
    assert scores.recall == pytest.approx((1 + 8 / 16) / 2)
    assert (scores.rooms, scores.true_rooms) == (2, 2)
    assert score_polygons([], truth).a_bc == 0


def test_outlines_are_read_and_stretched(tmp_path):
    path = tmp_path / "school_gt.xml"
    path.write_text(XML)
    rooms = read_outlines(path)
    assert [r.area for r in rooms] == [50, 25]
    moved = stretch(rooms, (1, 1, 5, 3))
    assert tuple(shapely.total_bounds(np.array(moved))) == pytest.approx((1, 1, 5, 3))
    assert [r.area for r in moved] == pytest.approx([4, 2])


@pytest.mark.parametrize(
    "text",
    [
        "not xml",
        "<building/>",
        "<bounding_polygon><point x='1' y='wide'/></bounding_polygon>",
        "<bounding_polygon><point x='1'/></bounding_polygon>",
        "<bounding_polygon><point x='nan' y='0'/></bounding_polygon>",
    ],
)
def test_broken_floor_plans_are_named(tmp_path, text):
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(MapError, match=r"broken\.xml"):
        read_outlines(path)


def test_a_layout_without_rooms_scores_nothing():
    layout = empty_layout("ias15", OccupancyGrid(np.zeros((3, 3), np.int8), 0.1), "nothing")
    assert score_layout(layout, [shapely.box(0, 0, 1, 1)]).a_bc == 0


@pytest.mark.slow
def test_school_maps_reach_the_published_coverages(data_dir):
    folder = data_dir / "gridmaps" / "schools"
    scores = [
        score_layout(
            reconstruct(load_grid(path, resolution=0.1), "ias15"),
            read_outlines(folder / f"{path.stem}_gt.xml"),
        )
        for path in sorted(folder.glob("*.png"))
    ]
    assert np.mean([s.a_bc for s in scores]) > 0.865
    assert np.mean([s.a_fc for s in scores]) > 0.877


def hall():
    cells = np.zeros((200, 200), np.int8)
    cells[[10, 90, 190]] = 100
    cells[:, [10, 100, 190]] = 100
    return OccupancyGrid(cells, 0.05)


@pytest.mark.parametrize("shape", SHAPES)
def test_clutter_only_fills_free_cells(shape):
    grid = hall()
    cluttered = add_clutter(grid, shape, 30, 9, np.random.default_rng(0))
    changed = cluttered.cells != grid.cells
    assert changed.sum() > 30
    assert (grid.cells[changed] == 0).all()
    again = add_clutter(grid, shape, 30, 9, np.random.default_rng(0))
    assert np.array_equal(cluttered.cells, again.cells)


def test_study_of_a_clean_hall():
    told = []
    config = ClutterConfig(shapes=("square", "star"), counts=(20, 60), sizes=(3, 15))
    summary, trials = run_study({"hall": hall()}, config, progress=lambda *what: told.append(what))
    assert told == [("maps cluttered", 1, 1)]
    assert summary.trials == len(trials) == 8
    assert summary.median_precision > 0.95
    assert summary.clean_scores["hall"] < 0.2
    assert summary.error < summary.raw_error
    assert set(table(trials, "shape")) == {"square", "star"}


def test_summary_correlates_score_and_precision():
    trials = [
        ClutterTrial(
            map="a",
            shape="star",
            count=20,
            size=2,
            precision=1 - k / 10,
            recall=0.5,
            score=k / 20,
            error=1.0,
            raw_error=2.0,
        )
        for k in range(5)
    ]
    summary = summarise(trials, {})
    assert summary.correlation == pytest.approx(-1)
    assert summary.median_precision == pytest.approx(0.8)
    assert np.isnan(summarise(trials[:1], {}).correlation)


def test_line_error_is_the_cost_of_the_best_move():
    truth = np.array([[0.0, 0.0, 4.0, 0.0], [0.0, 5.0, 0.0, 9.0]])
    parallel = np.array([[1.0, 1.0, 3.0, 1.0]])
    assert line_error(parallel, truth) == pytest.approx(0)
    skew = np.array([[0.0, 1.0, 2.0, 3.0]])
    assert line_error(skew, truth) == pytest.approx(np.pi / 4 * 2 / 2)
    assert line_error(np.zeros((0, 4)), truth) == np.inf


def test_nonsense_studies_are_refused():
    with pytest.raises(ConfigError, match="blob"):
        ClutterConfig(shapes=("blob",))
    with pytest.raises(ConfigError):
        ClutterConfig(counts=())
    with pytest.raises(MapError):
        run_study({})
    with pytest.raises(MapError, match="void"):
        run_study({"void": OccupancyGrid(np.zeros((9, 9), np.int8), 0.1)})
