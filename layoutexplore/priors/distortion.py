"""How a drawing differs from the building in its geometry: snapped, stretched, scaled, mirrored, turned.

A `Distortion` maps true points (metres) to points of the drawing, and back. Its parts act in this order:
walls move to round numbers, a smooth field stretches locally, then scale, aspect, mirror and rotation.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from layoutexplore.grids.arrays import Floats, Floats32, Ints32, Labels, Mask
from layoutexplore.maps.raster import PlanRaster

WAVES = 4
"""Plane waves of a smooth field, along either axis."""

WAVE_LENGTHS = (15.0, 60.0)
"""Metres of their lengths, least and greatest."""

FIELD_STEP = 6
"""A field without snapped walls is worked out at every n-th cell and interpolated in between."""

MARGIN = 1.0
"""Metres of paper around a drawing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Waves:
    """A smooth field of displacements: a sum of plane waves.

    Attributes:
        vectors: float64 (n, 2), radians a metre.
        phases: float64 (n,), radians.
        shifts: float64 (n, 2), metres.
    """

    vectors: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    phases: Floats = field(default_factory=lambda: np.zeros(0))
    shifts: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def at(self, points: Floats) -> Floats:
        """Displacements float64 (n, 2) in metres at points (n, 2)."""
        return np.asarray(np.sin(points @ self.vectors.T + self.phases) @ self.shifts)


