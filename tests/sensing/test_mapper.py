"""What scans do to a grid: against slow rays, with and without noise, and the counts that go with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, MapError, StartError
from layoutexplore.grids.grid import Pose
from layoutexplore.sensing.lidar import SENSORS, Lidar, LidarConfig, beam_table
from layoutexplore.sensing.mapper import Mapper, MapperConfig, ScanUpdate
from layoutexplore.sensing.scan_kernels import FieldOfView, update_occupancy

ORIGIN = Pose(0.0, 0.0)
NOTHING = (0, 0, 0, 0)


def random_world(rng: np.random.Generator, side: int, density: float) -> NDArray[np.bool_]:
    return rng.random((side, side + 3)) < density


def walk_cells(
    occupied: NDArray[np.bool_], x: float, y: float, angle: float, reach: float
) -> tuple[set, set]:
    """Cells that a ray crosses and the one it hits, by small steps in floating point."""
    rows, cols = occupied.shape
    crossed: set[tuple[int, int]] = set()
    borders = [0.0]
    dx, dy = math.cos(angle), math.sin(angle)
    for position, step, size in ((x, dx, cols), (y, dy, rows)):
        if step:
            borders += [(line - position) / step for line in range(size + 1) if (line - position) / step > 0]
    borders.sort()
    for a, b in zip(borders, [*borders[1:], borders[-1] + 1.0], strict=True):
        if a > reach:
            return crossed, set()
        middle = (a + b) / 2
        cell = math.floor(y + middle * dy), math.floor(x + middle * dx)
        if not (0 <= cell[0] < rows and 0 <= cell[1] < cols):
            return crossed, set()
        if occupied[cell]:
            return crossed, {cell}
        crossed.add(cell)
    return crossed, set()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.02, 0.2]), st.booleans())
def test_observe_marks_what_the_rays_cross_and_hit(seed: int, density: float, full: bool) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, 30, density)
    x, y, heading, reach = rng.uniform(0, 33), rng.uniform(0, 30), rng.uniform(-4, 4), rng.uniform(2, 40)
    world[int(y), int(x)] = False
    config = LidarConfig(range_max=reach, fov=2 * math.pi if full else math.pi, beams=200 if full else 101)
    mapper = Mapper(world.shape, 1.0, ORIGIN)
    update = mapper.observe(Lidar(config, world, 1.0, ORIGIN), Pose(x, y, heading))
    expected = np.full(world.shape, -1, np.int8)
    for angle in config.angles() + heading:
        crossed, hit = walk_cells(world, x, y, angle, reach)
        for cell in crossed:
            expected[cell] = 0
        for cell in hit:
            expected[cell] = 100
    assert np.array_equal(mapper.grid.cells, expected)
    assert_update(update, np.full(world.shape, -1, np.int8), mapper)


def assert_update(update: ScanUpdate, before: NDArray[np.int8], mapper: Mapper) -> None:
    """The update and the running counts say what really changed."""
    after = mapper.grid.cells
    assert update.new_cells == np.count_nonzero((before == -1) & (after != -1))
    assert update.new_occupied == np.count_nonzero((before != 100) & (after == 100))
    assert (mapper.known_free, mapper.occupied_count) == (
        np.count_nonzero(after == 0),
        np.count_nonzero(after == 100),
    )
    changed = np.argwhere(before != after)
    if changed.size:
        low, high = changed.min(axis=0), changed.max(axis=0) + 1
        assert update.box == (low[0], high[0], low[1], high[1])
    else:
        assert update.box == NOTHING


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.002, 0.02]),
    st.sampled_from(["stage", "indoor", "short"]),
    st.sampled_from([0.0, math.pi / 4, math.pi / 2, math.pi, -1.0, 0.3]),
    st.sampled_from([0.0, 0.5, None]),
)
def test_updating_the_open_square_at_once_changes_nothing(
    seed: int, density: float, name: str, heading: float, part: float | None
) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, 90, density)
    config = SENSORS[name]
    col, row = rng.integers(10, 80, 2)
    x, y = (col + rng.random(), row + rng.random()) if part is None else (col + part, row + part)
    world[int(y), int(x)] = False
    lidar = Lidar(config, world, 0.1, ORIGIN)
    mapper = Mapper(world.shape, 0.1, ORIGIN)
    pose = Pose(x * 0.1, y * 0.1, heading)
    mapper.observe(lidar, pose)
    plain = np.full(world.shape, -1, np.int8)
    position = pose.x / 0.1, pose.y / 0.1
    view = FieldOfView(*beam_table(config), 0.0, config.angle_increment, config.range_max / 0.1, -1, False)
    update_occupancy(lidar.padded_clearance, plain, *position, heading, view)
    assert np.array_equal(mapper.grid.cells, plain)


def test_the_map_shows_the_walls_that_the_lidar_measures() -> None:
    rng = np.random.default_rng(5)
    world = random_world(rng, 60, 0.03)
    world[30, 30] = False
    lidar = Lidar(SENSORS["short"], world, 0.1, ORIGIN)
    mapper = Mapper(world.shape, 0.1, ORIGIN)
    pose = Pose(3.05, 3.05, 0.2)
    mapper.observe(lidar, pose)
    ranges = lidar.scan(pose)
    angles = lidar.config.angles() + pose.theta
    seen = np.isfinite(ranges)
    assert seen.sum() > 50
    ends = np.stack(
        [pose.x + (ranges + 1e-4) * np.cos(angles), pose.y + (ranges + 1e-4) * np.sin(angles)], axis=1
    )[seen]
    cells = mapper.grid.world_to_cells(ends)
    inside = (cells >= 0).all(axis=1) & (cells < world.shape).all(axis=1)
    assert (
        mapper.grid.cells[tuple(cells[inside].T)] == 100
    ).mean() > 0.99  # A grazed corner may round to its neighbour.
    assert (world[mapper.grid.cells == 100]).all() and not world[mapper.grid.cells == 0].any()


def test_observing_twice_changes_nothing_and_occupied_stays() -> None:
    world = np.zeros((20, 20), bool)
    world[:, 15] = True
    lidar = Lidar(SENSORS["short"], world, 0.1, ORIGIN)
    mapper = Mapper(world.shape, 0.1, ORIGIN)
    mapper.mark_occupied([(10, 8)])
    mapper.observe(lidar, Pose(1.0, 1.0))
    assert mapper.grid.cells[10, 8] == 100
    before = mapper.grid.cells.copy()
    assert mapper.observe(lidar, Pose(1.0, 1.0)) == ScanUpdate(0, 0, NOTHING)
    assert np.array_equal(before, mapper.grid.cells)


def test_half_a_turn_sees_nothing_behind_and_full_turn_does() -> None:
    world = np.zeros((40, 40), bool)
    lidar = Lidar(SENSORS["stage"], world, 0.1, ORIGIN)
    mapper = Mapper(world.shape, 0.1, ORIGIN)
    mapper.observe(lidar, Pose(2.05, 2.05, 0.0))
    cells = mapper.grid.cells
    assert (cells[:, :20] == -1).all() and (cells[:, 21:] == 0).all()
    mapper.observe(lidar, Pose(2.05, 2.05, 0.0), full_turn=True)
    assert (cells == 0).all()


def test_a_pose_outside_or_in_a_wall() -> None:
    world = np.zeros((10, 10), bool)
    world[4, 4] = True
    lidar = Lidar(SENSORS["short"], world, 1.0, ORIGIN)
    mapper = Mapper(world.shape, 1.0, ORIGIN)
    assert mapper.observe(lidar, Pose(-3.0, 5.0)) == ScanUpdate(0, 0, NOTHING)
    assert mapper.observe(lidar, Pose(4.5, 4.5)) == ScanUpdate(1, 1, (4, 5, 4, 5))
    assert mapper.integrate(Pose(-3.0, 5.0), np.full(360, 2.0), SENSORS["short"]) == ScanUpdate(0, 0, NOTHING)
    with pytest.raises(StartError):
        mapper.observe(lidar, Pose(math.nan, 1.0))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.005, 0.02, 0.1]))
def test_integrating_exact_ranges_gives_the_observed_map(seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, 50, density)
    x, y = rng.uniform(5, 45, 2)
    world[int(y), int(x)] = False
    config = LidarConfig(range_max=20.0, fov=2 * math.pi, beams=180)
    lidar = Lidar(config, world, 1.0, ORIGIN)
    pose = Pose(x, y, rng.uniform(-3, 3))
    seen, weighed = Mapper(world.shape, 1.0, ORIGIN), Mapper(world.shape, 1.0, ORIGIN)
    seen.observe(lidar, pose)
    update = weighed.integrate(pose, lidar.scan(pose), config)
    # A prolonged beam that only clips the corner of a wall's cell may end in the cell behind it.
    assert (seen.grid.cells != weighed.grid.cells).mean() < 0.005
    assert_update(update, np.full(world.shape, -1, np.int8), weighed)


def weigh_slowly(evidence: NDArray, pose: Pose, ranges: NDArray, lidar: LidarConfig) -> None:
    """One scan on a grid of one metre a cell: every beam walked, beams that end and that cross counted."""
    crossed, ended = np.zeros(evidence.shape, int), np.zeros(evidence.shape, int)
    for angle, measured in zip(lidar.angles() + pose.theta, ranges.astype(float), strict=True):
        if math.isnan(measured):
            continue
        length = measured + 1e-3
        cells, _ = walk_cells(
            np.zeros(evidence.shape, bool), pose.x, pose.y, angle, min(length, lidar.range_max)
        )
        for cell in cells:
            crossed[cell] += 1
        if length <= lidar.range_max + 2e-3:
            row, col = (
                math.floor(pose.y + length * math.sin(angle)),
                math.floor(pose.x + length * math.cos(angle)),
            )
            if 0 <= row < evidence.shape[0] and 0 <= col < evidence.shape[1]:
                ended[row, col] += 1
    hit = (ended > 0) & (10 * ended >= crossed)
    evidence[hit] = np.minimum(evidence[hit] + 85, 350)
    missed = ~hit & (crossed + ended > 0)
    evidence[missed] = np.maximum(evidence[missed] - 40, -200)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from([1, 2, 7, 50, 180, 719]),
    st.sampled_from([0.5, math.pi, 6.0, 2 * math.pi]),
    st.sampled_from([0.0, 0.05, 0.4]),
)
def test_noisy_scans_are_weighed_as_beam_by_beam(seed: int, beams: int, fov: float, dropout: float) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, 40, rng.choice([0.003, 0.02, 0.1]))
    noise = float(rng.choice([0.01, 0.3, 3.0]))
    config = LidarConfig(range_max=18.0, fov=fov, beams=beams, range_noise_std=noise, dropout=dropout)
    lidar, mapper = Lidar(config, world, 1.0, ORIGIN), Mapper(world.shape, 1.0, ORIGIN)
    evidence, cells = np.zeros(world.shape, int), np.full(world.shape, -1, np.int8)
    place = rng.uniform(1, 39, 2)
    for _ in range(6):
        pose = Pose(*np.clip(place + rng.normal(0, 1, 2), 0.1, 39.9), rng.uniform(-4, 4))
        ranges, before = lidar.scan(pose, rng), mapper.grid.cells.copy()
        update = mapper.integrate(pose, ranges, config)
        weigh_slowly(evidence, pose, ranges, config)
        cells[evidence <= -40] = 0
        cells[evidence >= 85] = 100
        assert np.array_equal(mapper.grid.cells, cells)
        assert_update(update, before, mapper)


def test_a_negative_range_is_that_of_a_failed_beam() -> None:
    mapper, lidar, pose = corridor_mapper()
    assert mapper.integrate(pose, np.array([-2.0]), lidar) == ScanUpdate(0, 0, NOTHING)


def corridor_mapper(config: MapperConfig | None = None) -> tuple[Mapper, LidarConfig, Pose]:
    return Mapper((3, 12), 1.0, ORIGIN, config), LidarConfig(range_max=8.0, fov=1.0, beams=1), Pose(1.5, 1.5)


def test_evidence_is_weighed_and_clamped() -> None:
    mapper, lidar, pose = corridor_mapper()
    row = mapper.grid.cells[1]
    mapper.integrate(pose, np.array([5.0]), lidar)
    assert row.tolist() == [-1, 0, 0, 0, 0, 0, 100, -1, -1, -1, -1, -1][: len(row)]
    for _ in range(50):
        mapper.integrate(pose, np.array([5.0]), lidar)
    # Clamped at 3.5, the wall needs (3.5 + 0.4) / 0.4 = 9.75 contradictions to become free.
    for n in range(10):
        assert row[6] == 100, n
        update = mapper.integrate(pose, np.array([7.0]), lidar)
    assert row[6] == 0 and update == ScanUpdate(0, 0, (1, 2, 6, 7))
    assert mapper.known_free == 7 and mapper.occupied_count == 1


def test_no_return_is_free_up_to_the_range_and_a_failed_beam_tells_nothing() -> None:
    mapper, lidar, pose = corridor_mapper()
    assert mapper.integrate(pose, np.array([np.nan]), lidar) == ScanUpdate(0, 0, NOTHING)
    mapper.integrate(pose, np.array([np.inf]), lidar)
    assert mapper.grid.cells[1].tolist() == [-1] + [0] * 9 + [-1, -1]
    assert mapper.occupied_count == 0


@pytest.mark.parametrize(("ended", "cell"), [(3, 100), (1, 0)])
def test_a_tenth_of_the_beams_prevails_over_those_that_pass(ended: int, cell: int) -> None:
    """Of 21 beams into a cell three make it a wall; one may come from noise beside a jamb."""
    mapper = Mapper((3, 12), 1.0, ORIGIN)
    lidar = LidarConfig(range_max=9.0, fov=0.02, beams=21)
    ranges = np.full(21, np.inf)
    ranges[9 : 9 + ended] = 5.0
    mapper.integrate(Pose(1.5, 1.5), ranges, lidar)
    assert mapper.grid.cells[1, 6] == cell


def test_noise_averages_out() -> None:
    world = np.zeros((60, 60), bool)
    world[[5, 54], 5:55] = world[5:55, [5, 54]] = True
    config = LidarConfig(range_max=9.0, fov=2 * math.pi, beams=360, range_noise_std=0.03, dropout=0.1)
    lidar = Lidar(config, world, 0.1, ORIGIN)
    mapper = Mapper(world.shape, 0.1, ORIGIN)
    rng = np.random.default_rng(1)
    for _ in range(300):
        before = mapper.grid.cells.copy()
        pose = Pose(*rng.uniform(1.5, 4.5, 2), rng.uniform(-3, 3))
        assert_update(mapper.integrate(pose, lidar.scan(pose, rng), config), before, mapper)
    inside = np.zeros_like(world)
    inside[7:53, 7:53] = True
    assert (mapper.grid.cells[inside] == 0).mean() > 0.99
    near_wall = np.zeros_like(world)
    near_wall[4:7] = near_wall[53:56] = near_wall[:, 4:7] = near_wall[:, 53:56] = True
    assert not (mapper.grid.cells == 100)[~near_wall].any()
    assert (mapper.grid.cells == 100)[world].mean() > 0.8


def test_evidence_starts_from_what_the_grid_holds() -> None:
    mapper, lidar, pose = corridor_mapper()
    mapper.mark_occupied([(1, 4)])
    mapper.integrate(pose, np.array([7.0]), lidar)
    assert mapper.grid.cells[1, 4] == 100


def test_bumps() -> None:
    mapper = Mapper((4, 5), 1.0, ORIGIN)
    assert mapper.mark_occupied(np.array([[1, 2], [1, 2], [3, 4], [9, 9], [-1, 0]])) == ScanUpdate(
        2, 2, (1, 4, 2, 5)
    )
    assert mapper.mark_occupied([(1, 2)]) == ScanUpdate(0, 0, NOTHING)
    assert mapper.mark_occupied(np.empty((0, 2), int)) == ScanUpdate(0, 0, NOTHING)
    assert mapper.occupied_count == 2 and np.argwhere(mapper.grid.cells == 100).tolist() == [[1, 2], [3, 4]]


def test_memory_of_a_mapper() -> None:
    mapper = Mapper((1000, 1000), 0.1, ORIGIN)
    assert mapper.grid.cells.nbytes == 1_000_000 and mapper.grid.cells.dtype == np.int8


def test_misfits_are_refused() -> None:
    mapper = Mapper((5, 5), 0.1, ORIGIN)
    config = SENSORS["short"]
    for lidar in (
        Lidar(config, np.zeros((5, 6), bool), 0.1, ORIGIN),
        Lidar(config, np.zeros((5, 5), bool), 0.2, ORIGIN),
        Lidar(config, np.zeros((5, 5), bool), 0.1, Pose(1.0, 0.0)),
    ):
        with pytest.raises(MapError, match="is not that of the grid"):
            mapper.observe(lidar, Pose(0.2, 0.2))
    with pytest.raises(ConfigError, match="360 beams"):
        mapper.integrate(Pose(0.2, 0.2), np.zeros(5), config)
    with pytest.raises(MapError, match="at least one cell"):
        Mapper((0, 5), 0.1, ORIGIN)
    with pytest.raises(MapError, match="yaw"):
        Mapper((5, 5), 0.1, Pose(0, 0, 1.0))


@pytest.mark.parametrize(
    "wrong",
    [
        {"hit": 0.0},
        {"hit": 0.004},
        {"miss": math.nan},
        {"miss": 0.005},
        {"clamp": (0.0, 3.5)},
        {"free_below": 0.9},
        {"occupied_above": 9.0},
        {"free_below": 0.001, "occupied_above": 0.004},
        {"hit_share": 0.0},
        {"hit_share": -1.0},
        {"hit_share": 50.0},
        {"hit_share": math.nan},
        {"hit_share": 0.004},
    ],
)
def test_weights_that_make_no_sense_are_refused(wrong: dict) -> None:
    with pytest.raises(ConfigError):
        MapperConfig(**wrong)
