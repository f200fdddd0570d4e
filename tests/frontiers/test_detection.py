"""Frontiers against morphology and labelling, and the unknown area in sight against geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.frontiers.detection import FrontierClusters, FrontierDetector, find_frontiers
from layoutexplore.frontiers.visible_area import VisibleUnknownArea, visible_unknown_area


def random_cells(seed: int, shape: tuple[int, int], unknown: float = 0.3) -> NDArray[np.int8]:
    """Cells with patches rather than salt: some unknown, some occupied, a few of values in between."""
    rng = np.random.default_rng(seed)
    noise = ndimage.uniform_filter(rng.random(shape), 3)
    cells = np.where(noise < np.quantile(noise, unknown), -1, 0).astype(np.int8)
    cells[rng.random(shape) < 0.1] = 100
    cells[rng.random(shape) < 0.02] = 50
    return cells


def slow_frontiers(cells: NDArray[np.int8]) -> list[list[list[int]]]:
    mask = (cells == 0) & ndimage.binary_dilation(cells == -1)
    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    order = list(dict.fromkeys(labels[mask]))
    return [np.argwhere(labels == k).tolist() for k in order]


def as_lists(clusters: FrontierClusters) -> list[list[list[int]]]:
    return [clusters.cluster(i).tolist() for i in range(len(clusters))]


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32),
    st.tuples(st.integers(1, 25), st.integers(1, 25)),
    st.sampled_from([0.05, 0.3, 0.7]),
)
def test_frontiers_are_those_of_morphology(seed: int, shape: tuple[int, int], unknown: float) -> None:
    cells = random_cells(seed, shape, unknown)
    clusters = find_frontiers(cells)
    assert as_lists(clusters) == slow_frontiers(cells)
    assert clusters.cells.dtype == np.int32 and clusters.offsets.dtype == np.int64


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32), st.tuples(st.integers(1, 30), st.integers(1, 30)))
def test_updates_give_the_full_computation(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    cells = np.full(shape, -1, np.int8)
    detector = FrontierDetector(shape)
    for step in range(6):
        row0, col0 = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        row1, col1 = rng.integers(row0, shape[0] + 1), rng.integers(col0, shape[1] + 1)
        patch = random_cells(seed + step, shape)[row0:row1, col0:col1]
        cells[row0:row1, col0:col1] = patch
        clusters = detector.update(cells, (int(row0), int(row1), int(col0), int(col1)))
        full = find_frontiers(cells)
        assert np.array_equal(clusters.cells, full.cells) and np.array_equal(clusters.offsets, full.offsets)


def test_nothing_to_find() -> None:
    for value in (-1, 0, 100):
        clusters = find_frontiers(np.full((6, 7), value, np.int8))
        assert len(clusters) == 0 and clusters.cells.shape == (0, 2) and clusters.offsets.tolist() == [0]


def test_a_snake_is_one_cluster() -> None:
    # The arms of a comb are joined at their far ends only: every merging of labels is needed.
    cells = np.full((9, 17), -1, np.int8)
    cells[::2] = 100
    cells[1::2, ::2] = 0
    cells[2::4, -1] = cells[4::4, 0] = 0
    assert as_lists(find_frontiers(cells)) == slow_frontiers(cells)


def test_an_open_plain_is_seen_whole() -> None:
    cells = np.full((201, 201), -1, np.int8)
    middle = np.array([[100, 100]], np.int32)
    assert np.isclose(visible_unknown_area(cells, middle, 0.1, 8.0, 120)[0], math.pi * 64.0)
    # Free cells are looked through and do not count: a free disc of 4 m leaves the ring.
    r, c = np.indices(cells.shape) - 100
    cells[np.hypot(r, c) < 40] = 0
    assert np.isclose(
        visible_unknown_area(cells, middle, 0.1, 8.0, 120)[0], math.pi * (64.0 - 16.0), rtol=0.02
    )


def test_a_wall_hides_what_is_behind() -> None:
    cells = np.full((201, 201), -1, np.int8)
    cells[:, 110] = 100
    cells[100, 100] = 0
    area = visible_unknown_area(cells, np.array([[100, 100]], np.int32), 0.1, 8.0, 720)[0]
    # The wall's face lies at 0.95 m: the disc less the segment beyond it.
    d, radius = 0.95, 8.0
    segment = radius**2 * math.acos(d / radius) - d * math.sqrt(radius**2 - d**2)
    assert math.isclose(area, math.pi * radius**2 - segment, rel_tol=0.01)


def slow_area(cells: NDArray[np.int8], row: int, col: int, reach: float, rays: int) -> float:
    """In square cells, by steps of a fiftieth of a cell."""
    total, step = 0.0, 0.02
    for k in range(rays):
        angle = (k + 0.5) * 2 * math.pi / rays
        for r in np.arange(step / 2, reach, step):
            cell = math.floor(row + 0.5 + r * math.sin(angle)), math.floor(col + 0.5 + r * math.cos(angle))
            if not (0 <= cell[0] < cells.shape[0] and 0 <= cell[1] < cells.shape[1]) or cells[cell] == 100:
                break
            if cells[cell] == -1:
                total += 2 * r * step * math.pi / rays
    return total


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.5, 15.0), st.sampled_from([7, 24]))
def test_area_is_that_of_small_steps(seed: int, reach: float, rays: int) -> None:
    cells = random_cells(seed, (20, 24))
    points = np.random.default_rng(seed).integers(0, 20, (3, 2)).astype(np.int32)
    areas = visible_unknown_area(cells, points, 0.1, reach * 0.1, rays)
    for area, (row, col) in zip(areas, points, strict=True):
        assert math.isclose(area / 0.01, slow_area(cells, row, col, reach, rays), rel_tol=0.03, abs_tol=0.5)


def test_bad_input_is_refused() -> None:
    cells = np.zeros((4, 5), np.int8)
    with pytest.raises(MapError, match="int8"):
        find_frontiers(cells.astype(np.int32))  # type: ignore[arg-type]
    with pytest.raises(MapError, match=r"shape \(3, 3\)"):
        FrontierDetector((3, 3)).update(cells, (0, 4, 0, 5))
    for wrong in (np.array([[4, 0]]), np.array([[0, -1]])):
        with pytest.raises(ConfigError, match="outside"):
            visible_unknown_area(cells, wrong.astype(np.int32), 0.1, 1.0)
    for range_max, rays in ((0.0, 10), (math.nan, 10), (1.0, 0)):
        with pytest.raises(ConfigError, match="above 0"):
            visible_unknown_area(cells, np.zeros((1, 2), np.int32), 0.1, range_max, rays)
    assert visible_unknown_area(cells, np.empty((0, 2), np.int32), 0.1, 1.0).shape == (0,)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.3, 0.8, 3.0]), st.sampled_from([1, 7, 120]))
def test_areas_that_are_kept_are_those_anew(seed: int, reach: float, rays: int) -> None:
    """Small changes here and there, places that come and go, some twice, some at the edge."""
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), p=[0.3, 0.6, 0.1], size=(30, 40))
    view = VisibleUnknownArea(cells.shape, 0.1, reach, rays)
    every = np.stack([rng.integers(30, size=12), rng.integers(40, size=12)], axis=1).astype(np.int32)
    box = (0, 30, 0, 40)
    for _ in range(8):
        places = every[rng.integers(12, size=rng.integers(0, 9))]
        areas = view.areas(cells, places, box)
        np.testing.assert_array_equal(areas, visible_unknown_area(cells, places, 0.1, reach, rays))
        row, col = int(rng.integers(27)), int(rng.integers(37))
        box = (row, row + 3, col, col + 3) if rng.random() < 0.8 else (0, 0, 0, 0)
        cells[box[0] : box[1], box[2] : box[3]] = rng.choice(
            [-1, 0, 100], size=(box[1] - box[0], box[3] - box[2])
        )


@given(seed=st.integers(0, 100_000))
@settings(max_examples=60, deadline=None)
def test_chosen_cells_are_those_of_each_cluster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    given_ones = [rng.integers(0, 50, (int(rng.integers(1, 6)), 2)) for _ in range(int(rng.integers(0, 7)))]
    clusters = FrontierClusters.of(given_ones)
    kept = rng.random(len(clusters.cells)) < rng.choice([0.0, 0.5, 1.0])
    parts = np.split(kept, clusters.offsets[1:-1]) if given_ones else []
    expected = [cluster[part].tolist() for cluster, part in zip(given_ones, parts, strict=True) if part.any()]
    found = clusters.chosen(kept)
    assert [found.cluster(k).tolist() for k in range(len(found))] == expected
    assert found.cells.dtype == np.int32 and found.offsets.dtype == np.int64 and found.offsets[0] == 0


def test_numbers_of_numpy_are_counted_with_all_digits() -> None:
    cells, middle = np.full((81, 81), -1, np.int8), np.array([[40, 40]], np.int32)
    for resolution, reach in (
        (0.1, np.float32(2.3)),
        (np.float32(0.1), 2.3),
        (np.float32(0.1), np.float32(2.3)),
    ):
        plain = visible_unknown_area(cells, middle, float(resolution), float(reach))
        assert visible_unknown_area(cells, middle, resolution, reach)[0] == plain[0]
