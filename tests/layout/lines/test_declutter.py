"""ROSE: directions, structure score, cell scores and the threshold between two groups."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import find_peaks

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.lines.declutter import (
    DeclutterConfig,
    bounding_box,
    circular_peaks,
    dominant_directions,
    find_structure,
    mixture_threshold,
    wall_surface,
)

CONFIG = DeclutterConfig()


def rooms(angle=0.0, size=400):
    """Walls of six rooms, turned by an angle in degrees."""
    image = np.zeros((size, size), np.uint8)
    turn = cv2.getRotationMatrix2D((size / 2, size / 2), -angle, 1.0)
    for a, b in [((80, 120), (320, 120)), ((80, 200), (320, 200)), ((80, 280), (320, 280))] + [
        ((x, 120), (x, 280)) for x in (80, 160, 240, 320)
    ]:
        ends = cv2.transform(np.array([[a, b]], np.float32), turn)[0]
        cv2.line(image, *[tuple(int(v) for v in np.rint(p)) for p in ends], 1, 2)
    return image > 0


@pytest.mark.parametrize("angle", [0, 7, 30, 45, 83])
def test_directions_turn_with_the_map(angle):
    found = np.degrees(find_structure(rooms(angle), 0.05, CONFIG).directions)
    for expected in (angle % 180, (angle + 90) % 180):
        assert np.abs(np.mod(found - expected + 90, 180) - 90).min() < 1.0
    assert len(found) == 2


def test_structured_maps_score_low_and_noise_scores_high():
    assert find_structure(rooms(20), 0.05, CONFIG).score < 0.2
    noise = np.random.default_rng(0).random((300, 300)) < 0.1
    assert find_structure(noise, 0.05, CONFIG).score > 0.4


def test_scores_are_the_ridges_of_the_whole_square() -> None:
    """By numpy's transforms of the padded square: every row is transformed, those of the padding too."""
    cells = rooms()[100:300, 60:340]
    crop = cells[bounding_box(cells)]
    side = 244  # 243 columns, 163 rows: the next even length that is fast to transform
    spectrum = np.fft.fft2(np.pad(crop.astype(float), [(0, side - n) for n in crop.shape]))
    u, v = np.meshgrid(*2 * [np.fft.fftfreq(side, 1 / side)])
    half = max(side * 0.05 / CONFIG.wall_length, 2.0) / 2
    found = find_structure(cells, 0.05, CONFIG)
    near = [np.abs(u * np.cos(t) + v * np.sin(t)) <= half for t in found.directions]
    kept = spectrum * np.any(near, axis=0) * (np.abs(v) < side / 2)
    values = np.abs(np.fft.ifft2(kept).real)[: crop.shape[0], : crop.shape[1]]
    expected = values * crop / (values * crop).max()
    assert np.abs(found.cell_scores[bounding_box(cells)] - expected).max() < 2e-3


def test_where_the_building_lies_does_not_matter():
    here = find_structure(rooms(10), 0.05, CONFIG)
    moved = find_structure(np.pad(rooms(10), ((37, 0), (0, 61))), 0.05, CONFIG)
    assert np.array_equal(here.directions, moved.directions)
    assert np.array_equal(here.cell_scores, moved.cell_scores[37:, :-61])


def test_walls_score_higher_than_clutter():
    walls = rooms()
    clutter = np.zeros_like(walls)
    for row, col in np.random.default_rng(1).integers(100, 300, (60, 2)):
        clutter[row : row + 3, col : col + 3] = True
    clutter &= ~walls
    structure = find_structure(walls | clutter, 0.05, CONFIG)
    assert np.median(structure.cell_scores[walls]) > 3 * np.median(structure.cell_scores[clutter])
    assert (structure.cell_scores[~(walls | clutter)] == 0).all()
    assert structure.cell_scores.max() == 1.0


@pytest.mark.parametrize("mask", [np.zeros((30, 30), bool), np.ones((1, 1), bool), np.eye(3, dtype=bool)])
def test_degenerate_maps_have_an_answer(mask):
    structure = find_structure(mask, 0.05, CONFIG)
    assert structure.cell_scores.shape == mask.shape
    assert np.isfinite(structure.score)


def test_flat_profiles_have_no_direction():
    directions, score = dominant_directions(np.ones(720), CONFIG)
    assert len(directions) == 0
    assert score == 1.0


def test_a_peak_across_the_end_of_the_profile_is_one_direction():
    angles = np.arange(720) * 180 / 720
    profile = np.exp(-(((np.mod(angles - 179.9 + 90, 180) - 90) / 2) ** 2))
    directions, _ = dominant_directions(profile, CONFIG)
    assert np.degrees(directions) == pytest.approx([179.9], abs=0.05)


def test_mixture_threshold_lies_between_two_groups():
    rng = np.random.default_rng(0)
    scores = np.clip(np.concatenate((rng.normal(0.15, 0.04, 3000), rng.normal(0.6, 0.1, 2000))), 0, 1).astype(
        np.float32
    )
    assert 0.25 < mixture_threshold(scores) < 0.4
    assert mixture_threshold(np.zeros(0, np.float32)) == 0.0
    assert mixture_threshold(np.full(50, 0.5, np.float32)) == 0.0


def test_solid_masses_keep_their_surface():
    cells = np.full((60, 60), 100, np.int8)
    cells[20:40, 20:40] = 0
    surface = wall_surface(OccupancyGrid(cells, 0.1), 0.3)
    assert surface[17:20, 17:43].all()
    assert not surface[:16].any()


def test_bounding_box():
    mask = np.zeros((5, 6), bool)
    assert bounding_box(mask) is None
    mask[1, 2] = mask[3, 4] = True
    assert bounding_box(mask) == (slice(1, 4), slice(2, 5))


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("prominence", 0),
        ("angle_step", 9),
        ("wavelength_min", 30),
        ("wall_length", 0),
        ("max_directions", 0),
        ("floor", 1),
    ],
)
def test_nonsense_options_are_refused(option, value):
    with pytest.raises(ConfigError):
        DeclutterConfig(**{option: value})


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 5), min_size=2, max_size=24), st.sampled_from([0.1, 0.3, 0.5]))
def test_peaks_of_a_circular_profile(values: list[int], least: float) -> None:
    profile = np.array(values) / 5
    n = len(values)
    slow, found = find_peaks(np.tile(profile, 3), prominence=least)
    middle = (slow >= n) & (slow < 2 * n)
    peaks, prominences = circular_peaks(profile, least)
    assert peaks.tolist() == (slow[middle] - n).tolist()
    assert prominences.tolist() == found["prominences"][middle].tolist()