def random_waves(stretch: float, rng: np.random.Generator) -> Waves:
    """Waves whose local stretching has a root mean square of `stretch` along either axis."""
    if stretch == 0:
        return Waves()
    count = 2 * WAVES
    lengths = np.exp(rng.uniform(math.log(WAVE_LENGTHS[0]), math.log(WAVE_LENGTHS[1]), count))
    angles = rng.uniform(0, 2 * math.pi, count)
    numbers = 2 * math.pi / lengths
    vectors = numbers[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    axis = np.repeat(np.eye(2), WAVES, axis=0)
    # The stretching along its own axis of a shift a sin(k.p) is a k_x cos(k.p): its mean square a2 k_x2 / 2.
    own = np.abs((vectors * axis).sum(axis=1))
    size = stretch * math.sqrt(2 / WAVES) / np.maximum(own, 0.35 * numbers)
    return Waves(vectors=vectors, phases=rng.uniform(0, 2 * math.pi, count), shifts=axis * size[:, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class Distortion:
    """From true points to those of a drawing.

    Attributes:
        snaps: Per axis (x, y) true coordinates and where they are drawn, float64 (2, k) rising; k may be 0.
        waves: Local stretching.
        matrix: float64 (2, 2), scale, aspect, mirror and rotation.
        shift: float64 (2,), metres, added last.
    """

    snaps: tuple[Floats, Floats] = field(default_factory=lambda: (np.zeros((2, 0)), np.zeros((2, 0))))
    waves: Waves = field(default_factory=Waves)
    matrix: Floats = field(default_factory=lambda: np.eye(2))
    shift: Floats = field(default_factory=lambda: np.zeros(2))

    def forward(self, points: Floats) -> Floats:
        """Points of the drawing float64 (n, 2) for true ones (n, 2), in metres."""
        snapped = np.stack([_snapped(points[:, k], self.snaps[k]) for k in (0, 1)], axis=1)
        return np.asarray((snapped + self.waves.at(snapped)) @ self.matrix.T + self.shift)

    def backward(self, points: Floats) -> Floats:
        """True points float64 (n, 2) of those of the drawing (n, 2), in metres."""
        linear = (points - self.shift) @ np.linalg.inv(self.matrix).T
        found = linear.copy()
        for _ in range(6 if len(self.waves.phases) else 0):  # the field is far from folding: this converges
            found = linear - self.waves.at(found)
        return np.stack([_snapped(found[:, k], self.snaps[k][::-1]) for k in (0, 1)], axis=1)


def _snapped(values: Floats, pairs: Floats) -> Floats:
    """Values moved as the nearest pairs are, in between in proportion, outside as the last one."""
    if pairs.shape[1] == 0:
        return values
    return np.asarray(values + np.interp(values, pairs[0], pairs[1] - pairs[0]))


def snap_pairs(raster: PlanRaster, step: float) -> tuple[Floats, Floats]:
    """Where long walls along rows and columns lie, and those places rounded to multiples of `step` metres."""
    if step == 0:
        return np.zeros((2, 0)), np.zeros((2, 0))
    solid, (x0, y0, _) = raster.occupied, raster.origin
    pairs = []
    for axis, start in ((0, x0), (1, y0)):
        edges = np.count_nonzero(np.diff(solid.astype(np.int8), axis=1 - axis), axis=axis)
        places = start + raster.resolution * (1 + np.flatnonzero(edges * raster.resolution >= 2.0))
        rounded = np.round(places / step) * step
        # Walls must neither swap nor vanish: what would come nearer than a tenth of a metre stays out.
        keep = np.concatenate([[True], np.diff(rounded) >= 0.1]) & (
            np.concatenate([[True], np.diff(places) >= 0.1])
        )
        pairs.append(np.stack([places[keep], rounded[keep]]) if len(places) else np.zeros((2, 0)))
    return pairs[0], pairs[1]


def scale_matrix(factors: tuple[float, float], mirrored: bool, turn: float) -> Floats:
    """float64 (2, 2): lengths times factors along x and y, then mirrored in the y axis, then turned.

    Args:
        factors: Along x and y.
        mirrored: Whether left and right are exchanged.
        turn: Radians counter-clockwise.
    """
    c, s = math.cos(turn), math.sin(turn)
    scale = np.diag([factors[0] * (-1.0 if mirrored else 1.0), factors[1]])
    return np.array([[c, -s], [s, c]]) @ scale


def draw_distorted(
    free: Mask, room_ids: Labels, frame: PlanRaster, distortion: Distortion, resolution: float
) -> tuple[Mask, Ints32, Distortion]:
    """A raster as it looks in the drawing.

    Args:
        free: bool (rows, cols), floor.
        room_ids: int16 or int32 (rows, cols).
        frame: Whose cells they are.
        distortion: Its shift is chosen here: the drawing begins at (0, 0).
        resolution: Metres of the drawing a cell.

    Returns:
        Floor bool (h, w), rooms int32 (h, w), and the distortion with its shift.
    """
    rows, cols = np.nonzero(free if free.any() else frame.free)  # of nothing, a sheet of the floor's size
    x = frame.origin.x + (cols + 0.5) * frame.resolution
    y = frame.origin.y + (rows + 0.5) * frame.resolution
    drawn = distortion.forward(np.stack([x, y], axis=1))
    low, high = drawn.min(axis=0) - MARGIN, drawn.max(axis=0) + MARGIN
    placed = dataclasses.replace(distortion, shift=distortion.shift - low)
    width, height = np.ceil((high - low) / resolution).astype(int).tolist()
    corner = np.array([frame.origin.x, frame.origin.y])
    true = _true_points(placed, (height, width), resolution, corner)
    col, row = (along / np.float32(frame.resolution) - np.float32(0.5) for along in true)
    floor = cv2.remap(free.astype(np.uint8), col, row, cv2.INTER_NEAREST, borderValue=0) > 0
    ids = cv2.remap(room_ids.astype(np.float32), col, row, cv2.INTER_NEAREST, borderValue=0)
    return floor, np.where(floor, ids.astype(np.int32), 0).astype(np.int32), placed


def _true_points(
    distortion: Distortion, shape: tuple[int, int], resolution: float, corner: Floats
) -> tuple[Floats32, Floats32]:
    """True x and y float32 (h, w) in metres from a corner of the centres of a drawing's cells."""
    step = 1 if distortion.snaps[0].size or distortion.snaps[1].size else FIELD_STEP
    # On a lattice two nodes wider than the drawing, so that every cell lies between nodes.
    rows, cols = (-(-n // step) + 2 for n in shape)
    at_y, at_x = np.mgrid[0:rows, 0:cols] * step
    points = (np.stack([at_x.ravel(), at_y.ravel()], axis=1) + 0.5) * resolution
    places = (distortion.backward(points) - corner).astype(np.float32).reshape(rows, cols, 2)
    if step > 1:
        # Node (i, j) stands for cell (i step, j step). OpenCV would warp in steps of 1/32,
        # and walls of one cell would have holes.
        places = _between(_between(places, step).swapaxes(0, 1), step).swapaxes(0, 1)
    return places[: shape[0], : shape[1], 0], places[: shape[0], : shape[1], 1]


def _between(nodes: Floats32, step: int) -> Floats32:
    """Nodes float32 (n, ...) with `step - 1` linear ones after each but the last: ((n - 1) step, ...)."""
    share = (np.arange(step, dtype=np.float32) / np.float32(step)).reshape(1, step, 1, 1)
    fine = nodes[:-1, None] + share * np.diff(nodes, axis=0)[:, None]
    return np.asarray(fine.reshape(-1, *nodes.shape[1:]), np.float32)
