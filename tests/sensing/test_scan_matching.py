"""Scan matching: a pose that odometry has wrong is found again; without anything in sight nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import Pose
from layoutexplore.sensing.lidar import SENSORS, Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.sensing.measured_points import MeasuredPoints
from layoutexplore.sensing.pose_refinement import MatchModel
from layoutexplore.sensing.scan_matching import ScanMatcher, ScanMatcherConfig, match_score, search_pose

ORIGIN = Pose(0.0, 0.0, 0.0)
INDOOR = SENSORS["indoor"]


def room() -> np.ndarray:
    """Two rooms and a doorway on 8 m x 6 m, cells of 0.1 m."""
    world = np.zeros((60, 80), bool)
    world[[0, 1, -1, -2]] = True
    world[:, [0, 1, -1, -2]] = True
    world[2:40, 38:40] = True
    world[20:28, 10:16] = True
    return world


def matched(world: np.ndarray, config: LidarConfig, noise: float = 0.0) -> tuple[Lidar, ScanMatcher]:
    """A matcher with the map of a few exact scans."""
    lidar, mapper = Lidar(config, world, 0.1, ORIGIN), Mapper(world.shape, 0.1, ORIGIN)
    matcher = ScanMatcher(mapper.grid)
    rng = np.random.default_rng(5)
    for x, y in ((2.5, 4.6), (3.0, 3.5), (5.5, 4.0), (6.0, 2.0)):
        pose = Pose(x, y, 0.3)
        ranges = lidar.scan(pose)
        if noise:
            ranges = ranges + rng.normal(0.0, noise, ranges.shape).astype(np.float32)
        mapper.integrate(pose, ranges, config)
        matcher.add(pose, ranges, config)
    return lidar, matcher


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-0.15, 0.15),
    st.floats(-0.15, 0.15),
    st.floats(-0.06, 0.06),
    st.sampled_from([(2.5, 4.6), (3.2, 3.6), (5.6, 3.8)]),
)
def test_a_wrong_pose_is_found_again(dx: float, dy: float, turn: float, place: tuple[float, float]) -> None:
    lidar, matcher = matched(room(), INDOOR)
    true = Pose(*place, 0.4)
    believed = Pose(true.x + dx, true.y + dy, true.theta + turn)
    found = matcher.match(believed, lidar.scan(true), INDOOR, position_std=0.08, heading_std=0.03)
    assert math.hypot(found.x - true.x, found.y - true.y) < 0.03
    assert abs(found.theta - true.theta) < 0.02


def test_a_right_pose_stays_under_noise() -> None:
    lidar, matcher = matched(room(), INDOOR, noise=0.03)
    rng = np.random.default_rng(0)
    for _ in range(20):
        true = Pose(*rng.uniform((2.0, 4.3), (6.5, 5.2)), rng.uniform(-3, 3))
        ranges = lidar.scan(true) + rng.normal(0.0, 0.03, INDOOR.beams).astype(np.float32)
        found = matcher.match(true, ranges, INDOOR, position_std=0.05, heading_std=0.02)
        assert math.hypot(found.x - true.x, found.y - true.y) < 0.05
        assert abs(found.theta - true.theta) < 0.006 and matcher.overlap > 40


def test_a_wide_search_finds_a_robot_that_was_lost() -> None:
    lidar, matcher = matched(room(), INDOOR)
    true = Pose(3.2, 3.6, 0.4)
    for dx, dy, turn in ((0.9, -0.6, 0.15), (-0.5, 0.8, -0.2)):
        lost = Pose(true.x + dx, true.y + dy, true.theta + turn)
        found = matcher.match(lost, lidar.scan(true), INDOOR, position_std=0.6, heading_std=0.1)
        assert math.hypot(found.x - true.x, found.y - true.y) < 0.03
        assert abs(found.theta - true.theta) < 0.005


def test_nothing_moves_without_a_map_or_without_a_reading() -> None:
    world = room()
    lidar, matcher = matched(world, INDOOR)
    pose = Pose(2.5, 4.6, 0.1)
    empty = ScanMatcher(Mapper(world.shape, 0.1, ORIGIN).grid)
    assert empty.match(pose, lidar.scan(pose), INDOOR, position_std=0.1, heading_std=0.1) == pose
    assert empty.overlap == 0.0
    nothing = np.full(INDOOR.beams, np.inf, np.float32)
    assert matcher.match(pose, nothing, INDOOR, position_std=0.1, heading_std=0.1) == pose
    assert matcher.match(pose, lidar.scan(pose), INDOOR, position_std=0.0, heading_std=0.0) == pose


def test_the_two_sides_of_a_thin_wall_are_two_surfaces() -> None:
    world = np.zeros((80, 80), bool)
    world[[0, 1, -1, -2]] = world[:, [0, 1, -1, -2]] = True
    world[40:42, :68] = True
    lidar, mapper = Lidar(INDOOR, world, 0.1, ORIGIN), Mapper(world.shape, 0.1, ORIGIN)
    matcher = ScanMatcher(mapper.grid)
    for x in (2.0, 3.0, 4.0):  # below the wall
        matcher.add(Pose(x, 3.0, 0.0), lidar.scan(Pose(x, 3.0, 0.0)), INDOOR)
    # Above it, near enough to see hardly more than the side of the wall that no scan has seen before.
    true = Pose(3.0, 4.5, 0.0)
    ranges = lidar.scan(true)
    ranges[ranges > 2.0] = np.nan
    found = matcher.match(true, ranges, INDOOR, position_std=0.08, heading_std=0.03)
    assert math.hypot(found.x - true.x, found.y - true.y) < 0.03 and abs(found.theta) < 0.005


def test_along_a_corridor_without_ends_odometry_is_believed() -> None:
    world = np.zeros((16, 400), bool)
    world[[0, 1, -1, -2]] = True
    config = LidarConfig(range_max=5.0, fov=2 * math.pi, beams=360)
    lidar, mapper = Lidar(config, world, 0.1, ORIGIN), Mapper(world.shape, 0.1, ORIGIN)
    matcher = ScanMatcher(mapper.grid)
    for x in np.arange(12.0, 28.0, 0.37):
        matcher.add(Pose(x, 0.8, 0.0), lidar.scan(Pose(x, 0.8, 0.0)), config)
    believed, true = Pose(20.05, 0.9, 0.02), Pose(20.0, 0.8, 0.0)
    found = matcher.match(believed, lidar.scan(true), config, position_std=0.05, heading_std=0.02)
    assert abs(found.x - believed.x) < 0.03  # Nothing tells how far along the robot is.
    assert abs(found.y - true.y) < 0.02 and abs(found.theta) < 0.005


def scattered(rng: np.random.Generator, shape: tuple[int, int]) -> MeasuredPoints:
    """Points in three of ten cells, some of which face a side."""
    number = np.zeros(shape, np.float32)
    number[1:-1, 1:-1] = rng.random((shape[0] - 2, shape[1] - 2)) < 0.3
    rows, cols = np.mgrid[: shape[0], : shape[1]]
    x, y = ((axis + rng.random(shape)).astype(np.float32) for axis in (cols, rows))
    facing = rng.choice([-100, 0, 0, 100], (2, *shape)).astype(np.int8)
    padded, around = np.pad(number > 0, 1), np.zeros(shape, np.uint16)
    for k in range(9):
        around |= padded[k // 3 :, k % 3 :][: shape[0], : shape[1]].astype(np.uint16) << k
    return MeasuredPoints(number, x, y, *facing, around)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.just(0.0) | st.floats(1e-3, 2.5),
    st.just(0.0) | st.floats(1e-4, 0.05),
    st.integers(1, 3),
)
def test_a_search_finds_the_best_of_all_poses(seed: int, std: float, heading_std: float, levels: int) -> None:
    rng = np.random.default_rng(seed)
    points, spread, weight = scattered(rng, (25, 30)), rng.uniform(0.3, 1.0), rng.uniform(0.1, 2.0)
    # Some points lie outside, and poses near the border too.
    ends, prior = rng.uniform(-14, 14, (40, 2)), (*rng.uniform(3, 22, 2), rng.uniform(-3, 3))

    def value(pose: tuple[float, float, float]) -> float:
        off = (np.hypot(pose[0] - prior[0], pose[1] - prior[1]), pose[2] - prior[2])
        unlikely = sum((d / s) ** 2 for d, s in zip(off, (std, heading_std), strict=True) if s > 0)
        return weight * match_score(points, ends, pose, spread) - 0.5 * unlikely

    steps = [min(max(2, math.ceil(3 * s / m)), 12) for s, m in ((std, 2 * spread), (heading_std, 0.02))]
    step, turn = 3 * std / steps[0], 3 * heading_std / steps[1]
    best = prior
    for _ in range(levels + 1):
        near, turns = (np.arange(-n, n + 1) for n in steps)
        poses = [
            (best[0] + i * step, best[1] + j * step, best[2] + k * turn)
            for i in near
            for j in near
            for k in turns
        ]
        best = max([best, *poses], key=value)
        step, turn, steps = step / 2, turn / 2, [1, 1]
    found = search_pose(points, ends, prior, MatchModel(spread, weight, std, heading_std), levels)
    assert found == pytest.approx(best, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_score_is_that_of_the_slow_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = scattered(rng, (12, 15))
    number, x, y, facing = points.number, points.x, points.y, np.array([points.facing_x, points.facing_y])
    ends, pose, spread = rng.uniform(-5, 5, (30, 2)), (7.0, 6.0, rng.uniform(-3, 3)), 0.4
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for end in ends:
        beam_x, beam_y = end[0] * cos - end[1] * sin, end[0] * sin + end[1] * cos
        at_x, at_y = pose[0] + beam_x, pose[1] + beam_y
        if 1 <= at_x < 14 and 1 <= at_y < 11:
            near = [
                ((float(x[r, c]) - at_x) ** 2 + (float(y[r, c]) - at_y) ** 2, r, c)
                for r in range(int(at_y) - 1, int(at_y) + 2)
                for c in range(int(at_x) - 1, int(at_x) + 2)
                if number[r, c] > 0
            ]
            if near and min(near)[0] < 9 * spread**2:
                away, r, c = min(near)
                beam = np.array([beam_x, beam_y]) / math.hypot(beam_x, beam_y)
                if facing[:, r, c] @ beam <= 20.0:
                    total += math.exp(-0.5 * away / spread**2)
    assert match_score(points, ends, pose, spread) == pytest.approx(total, rel=1e-9)


def test_options_are_checked() -> None:
    with pytest.raises(ConfigError, match="beams"):
        ScanMatcherConfig(beams=0)
    with pytest.raises(ConfigError, match="levels"):
        ScanMatcherConfig(levels=99)


@pytest.mark.parametrize("least", [1e-10, 1e-200, 5e-324])
def test_odometry_that_is_all_but_exact_counts_as_exact(least: float) -> None:
    lidar, matcher = matched(room(), INDOOR)
    true = Pose(3.2, 3.6, 0.4)
    believed, ranges = Pose(true.x, true.y, true.theta + 0.03), lidar.scan(true)
    assert matcher.match(believed, ranges, INDOOR, position_std=least, heading_std=least) == believed
    turned = matcher.match(believed, ranges, INDOOR, position_std=least, heading_std=0.03)
    assert turned == matcher.match(believed, ranges, INDOOR, position_std=0.0, heading_std=0.03)
    assert (turned.x, turned.y) == (believed.x, believed.y) and abs(turned.theta - true.theta) < 0.02
