"""Poses refined on the lines of walls, against slow obvious versions and walls known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.sensing.measured_points import (
    MeasuredPoints,
    add_point,
    is_turned_away,
    nearest_mean,
    no_points,
    wall_line,
)
from layoutexplore.sensing.pose_refinement import MatchModel, refine_pose

MODEL = MatchModel(spread=0.5, weight=0.5, position_std=0.3, heading_std=0.02)


def points_at(places: np.ndarray, shape: tuple[int, int] = (40, 40)) -> MeasuredPoints:
    """A map with one point in each cell of some of the places float64 (n, 2), as (x, y)."""
    points = no_points(shape)
    for x, y in places:
        if points.number[int(y), int(x)] == 0:
            add_point(points, x, y)
        points.x[int(y), int(x)], points.y[int(y), int(x)] = x, y
    return points


def corner(turn: float = 0.0) -> np.ndarray:
    """Two walls that meet near (30, 30), turned around (20, 20)."""
    along = np.arange(6.0, 30.0, 0.3)
    places = np.concatenate(
        [np.stack([along, np.full_like(along, 30.3)], 1), np.stack([np.full_like(along, 30.3), along], 1)]
    )
    c, s = math.cos(turn), math.sin(turn)
    return (places - 20.0) @ np.array([[c, s], [-s, c]]) + 20.0


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_nearest_mean_is_that_of_the_slow_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = points_at(rng.uniform(1, 11, (rng.integers(0, 60), 2)), (12, 12))
    x, y = rng.uniform(1, 11, 2)
    least, row, col = nearest_mean(points, x, y)
    near = [
        ((points.x[r, c] - x) ** 2 + (points.y[r, c] - y) ** 2, r, c)
        for r in range(int(y) - 1, int(y) + 2)
        for c in range(int(x) - 1, int(x) + 2)
        if points.number[r, c]
    ]
    assert least == pytest.approx(min(near)[0]) if near else least == np.inf
    assert not near or points.number[row, col]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cells_know_which_around_them_have_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = points_at(rng.uniform(1, (14, 9), (rng.integers(0, 60), 2)), (10, 15))
    padded = np.pad(points.number > 0, 1)
    around = sum(padded[k // 3 : k // 3 + 10, k % 3 : k % 3 + 15].astype(int) << k for k in range(9))
    assert np.array_equal(points.around, around)


def slowly_refined(
    points: MeasuredPoints, ends: np.ndarray, pose: np.ndarray, prior: np.ndarray, model: MatchModel
) -> np.ndarray:
    """One step of `refine_pose` as a least-squares problem, a row a distance."""
    rows, cols = points.number.shape
    sure = np.array([model.position_std, model.position_std, model.heading_std])
    slopes, offs = [*np.diag(1 / sure)], [*((prior - pose) / sure)]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for arm in ends @ np.array([[c, s], [-s, c]]):
        x, y = pose[:2] + arm
        if not (2 <= x < cols - 2 and 2 <= y < rows - 2):
            continue
        square, row, col = nearest_mean(points, x, y)
        if square > (3 * model.spread) ** 2 or is_turned_away(points, row, col, *arm):
            continue
        is_line, line_x, line_y, *normal = wall_line(points, row, col, *arm)
        from_end = np.array([line_x - x, line_y - y])
        if is_line:
            square = (from_end @ normal) ** 2
        else:
            from_end = np.array([points.x[row, col] - x, points.y[row, col] - y])
        root = math.sqrt(model.weight * math.exp(-0.5 * square / model.spread**2)) / model.spread
        for axis in [np.array(normal)] if is_line else np.eye(2):
            slopes.append(root * np.array([*axis, axis @ [-arm[1], arm[0]]]))
            offs.append(root * (axis @ from_end))
    return pose + np.linalg.lstsq(np.array(slopes), np.array(offs), rcond=None)[0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_pose_is_refined_as_by_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = points_at(corner(rng.uniform(0, 1.5)) + rng.normal(0, 0.1, (160, 2)))
    for facing in (points.facing_x, points.facing_y):
        facing[:] = rng.choice([-70, 0, 0, 70], facing.shape)
    ends = corner(rng.uniform(0, 1.5))[::2] + rng.normal(0, 0.2, (80, 2)) - 20.0
    prior = np.array([*(20.0 + rng.normal(0, 0.2, 2)), rng.normal(0, 0.01)])
    pose = prior.copy()
    for _ in range(8):
        before, pose = pose, slowly_refined(points, ends, pose, prior, MODEL)
        if abs(pose - before)[:2].sum() < 1e-2 and abs(pose - before)[2] < 1e-4:
            break
    assert refine_pose(points, ends, tuple(prior), tuple(prior), MODEL) == pytest.approx(pose, abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, math.pi / 2, 2.5])
def test_means_along_a_wall_make_its_line(angle: float) -> None:
    along = np.arange(-12.0, 12.0, 0.2)[:, None] * np.array([[math.cos(angle), math.sin(angle)]])
    points = points_at(along + 20.25)
    is_line, x, y, normal_x, normal_y = wall_line(points, 20, 20, 1.0, 0.0)
    assert is_line and math.hypot(normal_x, normal_y) == pytest.approx(1.0)
    assert abs(normal_x * math.cos(angle) + normal_y * math.sin(angle)) < 0.05
    assert abs(normal_x * (20.25 - x) + normal_y * (20.25 - y)) < 0.05


def test_few_or_scattered_means_make_none() -> None:
    assert not wall_line(points_at(np.array([[20.5, 20.5], [21.5, 20.5]])), 20, 20, 1.0, 0.0)[0]
    spread = np.array([[x + 0.5, y + 0.5] for x in (19, 20, 21) for y in (19, 20, 21)])
    assert not wall_line(points_at(spread), 20, 20, 1.0, 0.0)[0]


@settings(max_examples=40, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.015, 0.015), st.floats(0, 1.5))
def test_a_wrong_pose_is_put_right(dx: float, dy: float, turn: float, askew: float) -> None:
    points, ends = points_at(corner(askew)), corner(askew)[::2] - 20.0
    wrong = (20.0 + dx, 20.0 + dy, turn)
    # Odometry that trusts itself holds the pose back: here it knows little.
    vague = MODEL._replace(position_std=3.0, heading_std=0.2)
    x, y, heading = refine_pose(points, ends, wrong, wrong, vague)
    assert abs(x - 20.0) < 0.03 and abs(y - 20.0) < 0.03 and abs(heading) < 0.003
    x, y, heading = refine_pose(points, ends, wrong, wrong, MODEL)
    # What is left of a wrong heading, half of it at most, moves the place by as many cells as it has radians.
    assert math.hypot(x - 20.0, y - 20.0) < 0.25 * math.hypot(dx, dy) + 0.5 * abs(turn) + 0.018
    assert abs(heading) < 0.5 * abs(turn) + 0.003


def test_along_a_wall_and_without_one_the_prior_holds() -> None:
    prior = (20.1, 20.1, 0.0)
    wall = corner()[: len(corner()) // 2]
    x, y, _ = refine_pose(points_at(wall), wall[20:60] - 20.0, prior, prior, MODEL)
    assert x == pytest.approx(20.1, abs=0.02) and y == pytest.approx(20.0, abs=0.02)
    assert refine_pose(points_at(wall[:0]), wall - 20.0, prior, prior, MODEL) == prior
    assert refine_pose(points_at(wall), wall[:0], prior, prior, MODEL) == prior


def test_what_is_known_for_certain_does_not_move() -> None:
    prior, points = (20.1, 20.1, 0.01), points_at(corner())
    x, y, heading = refine_pose(points, corner() - 20.0, prior, prior, MODEL._replace(position_std=0.0))
    assert (x, y) == pytest.approx(prior[:2], abs=1e-6) and heading != prior[2]
    assert refine_pose(points, corner() - 20.0, prior, prior, MODEL._replace(heading_std=0.0))[2] == (
        pytest.approx(prior[2], abs=1e-9)
    )


def test_a_beam_meets_the_side_of_a_wall_that_faces_it() -> None:
    points = points_at(np.array([[20.5, 20.5]]))
    assert not any(is_turned_away(points, 20, 20, x, y) for x, y in ((0.0, 5.0), (0.0, -5.0)))
    points.facing_y[20, 20] = -100
    assert not is_turned_away(points, 20, 20, 3.0, 9.0) and is_turned_away(points, 20, 20, 3.0, -9.0)
    # Along the wall the normal does not tell the sides apart.
    assert not is_turned_away(points, 20, 20, 9.0, -1.0) and is_turned_away(points, 20, 20, 9.0, -3.0)


def test_the_other_side_of_a_wall_pulls_nothing() -> None:
    wall = corner()[: len(corner()) // 2]
    # The robot stands above and believes to see the wall 0.7 cells higher than the means are.
    points, ends, start = points_at(wall), wall[20:60] - np.array([20.0, 33.3]), (20.0, 34.0, 0.0)
    assert refine_pose(points, ends, start, start, MODEL)[1] < 33.6
    points.facing_y[points.number > 0] = -100  # They were measured from below.
    assert refine_pose(points, ends, start, start, MODEL) == start
    assert not wall_line(points, 30, 15, 0.0, -1.0)[0] and wall_line(points, 30, 15, 0.0, 1.0)[0]
