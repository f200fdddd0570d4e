"""ROSE: dominant directions, structure score and decluttering in the frequency domain.

Follows "Robust frequency-based structure extraction" (ICRA 2021), section III. Walls along a direction make a
ridge through the centre of the amplitude spectrum of the occupied cells; the ridges' directions are the
dominant directions, and the inverse transform of the spectrum inside the ridges scores how well each occupied
cell agrees with the structure.

Occupied cells are cropped to their bounding box and padded with zeros to a square, so that the answer depends
neither on where the building lies in the grid nor on how much unknown space surrounds it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Mask
from layoutexplore.grids.boxes import true_box
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.layout.frame import undirected
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.options import COUNT, POSITIVE, Rule, check, check_fields

WHOLE_SIDE = 2048
"""A box that fits into a square of this side is transformed in one piece ..."""

MOST_PADDING = 64
"""... and so is one whose square has at most so many times its cells."""

PART_SIDE, PART_SHARE = 256, 8
"""Others are cut into parts of this length, or of so many times the shorter side."""


@dataclass(frozen=True, kw_only=True)
class DeclutterConfig:
    """How ROSE finds directions and scores cells.

    Attributes:
        prominence: Least prominence of a direction's peak, as a share of the profile's range (ROSE: 0.5,
            ROSE2's code: 0.2).
        angle_step: Sampling of the profile, in degrees.
        wavelength_min: Shortest wavelength that counts for the directions, in metres: below it lies the
            raster's staircase.
        wavelength_max: Longest wavelength that counts for the directions, in metres: above it lies the
            building's outline.
        floor: Amplitudes below this share of the largest (the number of occupied cells) do not count for the
            directions; the authors' code drops those below 1 / 255 by rounding.
        wall_length: Length over which a wall's cells support each other, in metres: the inverse of the width
            of the ridges that are kept (the authors keep 5 frequencies of some 1000 cells of 0.05 m: 10 m).
        max_directions: At most this many directions, the strongest.
    """

    prominence: float = 0.2
    angle_step: float = 0.25
    wavelength_min: float = 0.2
    wavelength_max: float = 20.0
    floor: float = 0.01
    wall_length: float = 10.0
    max_directions: int = 12

    def __post_init__(self) -> None:
        check_fields(self)
        check(self, prominence=Rule(above=0.0, below=1.0), floor=Rule(low=0.0, below=1.0))
        check(self, angle_step=Rule(low=0.01, high=5.0), wall_length=POSITIVE, max_directions=COUNT)
        if not 0 < self.wavelength_min < self.wavelength_max:
            raise ConfigError("wavelength_min must be above 0 and below wavelength_max")


@dataclass(frozen=True, kw_only=True, eq=False)
class Directions:
    """The directions of a map's walls.

    Attributes:
        directions: float64 (k,), dominant directions of walls in the grid's frame, radians in [0, pi),
            rising.
        score: W (equation 2): near 0 is structured, near 1 is not; 1.0 where there is no direction.
        profile: float64 (n,), cumulative amplitude for wall directions 0 <= angle < pi at equal steps.
    """

    directions: Floats
    score: float
    profile: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Structure(Directions):
    """What ROSE knows of a map.

    Attributes:
        cell_scores: float32 (rows, cols), score of the occupied cells over the largest one; 0 elsewhere.
    """

    cell_scores: Floats32


def find_directions(occupied: Mask, resolution: float, config: DeclutterConfig) -> Directions:
    """What `find_structure` finds, without the cells' scores.

    Args:
        occupied: bool (rows, cols).
        resolution: Metres a cell.
        config: The options.
    """
    profile = np.zeros(_steps(config))
    for crop, side in _squares(occupied):
        spectrum = _spectrum(crop, side, _reach(side, resolution, config) + 1)
        profile += _angle_profile(spectrum, side, resolution, config)
    directions, score = dominant_directions(profile, config)
    return Directions(directions=directions, score=score, profile=profile)


def find_structure(occupied: Mask, resolution: float, config: DeclutterConfig) -> Structure:
    """Directions, structure score and cell scores of a map's occupied cells.

    Args:
        occupied: bool (rows, cols).
        resolution: Metres a cell.
        config: The options.
    """
    scores, profile = np.zeros(occupied.shape, np.float32), np.zeros(_steps(config))
    spectrum = None
    squares = [*_squares(occupied)]
    for crop, side in squares:
        spectrum = _spectrum(crop, side, side // 2 + 1)
        profile += _angle_profile(spectrum, side, resolution, config)
    directions, score = dominant_directions(profile, config)
    if len(directions):
        box = bounding_box(occupied)
        parts = []
        for crop, side in squares:
            if len(squares) > 1 or spectrum is None:
                spectrum = _spectrum(crop, side, side // 2 + 1)
            width = max(side * resolution / config.wall_length, 2.0)
            ridges = _ridges_only(spectrum, side, directions, width)
            parts.append(np.abs(_inverse(ridges, side, crop.shape)) * crop)
        values = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=_long_axis(occupied[box]))
        scores[box] = values / max(float(values.max()), 1e-9)
    return Structure(directions=directions, score=score, cell_scores=scores, profile=profile)


def _long_axis(crop: Mask) -> int:
    return int(crop.shape[1] > crop.shape[0])


def _squares(occupied: Mask) -> Iterator[tuple[Mask, int]]:
    """The box of the occupied cells, and the side of the square that it is padded to.

    The square of a long and narrow box would be mostly padding: such a box is cut along its longer side into
    parts that have squares of their own, whose profiles add up.
    """
    box = bounding_box(occupied)
    if box is None:
        return
    crop = occupied[box]
    side = _fast_side(crop)
    if side <= WHOLE_SIDE or side * side <= MOST_PADDING * crop.size:
        yield crop, side
        return
    along = _long_axis(crop)
    count = -(-crop.shape[along] // max(PART_SHARE * min(crop.shape), PART_SIDE))
    parts = np.array_split(crop, count, axis=along)
    side = _fast_side(parts[0])
    for part in parts:
        yield part, side


def _steps(config: DeclutterConfig) -> int:
    return round(180 / config.angle_step)


def _fast_side(crop: Mask) -> int:
    """Side of the square that occupied cells are padded to: even, and fast to transform."""
    side = int(scipy.fft.next_fast_len(max(*crop.shape, 8), real=True))
    return side + side % 2


def _radii(side: int, resolution: float, config: DeclutterConfig) -> tuple[float, float]:
    """Lowest and highest frequency that count for the directions."""
    extent = side * resolution
    highest = min(extent / config.wavelength_min, side / 2 - 1)
    return min(max(extent / config.wavelength_max, 1.0), highest), highest


def _reach(side: int, resolution: float, config: DeclutterConfig) -> int:
    """No frequency above this is looked at for the directions."""
    return min(math.ceil(_radii(side, resolution, config)[1]) + 2, side // 2)


def wall_surface(grid: OccupancyGrid, depth: float) -> Mask:
    """Occupied cells within `depth` metres of free space, bool (rows, cols): of solid masses, the surface.

    Args:
        grid: The grid.
        depth: In metres; at least the cells next to free space count.
    """
    occupied = grid.cells == OCCUPIED
    free = (grid.cells == FREE).view(np.uint8)
    reach = cells_at_most(depth, grid.resolution, max(grid.shape))
    near = cv2.dilate(free, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    return np.asarray(occupied & near.view(np.bool_))


def bounding_box(mask: Mask) -> tuple[slice, slice] | None:
    """The smallest box (rows, cols) that holds every true cell; None when there is none."""
    row0, row1, col0, col1 = true_box(mask)
    return (slice(row0, row1), slice(col0, col1)) if row1 else None


def dominant_directions(profile: Floats, config: DeclutterConfig) -> tuple[Floats, float]:
    """Peaks of the circular profile and the structure score W (equations 1 and 2).

    Returns:
        Directions in radians in [0, pi), rising, and W; no direction and 1.0 for a flat profile.
    """
    low, high = float(profile.min()), float(profile.max())
    if not high > low:
        return np.zeros(0), 1.0
    scaled = (profile - low) / (high - low)
    n = len(scaled)
    peaks, prominences = circular_peaks(np.ascontiguousarray(scaled), config.prominence)
    if not len(peaks):
        return np.zeros(0), 1.0
    strongest = np.sort(np.argsort(-prominences, kind="stable")[: config.max_directions])
    peaks = peaks[strongest]
    left, top, right = scaled[peaks - 1], scaled[peaks], scaled[(peaks + 1) % n]
    shift = 0.5 * (left - right) / np.minimum(left - 2 * top + right, -1e-12)
    angles = undirected((peaks + np.clip(shift, -0.5, 0.5)) * np.pi / n)
    return np.sort(angles), float(scaled.mean() / top.mean())


@njit(cache=True, nogil=True)
def circular_peaks(profile: Floats, least: float) -> tuple[Ints, Floats]:
    """Peaks of a circular profile, rising, with prominences of `least` or more; of a flat top, its middle.

    A peak's prominence is its height above the higher of the two lowest points on the ways, left and right,
    to a higher value.
    """
    n = len(profile)
    peaks, prominences = np.empty(n, np.int64), np.empty(n)
    count = 0
    for first in range(n):
        top = profile[first]
        if profile[first - 1] >= top:  # index -1 is the last one
            continue
        width = 1
        while width < n and profile[(first + width) % n] == top:
            width += 1
        if width == n or profile[(first + width) % n] > top:
            continue
        lowest = np.array((top, top))
        for side in range(2):
            for step in range(1, n):
                value = profile[(first - step if side == 0 else first + step) % n]
                if value > top:
                    break
                lowest[side] = min(lowest[side], value)
        prominence = top - lowest.max()
        if prominence >= least:
            peaks[count], prominences[count] = (first + (width - 1) // 2) % n, prominence
            count += 1
    order = np.argsort(peaks[:count])
    return peaks[:count][order], prominences[:count][order]


@lru_cache(maxsize=8)
def _polar_maps(
    side: int, steps: int, radius_min: float, radius_max: float, reach: int
) -> tuple[Floats32, Floats32]:
    """Sampling positions (cols, rows) float32 (steps, radii) among the frequencies, by wall direction."""
    normal = np.arange(steps) * np.pi / steps + np.pi / 2
    radii = np.arange(radius_min, radius_max + 1e-9)
    u, v = np.cos(normal)[:, None] * radii, np.sin(normal)[:, None] * radii
    flip = np.where(u < 0, -1.0, 1.0)
    return (u * flip).astype(np.float32), (v * flip + side // 2).astype(np.float32) - np.float32(
        side // 2 - reach
    )


def _angle_profile(
    spectrum: NDArray[np.complex64], side: int, resolution: float, config: DeclutterConfig
) -> Floats:
    """Cumulative amplitude by wall direction: the spectrum unfolded about its centre, summed over the radius.

    Args:
        spectrum: complex64 (side, at least reach + 1), the half spectrum.
        side: Of the transformed square.
        resolution: Metres a cell.
        config: The options.
    """
    reach = _reach(side, resolution, config)
    amplitude = np.empty((2 * reach, reach + 1), np.float32)
    np.abs(spectrum[-reach:, : reach + 1], out=amplitude[:reach])
    np.abs(spectrum[:reach, : reach + 1], out=amplitude[reach:])
    if config.floor:
        amplitude *= amplitude >= config.floor * float(spectrum[0, 0].real)
    cols, rows = _polar_maps(side, _steps(config), *_radii(side, resolution, config), reach)
    polar = cv2.remap(amplitude, cols, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(polar.sum(axis=1, dtype=np.float64))


def _spectrum(crop: Mask, side: int, frequencies: int) -> NDArray[np.complex64]:
    """The first columns complex64 (side, frequencies) of the half spectrum of cells padded to a square.

    Rows of the padding are not transformed: their spectrum is zero. Nor are rows that are like the one before
    them, as most are that cross upright walls alone.
    """
    bits = np.packbits(crop, axis=1)
    fresh = np.concatenate(([True], (bits[1:] != bits[:-1]).any(axis=1)))
    rows = np.asarray(scipy.fft.rfft(crop[fresh].astype(np.float32), n=side, axis=1), np.complex64)
    columns = np.zeros((side, frequencies), np.complex64)
    columns[: len(crop)] = rows[np.cumsum(fresh) - 1, :frequencies]
    return np.asarray(scipy.fft.fft(columns, axis=0, overwrite_x=True), np.complex64)


def _inverse(spectrum: NDArray[np.complex64], side: int, shape: tuple[int, int]) -> Floats32:
    """The first cells float32 `shape` of a square from its half spectrum complex64 (side, side // 2 + 1)."""
    rows, cols = shape
    columns = scipy.fft.ifft(spectrum, axis=0, norm="forward", overwrite_x=True)[:rows]
    image = scipy.fft.irfft(columns, n=side, axis=1, norm="forward")[:, :cols]
    return np.asarray(image * np.float32(1 / side**2), np.float32)


def _ridges_only(
    spectrum: NDArray[np.complex64], side: int, directions: Floats, width: float
) -> NDArray[np.complex64]:
    """Bands of `width` frequencies through the centre of a spectrum, normal to each wall direction."""
    kept = np.zeros_like(spectrum)
    half = width / 2
    signed = scipy.fft.fftfreq(side, 1 / side)
    us = np.arange(spectrum.shape[1], dtype=np.float64)
    for angle in directions:
        # A wall along `angle` has its ridge along the normal: |u cos + v sin| <= half holds along the ridge.
        c, s = float(np.cos(angle)), float(np.sin(angle))
        if abs(s) >= abs(c):
            rows, cols = _band(-us * c / s, half / abs(s), side), us
            index_v, index_u = rows, np.broadcast_to(cols[:, None], rows.shape)
        else:
            cols2 = _band(-signed * s / c, half / abs(c), side)
            index_u, index_v = cols2, np.broadcast_to(signed[:, None], cols2.shape)
        inside = (index_u >= 0) & (index_u < spectrum.shape[1]) & (np.abs(index_v) < side / 2)
        inside &= np.abs(index_u * c + index_v * s) <= half
        at = np.mod(index_v[inside].astype(np.int64), side), index_u[inside].astype(np.int64)
        kept[at] = spectrum[at]
    return kept


def _band(centre: Floats, half: float, side: int) -> Floats:
    """Whole numbers (n, m) around each centre that cover centre +- half."""
    reach = min(int(np.ceil(half)) + 1, side)
    return np.asarray(np.rint(centre)[:, None] + np.arange(-reach, reach + 1))


def mixture_threshold(scores: Floats32) -> float:
    """The score at which two Gaussians fitted to the scores cross (ROSE, section III-C).

    Expectation maximisation on the histogram, started from the two halves split at the mean; the crossing
    between the two means where the weighted densities are equal.

    Args:
        scores: Scores in 0..1 of the occupied cells, any shape.

    Returns:
        The threshold in 0..1; 0.0 (keep everything) when the scores do not fall into two groups.
    """
    counts, edges = np.histogram(scores, bins=256, range=(0.0, 1.0))
    if np.count_nonzero(counts) < 2:
        return 0.0
    x = (edges[:-1] + edges[1:]) / 2
    total = counts.sum()
    split = float((counts * x).sum() / total)
    high = (x > split).astype(np.float64)
    for _ in range(200):
        previous = high
        densities, means = _maximise(counts, x, high, 1 / len(counts))
        high = densities[1] / np.maximum(densities.sum(axis=0), 1e-300)
        if np.abs(high - previous).max() < 1e-6:
            break
    between = np.flatnonzero((x >= means[0]) & (x <= means[1]) & (densities[1] >= densities[0]))
    return float(x[between[0]]) if len(between) else 0.0


def _maximise(counts: Ints, x: Floats, high: Floats, floor: float) -> tuple[Floats, Floats]:
    """Weighted densities (2, bins) and means (2,) of two Gaussians, by each bin's share in the high one."""
    weights = counts * np.stack((1 - high, high))
    mass = np.maximum(weights.sum(axis=1), 1e-9)
    means = (weights * x).sum(axis=1) / mass
    spread = np.sqrt((weights * (x - means[:, None]) ** 2).sum(axis=1) / mass + floor**2)
    densities = (mass / spread)[:, None] * np.exp(-0.5 * ((x - means[:, None]) / spread[:, None]) ** 2)
    return densities, means
