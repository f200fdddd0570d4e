"""Distortions: forward and back, local stretching of the size asked for, walls at round numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from layoutexplore.grids.grid import Pose
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.priors.distortion import Distortion, draw_distorted, random_waves, scale_matrix, snap_pairs
from tests.priors.cases import office


@pytest.mark.parametrize("seed", range(4))
def test_points_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    distortion = Distortion(
        snaps=snap_pairs(office().rasterize(0.1), 0.5),
        waves=random_waves(0.05, rng),
        matrix=scale_matrix((1.1, 0.9), bool(seed % 2), rng.uniform(0, 6)),
        shift=rng.uniform(-9, 9, 2),
    )
    points = rng.uniform(0, 30, (200, 2))
    assert np.abs(distortion.backward(distortion.forward(points)) - points).max() < 0.02


def test_waves_stretch_as_much_as_asked() -> None:
    found = []
    for seed in range(20):
        waves = random_waves(0.03, np.random.default_rng(seed))
        points = np.random.default_rng(seed + 100).uniform(0, 100, (400, 2))
        for axis in (0, 1):
            ahead = points + np.eye(2)[axis] * 0.01
            found.append((waves.at(ahead) - waves.at(points))[:, axis] / 0.01)
    assert 0.02 < math.sqrt(np.mean(np.square(found))) < 0.035
    assert not random_waves(0.0, np.random.default_rng(0)).at(np.ones((3, 2))).any()


def test_a_mirrored_drawing_turns_the_other_way() -> None:
    assert np.linalg.det(scale_matrix((2.0, 3.0), False, 1.0)) == pytest.approx(6.0)
    assert np.linalg.det(scale_matrix((2.0, 3.0), True, 1.0)) == pytest.approx(-6.0)


def test_snapped_walls_lie_at_multiples() -> None:
    for true, drawn in snap_pairs(office().rasterize(0.1), 0.5):
        assert len(true) > 3
        assert np.allclose(drawn / 0.5, np.round(drawn / 0.5))
        assert (np.diff(drawn) > 0).all() and (np.abs(drawn - true) <= 0.25 + 1e-9).all()


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_the_drawing_shows_floor_where_the_distortion_says(step: float) -> None:
    raster = office().rasterize(0.1)
    distortion = Distortion(
        snaps=snap_pairs(raster, step),
        waves=random_waves(0.03, np.random.default_rng(1)),
        matrix=scale_matrix((1.2, 1.1), True, math.radians(97.0)),
    )
    free, ids, placed = draw_distorted(raster.free, raster.room_ids, raster, distortion, 0.1)
    for room in office().rooms:
        x, y = placed.forward(np.array(room.polygon.centroid.coords))[0]
        assert free[int(y / 0.1), int(x / 0.1)] and ids[int(y / 0.1), int(x / 0.1)] == room.id
    assert not ids[~free].any()


def test_the_drawing_does_not_depend_on_where_the_building_lies() -> None:
    near = office().rasterize(0.1)
    far = PlanRaster(near.occupied, near.room_ids, 0.1, Pose(near.origin.x + 4.56e5, near.origin.y + 5.654e6))
    distortion = Distortion(matrix=scale_matrix((1.2, 1.1), False, math.radians(30.0)))
    here, there = (draw_distorted(r.free, r.room_ids, r, distortion, 0.1)[1] for r in (near, far))
    assert here.shape == there.shape and (here != there).mean() < 1e-3
