"""Ray casting against a slow traversal in exact arithmetic, and the rules that all walls share."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from fractions import Fraction

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, MapError, StartError, UnknownNameError
from layoutexplore.grids.grid import Pose
from layoutexplore.sensing.lidar import SENSORS, Lidar, LidarConfig, around, clearance_field, sensor
from layoutexplore.sensing.mapper import Mapper

ORIGIN = Pose(0.0, 0.0)


def slow_ray(
    occupied: NDArray[np.bool_], x: float, y: float, angle: float, range_max: float
) -> tuple[float, list[tuple[int, int]]]:
    """Range and cells of a ray in rational numbers; at a corner the axis it moves less along goes first."""
    dx, dy = Fraction(math.cos(angle)), Fraction(math.sin(angle))
    fx, fy = Fraction(x), Fraction(y)
    rows, cols = occupied.shape
    row, col = math.floor(y), math.floor(x)
    x_leads = abs(dx) >= abs(dy)
    at, cells = Fraction(0), []
    while at <= range_max:
        inside = 0 <= row < rows and 0 <= col < cols
        if not inside or occupied[row, col]:
            return float(at), [*cells, (row, col)] if inside else cells
        cells.append((row, col))
        next_x = (Fraction(col + (dx > 0)) - fx) / dx if dx else math.inf
        next_y = (Fraction(row + (dy > 0)) - fy) / dy if dy else math.inf
        if next_x < next_y or (next_x == next_y and not x_leads):
            at, col = next_x, col + (1 if dx > 0 else -1)
        else:
            at, row = next_y, row + (1 if dy > 0 else -1)
    return math.inf, cells


@st.composite
def worlds(draw: st.DrawFn) -> NDArray[np.bool_]:
    shape = draw(st.tuples(st.integers(1, 30), st.integers(1, 30)))
    density = draw(st.sampled_from([0.0, 0.01, 0.05, 0.3]))
    return np.random.default_rng(draw(st.integers(0, 2**32))).random(shape) < density


@st.composite
def scenes(draw: st.DrawFn) -> tuple[NDArray[np.bool_], float, float, float]:
    """A world, a position in it in cells and a heading; positions at centres and on borders come often."""
    world = draw(worlds())
    part = st.one_of(st.floats(0, 0.999), st.sampled_from([0.0, 0.25, 0.5]))
    x = draw(st.integers(0, world.shape[1] - 1)) + draw(part)
    y = draw(st.integers(0, world.shape[0] - 1)) + draw(part)
    heading = draw(
        st.one_of(
            st.floats(-7, 7), st.sampled_from([0.0, math.pi / 4, math.pi / 2, -3 * math.pi / 4, math.pi])
        )
    )
    world[int(y), int(x)] = False
    return world, x, y, heading


@settings(max_examples=150, deadline=None)
@given(scenes(), st.floats(0.3, 60.0), st.sampled_from([0.05, 0.1, 1.0]))
@example((np.array([[False]]), 0.0, 0.0, -5e-324), 2.0, 0.05)
@example((np.zeros((1, 5), np.bool_), 4.0, 3.9373933505475837e-16, 0.0), 60.0, 1.0)
def test_ranges_are_those_of_the_slow_traversal(scene, reach, resolution) -> None:
    world, x, y, heading = scene
    config = LidarConfig(range_max=reach * resolution, fov=2 * math.pi, beams=24)
    ranges = Lidar(config, world, resolution, ORIGIN).scan(Pose(x * resolution, y * resolution, heading))
    # The very position that the lidar computes, so that rounding cannot put it into another cell.
    px, py = x * resolution / resolution, y * resolution / resolution
    for measured, angle in zip(ranges / resolution, config.angles() + heading, strict=True):
        exact, _ = slow_ray(world, px, py, angle, math.inf)
        if agree(exact, measured, reach):
            continue
        others = [min(r, reach) for r in nearly(world, px, py, angle)]
        # A ray along a border of cells leaves it where rounding says, between what its neighbours meet.
        grazes = abs(math.remainder(angle, math.pi / 2)) < 1e-7 and min(others) <= measured <= max(others)
        assert grazes or any(agree(r, measured, reach) for r in others)


def agree(exact: float, measured: float, reach: float) -> bool:
    """Whether two ranges are the same up to rounding; beyond the reach all are."""
    return math.isclose(min(exact, reach), min(measured, reach), rel_tol=1e-5, abs_tol=1e-5)


def nearly(world: NDArray[np.bool_], x: float, y: float, angle: float) -> list[float]:
    """Ranges of rays moved by a hair: where a ray touches a corner, rounding decides what it meets."""
    hair = (-1e-8, 0.0, 1e-8)
    moved = [(x + a, y + b, angle + c) for a in hair for b in hair for c in hair]
    return [slow_ray(world, px, py, turned, math.inf)[0] for px, py, turned in moved if min(px, py) >= 0]


def test_ranges_of_a_drawn_room() -> None:
    world = np.array([[c == "#" for c in line] for line in ("#######", "#.....#", "#.....#", "#######")])
    lidar = Lidar(LidarConfig(range_max=10.0, fov=2 * math.pi, beams=4), world, 0.5, Pose(-1.0, 2.0))
    # At (0.75, 2.75): 1.25 m to the left wall, 0.25 m down, 1.25 m to the right, 0.75 m up; the first beam
    # looks back.
    assert lidar.scan(Pose(0.75, 2.75, 0.0)).tolist() == [1.25, 0.25, 1.25, 0.75]
    assert lidar.scan(Pose(0.75, 2.75, math.pi)).round(6).tolist() == [1.25, 0.75, 1.25, 0.25]


@pytest.mark.parametrize("angle", [math.pi / 4, 3 * math.pi / 4, -math.pi / 4, -3 * math.pi / 4])
def test_no_ray_slips_between_two_cells_that_touch_at_a_corner(angle: float) -> None:
    world = np.zeros((20, 20), bool)
    row, col = (12 if math.sin(angle) > 0 else 7), (12 if math.cos(angle) > 0 else 7)
    # A diagonal wall right across the beam; its cells touch at corners only.
    for k in range(-6, 7):
        world[row + (k if math.sin(angle) * math.cos(angle) < 0 else -k), col + k] = True
    config = LidarConfig(range_max=20.0, fov=0.2, beams=21)
    for shift in (0.0, 1e-12, -1e-12, 0.1):
        ranges = Lidar(config, world, 1.0, ORIGIN).scan(Pose(10.0 + shift, 10.0, angle))
        assert (ranges < 5.0).all()


def test_a_pose_of_float32_is_not_counted_with_so_few_digits() -> None:
    world = np.zeros((40, 60), np.bool_)
    world[:, 50] = True
    lidar, origin = Lidar(sensor("indoor"), world, 0.1, Pose(-1000.0, 0.0)), Pose(-1000.0, 0.0)
    told = Pose(*np.array([-998.7, 2.3, 0.3], np.float32))
    exact = Pose(*map(float, told))
    np.testing.assert_array_equal(lidar.scan(told), lidar.scan(exact))
    maps = [Mapper(world.shape, 0.1, origin) for _ in range(2)]
    for mapper, pose in zip(maps, (told, exact), strict=True):
        mapper.integrate(pose, lidar.scan(exact), lidar.config)
    np.testing.assert_array_equal(maps[0].grid.cells, maps[1].grid.cells)


def test_outside_is_occupied_and_unseen_inside_a_wall() -> None:
    world = np.zeros((4, 6), bool)
    world[1, 1] = True
    lidar = Lidar(LidarConfig(range_max=100.0, fov=2 * math.pi, beams=4), world, 1.0, ORIGIN)
    assert lidar.scan(Pose(3.5, 2.5)).tolist() == [3.5, 2.5, 2.5, 1.5]
    assert not lidar.scan(Pose(1.5, 1.5)).any()
    assert not lidar.scan(Pose(-0.5, 1.5)).any() and not lidar.scan(Pose(3.0, 4.0)).any()


def test_a_range_beyond_the_maximum_is_infinite() -> None:
    world = np.zeros((3, 40), bool)
    world[:, 30] = True
    for range_max, seen in ((19.4, False), (19.6, True)):
        lidar = Lidar(LidarConfig(range_max=range_max, fov=1.0, beams=1), world, 1.0, ORIGIN)
        assert np.isfinite(lidar.scan(Pose(10.5, 1.5))).tolist() == [seen]


def test_clearance_is_the_chebyshev_distance() -> None:
    world = np.random.default_rng(3).random((17, 23)) < 0.02
    padded = np.pad(world, 1, constant_values=True)
    rows, cols = np.nonzero(padded)
    for r, c in np.ndindex(padded.shape):
        assert clearance_field(world)[r, c] == np.maximum(abs(rows - r), abs(cols - c)).min()
    assert Lidar(SENSORS["short"], world, 0.1, ORIGIN).clearance.shape == world.shape


@pytest.mark.parametrize("share", [0.0, 1e-5, 0.001, 0.3])
def test_clearance_is_that_of_the_distance_transform(share: float) -> None:
    """In halls too that are wider than a byte can say."""
    world = np.random.default_rng(4).random((600, 700)) < share
    free = np.pad(~world, 1).astype(np.uint8)
    expected = np.minimum(cv2.distanceTransform(free, cv2.DIST_C, 3), 255)
    np.testing.assert_array_equal(clearance_field(world), expected)


def test_lidars_over_one_read_only_world_share_their_clearance() -> None:
    world = np.zeros((50, 50), bool)
    world.setflags(write=False)
    first, second = (Lidar(SENSORS[name], world, 0.1, ORIGIN) for name in ("short", "indoor"))
    assert first.padded_clearance is second.padded_clearance
    assert not first.padded_clearance.flags.writeable


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda lidar: pickle.loads(pickle.dumps(lidar))])
def test_the_clearance_of_a_copy_is_read_only_too(duplicate: Callable[[Lidar], Lidar]) -> None:
    """Kernels are compiled for what may be written to and for what may not: a copy needs the same ones."""
    lidar = Lidar(LidarConfig(range_max=5.0, fov=1.0, beams=4), np.zeros((5, 5), bool), 1.0, Pose(0, 0))
    other = duplicate(lidar)
    assert not other.padded_clearance.flags.writeable
    assert np.array_equal(other.scan(Pose(1.5, 2.5)), lidar.scan(Pose(1.5, 2.5)))


def test_a_writeable_world_is_read_afresh() -> None:
    world = np.zeros((5, 5), bool)
    assert clearance_field(world)[3, 3] == 3
    world[2, 2] = True
    assert clearance_field(world)[3, 3] == 0


def test_angles() -> None:
    stage, indoor = sensor("stage"), sensor("indoor")
    assert stage.angles()[[0, 360, 720]].tolist() == [-math.pi / 2, 0.0, math.pi / 2]
    assert indoor.full_turn and not stage.full_turn
    assert indoor.angles()[0] == -math.pi and math.isclose(
        indoor.angles()[-1], math.pi - indoor.angle_increment
    )
    turned = LidarConfig(range_max=1.0, fov=math.pi, beams=3, angle_offset=0.5)
    assert np.allclose(turned.angles(), [0.5 - math.pi / 2, 0.5, 0.5 + math.pi / 2])
    assert LidarConfig(range_max=1.0, fov=1.0, beams=1).angles().tolist() == [0.0]


def test_angle_offset_turns_the_scan() -> None:
    world = np.random.default_rng(0).random((40, 40)) < 0.03
    world[20, 20] = False
    plain = Lidar(LidarConfig(range_max=30.0, fov=2.0, beams=31), world, 1.0, ORIGIN)
    turned = Lidar(LidarConfig(range_max=30.0, fov=2.0, beams=31, angle_offset=0.7), world, 1.0, ORIGIN)
    assert np.allclose(turned.scan(Pose(20.3, 20.6, 0.2)), plain.scan(Pose(20.3, 20.6, 0.9)), atol=1e-4)


def test_full_turn_has_the_same_density() -> None:
    world = np.random.default_rng(0).random((40, 40)) < 0.03
    world[20, 20] = False
    lidar = Lidar(LidarConfig(range_max=30.0, fov=math.pi, beams=181), world, 1.0, ORIGIN)
    ahead, all_around = lidar.scan(Pose(20.3, 20.6, 0.4)), lidar.scan_full_turn(Pose(20.3, 20.6, 0.4))
    assert all_around.size == 360 == around(lidar.config).beams
    assert np.allclose(all_around[90:271], ahead, atol=1e-4)
    assert around(sensor("mapex")) is sensor("mapex")


def test_noise_and_dropouts() -> None:
    world = np.zeros((100, 100), bool)
    exact = LidarConfig(range_max=45.0, fov=2 * math.pi, beams=4000)
    noisy = LidarConfig(range_max=45.0, fov=2 * math.pi, beams=4000, range_noise_std=0.1, dropout=0.2)
    pose = Pose(50.0, 50.0, 0.1)
    truth = Lidar(exact, world, 1.0, ORIGIN).scan(pose)
    lidar = Lidar(noisy, world, 1.0, ORIGIN)
    ranges = lidar.scan(pose, np.random.default_rng(0))
    assert np.array_equal(ranges, lidar.scan(pose, np.random.default_rng(0)), equal_nan=True)
    assert not np.array_equal(ranges, lidar.scan(pose, np.random.default_rng(1)), equal_nan=True)
    assert 0.17 < np.isnan(ranges).mean() < 0.23
    assert np.isinf(truth).all() and np.isinf(ranges[~np.isnan(ranges)]).all()
    near = Lidar(
        LidarConfig(range_max=99.0, fov=2 * math.pi, beams=4000, range_noise_std=0.1), world, 1.0, ORIGIN
    )
    error = near.scan(pose, np.random.default_rng(0)) - Lidar(
        LidarConfig(range_max=99.0, fov=2 * math.pi, beams=4000), world, 1.0, ORIGIN
    ).scan(pose)
    assert abs(error.mean()) < 0.01 and 0.09 < error.std() < 0.11
    with pytest.raises(ConfigError, match="generator"):
        lidar.scan(pose)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("range_max", v) for v in (0.0, math.nan, math.inf)),
        *(("fov", v) for v in (0.0, 7.0, math.nan)),
        *(("beams", v) for v in (0, 2.5, math.nan)),
        *(("dropout", v) for v in (1.0, -0.1, math.nan)),
        ("angle_offset", math.inf),
        ("range_noise_std", -1.0),
    ],
)
def test_nonsense_is_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigError):
        LidarConfig(**{"range_max": 5.0, "fov": 3.0, "beams": 10, name: value})


@pytest.mark.parametrize(("fov", "beams"), [(math.pi, 100_000), (math.radians(1), 1000), (1e-9, 1)])
def test_lidars_too_dense_to_turn_once_around_are_refused(fov: float, beams: int) -> None:
    with pytest.raises(ConfigError, match="turned once around it has"):
        LidarConfig(range_max=5.0, fov=fov, beams=beams)
    assert around(LidarConfig(range_max=5.0, fov=math.radians(1), beams=250)).beams < 100_000


def test_unusable_worlds_and_poses_are_refused() -> None:
    config = SENSORS["short"]
    with pytest.raises(MapError, match="yaw"):
        Lidar(config, np.zeros((3, 3), bool), 0.1, Pose(0, 0, 0.3))
    with pytest.raises(MapError, match="resolution"):
        Lidar(config, np.zeros((3, 3), bool), 0.0, ORIGIN)
    with pytest.raises(MapError, match="two-dimensional"):
        Lidar(config, np.zeros(3, bool), 0.1, ORIGIN)
    with pytest.raises(StartError, match="finite"):
        Lidar(config, np.zeros((3, 3), bool), 0.1, ORIGIN).scan(Pose(math.nan, 0.0))


def test_sensors_by_name() -> None:
    assert sensor("stage").beams == 721 and sensor("stage").range_max == 30.0
    assert {name: (round(math.degrees(s.fov)), s.range_max, s.beams) for name, s in SENSORS.items()} == {
        "stage": (180, 30.0, 721),
        "indoor": (360, 8.0, 720),
        "short": (360, 5.0, 360),
        "mapex": (360, 20.0, 2500),
    }
    mine = LidarConfig(range_max=1.0, fov=1.0, beams=5)
    assert sensor(mine) is mine
    with pytest.raises(UnknownNameError, match="did you mean 'indoor'"):
        sensor("indor")
