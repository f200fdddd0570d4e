"""The wall lines that ROSE's sensitivity study compares.

Found the same way with and without ROSE, the truth without.
"""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.evaluation.clutter import (
    SHAPES,
    ClutterConfig,
    ClutterTrial,
    add_clutter,
    line_error,
    run_study,
    summarise_clutter,
    table,
    wall_lines,
)
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.lines.rose import RoseConfig, rose


def turned_room(angle: float) -> OccupancyGrid:
    """A room of 12 m x 8 m whose walls lie askew in the grid, at 0.05 m."""
    rows, cols = np.mgrid[:340, :340] - 170
    x, y = np.cos(angle) * cols + np.sin(angle) * rows, np.cos(angle) * rows - np.sin(angle) * cols
    inside = (np.abs(x) < 120) & (np.abs(y) < 80)
    return OccupancyGrid(
        np.where(inside, np.where((np.abs(x) < 116) & (np.abs(y) < 76), 0, 100), -1).astype(np.int8), 0.05
    )


def test_wall_lines_of_a_room_are_its_walls() -> None:
    grid = turned_room(0.2)
    truth = (
        np.array(
            [[-118, -78, 118, -78], [118, -78, 118, 78], [118, 78, -118, 78], [-118, 78, -118, -78]], float
        )
        * 0.05
    )
    c, s = np.cos(0.2), np.sin(0.2)
    ends = truth.reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + 170.5 * 0.05
    lines = wall_lines(grid)
    assert 4 <= len(lines) <= 12
    assert line_error(lines, ends.reshape(-1, 4)) < 1e-3
    assert line_error(ends.reshape(-1, 4), lines) < 1e-3


def test_wall_lines_take_the_directions_they_are_given() -> None:
    grid = turned_room(0.2)
    lines = wall_lines(grid, np.array([0.25, 0.25 + np.pi / 2]))
    angles = np.mod(np.arctan2(lines[:, 3] - lines[:, 1], lines[:, 2] - lines[:, 0]), np.pi / 2)
    assert angles == pytest.approx(0.25)
    assert np.array_equal(wall_lines(grid, np.zeros(0)), wall_lines(grid))
    assert wall_lines(OccupancyGrid(np.zeros((30, 30), np.int8), 0.05)).shape == (0, 4)


def test_the_comparison_favours_neither_side() -> None:
    grid = turned_room(0.2)
    truth = wall_lines(grid)
    clean = rose(grid, RoseConfig())
    assert line_error(wall_lines(grid), truth) == 0.0
    assert line_error(wall_lines(clean.clean_grid, clean.directions), truth) > 0.0
    cluttered = add_clutter(grid, "star", 60, 9, np.random.default_rng(0))
    mended = rose(cluttered, RoseConfig())
    assert line_error(wall_lines(mended.clean_grid, mended.directions), truth) < 0.1 * line_error(
        wall_lines(cluttered), truth
    )


def test_the_study_does_not_depend_on_where_the_map_lies() -> None:
    grid, options = turned_room(0.2), ClutterConfig(shapes=("square",), counts=(40,), sizes=(9,))
    placed = OccupancyGrid(grid.cells, grid.resolution, Pose(4.0, 1.0, 0.7))
    (here, _), (there, _) = run_study({"a": grid}, options), run_study({"a": placed}, options)
    assert here.error == pytest.approx(there.error) and here.raw_error == there.raw_error


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
    summary = summarise_clutter(trials, {})
    assert summary.correlation == pytest.approx(-1)
    assert summary.median_precision == pytest.approx(0.8)
    assert np.isnan(summarise_clutter(trials[:1], {}).correlation)


def test_line_error_is_the_cost_of_the_best_move():
    truth = np.array([[0.0, 0.0, 4.0, 0.0], [0.0, 5.0, 0.0, 9.0]])
    parallel = np.array([[1.0, 1.0, 3.0, 1.0]])
    assert line_error(parallel, truth) == pytest.approx(0)
    skew = np.array([[0.0, 1.0, 2.0, 3.0]])
    assert line_error(skew, truth) == pytest.approx(np.pi / 4 * 2 / 2)
    assert line_error(np.zeros((0, 4)), truth) == np.inf
    for lines in (np.zeros((2, 3)), np.zeros(4), np.zeros((1, 2, 4))):
        with pytest.raises(ConfigError, match="rows of four numbers"):
            line_error(lines, truth)


def test_nonsense_studies_are_refused():
    with pytest.raises(ConfigError, match="blob"):
        ClutterConfig(shapes=("blob",))
    with pytest.raises(ConfigError):
        ClutterConfig(counts=())
    with pytest.raises(MapError):
        run_study({})
    with pytest.raises(MapError, match="void"):
        run_study({"void": OccupancyGrid(np.zeros((9, 9), np.int8), 0.1)})
