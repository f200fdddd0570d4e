"""From a grey image to an occupancy grid, with the unknown level found in the image itself.

Maps on disk agree on little: free is almost white, but the unknown is 153, 178, 180, 205, 230 ... from map to
map, walls may be grey, furniture is a mid-grey that lies a few steps from the unknown, edges are antialiased,
and some maps have two levels only. So the unknown is recognised by where it is, not by its value:

1. Free is brighter than 230 (or, where nothing is, than halfway between the brightest common level and the
   next).
2. Unknown levels are the mid-greys that make up a good part of the image's border; all their pixels are
   unknown. Other flat mid-greys are unknown only where they fill a thick area of many square metres (a
   courtyard), not as walls or furniture.
3. What is left is occupied, except blends between free and unknown on an antialiased edge, and stray mid-grey
   pixels that touch no free space.
4. Where that leaves next to nothing occupied along the free space, or no unknown level exists, the map has
   two levels: solid masses are unknown inside and occupied along the free space.
"""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.components import split_labels
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution, in_cells
from layoutexplore.grids.morphology import dilate_by_disc, with_neighbours

FREE_ABOVE = 230
"""Grey level above which a pixel is free in the maps of the room segmentation survey and of ROS."""

DARK_BELOW = 90
"""Grey level below which a pixel is occupied in ROS maps (occupancy of at least 0.65)."""

BORDER_SHARE = 0.1
COURTYARD_AREA, COURTYARD_RADIUS = 25.0, 0.4
SOLID_RADIUS, SOLID_SKIN = 0.75, 0.15
"""Square metres and metres: what counts as a courtyard, as the inside of a solid mass and as its surface."""

_LARGE_DISC = 16
"""Radius beyond which what a disc covers is found by distances: their time does not grow with it."""

WALL_SHARE = 0.02
"""Share of the free space's outline that is occupied at least, in a map that tells walls from the unknown."""

SAVED_LEVELS, SAVED_SHARE = (0, 205, 254), 0.995
"""Occupied, unknown and free as ROS's `map_saver` writes them, and the share of such pixels at least (a few
are painted over by hand)."""


def is_from_map_saver(grey: Bytes) -> bool:
    """Whether the grey levels, uint8 of any shape, are those that ROS's `map_saver` writes, unknown included.

    Example:
        >>> is_from_map_saver(np.array([0, 205, 254], np.uint8))
        True
        >>> is_from_map_saver(np.arange(256, dtype=np.uint8))
        False
    """
    counts = np.bincount(grey.ravel(), minlength=256)
    # White is how an editor's brush paints free space.
    painted = counts[list(SAVED_LEVELS)].sum() + counts[255]
    return bool(counts[SAVED_LEVELS[1]] and counts[254] and painted >= SAVED_SHARE * grey.size)


@checks_arguments
def grid_from_image(
    grey: Bytes,
    resolution: float,
    *,
    free_threshold: int | None = None,
    transparent: Mask | None = None,
    origin: Pose | None = None,
    unknown_grey: int | Literal["auto", "none"] = "auto",
) -> OccupancyGrid:
    """The trinary grid that an image shows.

    Args:
        grey: uint8 (h, w) in image orientation (row 0 at the top).
        resolution: Metres a pixel.
        free_threshold: Grey level above which a pixel is free; found in the image when None.
        transparent: bool (h, w), pixels that are unknown whatever their grey.
        origin: Pose of the lower left corner; (0, 0, 0) when None.
        unknown_grey: The one level that is unknown; by the module's rule when "auto", no level when "none".

    Raises:
        MapError: Not a two-dimensional uint8 image, or the resolution is unusable.

    Example:
        >>> image = np.full((40, 40), 205, np.uint8)
        >>> image[10:30, 10:30] = 0
        >>> image[11:29, 11:29] = 254
        >>> np.unique(grid_from_image(image, 0.05).cells).tolist()
        [-1, 0, 100]
    """
    check_resolution(resolution)
    if transparent is not None and np.shape(transparent) != grey.shape:
        raise MapError(f"transparent pixels {transparent.shape} are not those of the image {grey.shape}")
    if grey.ndim != 2 or grey.dtype != np.uint8 or grey.size == 0:
        raise MapError(f"a grey image must be a non-empty uint8 array (h, w), got {grey.dtype} {grey.shape}")
    hidden = np.zeros(grey.shape, np.bool_) if transparent is None else transparent
    free = (grey > (_free_threshold(grey) if free_threshold is None else free_threshold)) & ~hidden
    if unknown_grey == "auto":
        unknown = _unknown(grey, free, hidden, resolution)
        if not unknown.any() or not _has_walls(free, ~free & ~unknown):
            unknown = hidden | _inside_of_background(grey, free, resolution)
    else:
        unknown = hidden if unknown_grey == "none" else hidden | (grey == unknown_grey)
        free &= ~unknown
    cells = np.where(free, FREE, np.where(unknown, UNKNOWN, OCCUPIED)).astype(np.int8)
    return OccupancyGrid(np.ascontiguousarray(cells[::-1]), resolution, origin or Pose(0.0, 0.0, 0.0))


def _free_threshold(grey: Bytes) -> int:
    """230, or halfway below the brightest level that covers 1 % of an image without anything brighter."""
    counts = np.bincount(grey.ravel(), minlength=256)
    common = np.flatnonzero(counts >= 0.01 * grey.size)
    if counts[FREE_ABOVE + 1 :].sum() >= 0.001 * grey.size or len(common) < 2:
        return FREE_ABOVE
    return int(common[-1] + common[-2]) // 2


def _unknown(grey: Bytes, free: Mask, hidden: Mask, resolution: float) -> Mask:
    """The unknown pixels, bool (h, w): steps 2 and 3 of the module's rule."""
    levels = _border_levels(grey, free)
    unknown = hidden | (np.isin(grey, levels) & ~free)
    unknown |= _courtyards(grey, free | unknown, resolution)
    if not unknown.any():
        return unknown
    near_free, near_unknown = (with_neighbours(mask) for mask in (free, unknown))
    blend = ~free & ~unknown & near_free & near_unknown & (grey > max(levels, default=FREE_ABOVE))
    unknown |= blend
    rest = ~free & ~unknown
    count, parts = cv2.connectedComponents(rest.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    anchored = np.zeros(count, np.bool_)
    anchored[np.unique(parts[near_free | (grey < DARK_BELOW)])] = True
    return np.asarray(unknown | (rest & ~anchored[parts]), np.bool_)


def _has_walls(free: Mask, occupied: Mask) -> bool:
    """Whether anything but a speck borders the free space."""
    edge = with_neighbours(free) & ~free
    return bool(np.count_nonzero(edge & occupied) >= WALL_SHARE * np.count_nonzero(edge))


def _border_levels(grey: Bytes, free: Mask) -> list[int]:
    """Mid-grey levels of the background, each with its two neighbours.

    Those that hold a tenth of the border; where the border shows none (a map cropped to its walls), the most
    common.
    """
    edge = np.ones(grey.shape, np.bool_)
    edge[1:-1, 1:-1] = False
    border = grey[edge & ~free]
    length = 2 * sum(grey.shape)
    counts = np.bincount(border, minlength=256)
    counts[:DARK_BELOW] = 0
    peaks = np.flatnonzero(counts >= BORDER_SHARE * length)
    if not len(peaks):
        counts = np.bincount(grey[~free], minlength=256)
        if (
            counts[:DARK_BELOW].sum() > 0.05 * grey.size
            and np.bincount(border, minlength=256)[:DARK_BELOW].sum() > length / 2
        ):
            return []  # two levels: a dark background
        counts[:DARK_BELOW] = 0
        peaks = np.flatnonzero(counts == counts.max())[:1] if counts.max() >= 0.05 * grey.size else peaks
    return sorted({int(level) + step for level in peaks for step in (-1, 0, 1)})


def _courtyards(grey: Bytes, known: Mask, resolution: float) -> Mask:
    """The pixels, bool (h, w), of thick areas of one flat mid-grey and many square metres."""
    thick = _thick(grey, ~known & (grey >= DARK_BELOW), in_cells(COURTYARD_RADIUS, resolution))
    if not thick.any():
        return thick
    parts, areas = split_labels(np.where(known | (grey < DARK_BELOW), -1, grey.astype(np.int32)))
    depths = np.bincount(parts[thick], minlength=len(areas))
    chosen = (areas * resolution**2 >= COURTYARD_AREA) & (depths >= 0.5 * areas)
    return np.asarray((parts >= 0) & chosen[parts], np.bool_)


def _thick(grey: Bytes, among: Mask, cells: int) -> Mask:
    """The pixels, bool (h, w), that a disc of one grey level covers, all of it inside of a mask."""
    if cells > _LARGE_DISC:
        edges = ~among
        edges[1:] |= grey[1:] != grey[:-1]
        edges[:, 1:] |= grey[:, 1:] != grey[:, :-1]
        return _opened(np.pad(~edges, 1), cells)[1:-1, 1:-1]
    disc = _disc(cells)
    inside = cv2.erode(among.astype(np.uint8), disc, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    # A disc is one 4-connected piece: it never reaches from one area of its level into another.
    flat = inside & (cv2.erode(grey, disc) == cv2.dilate(grey, disc))
    return np.asarray(cv2.dilate(flat.astype(np.uint8), disc) > 0, np.bool_)


def _inside_of_background(grey: Bytes, free: Mask, resolution: float) -> Mask:
    """The pixels, bool (h, w), deeper than a skin in thick masses of the most common level not free."""
    if free.all():
        return np.zeros(free.shape, np.bool_)
    level = int(np.bincount(grey[~free], minlength=256).argmax())
    mass = ~free & (np.abs(grey.astype(np.int16) - level) <= 1)
    cells = in_cells(SOLID_RADIUS, resolution)
    reach = 2 * cells + 1
    padded = np.pad(mass, reach, constant_values=True)
    if cells > _LARGE_DISC:
        thick = _opened(padded, cells)
    else:
        thick = cv2.morphologyEx(padded.view(np.uint8), cv2.MORPH_OPEN, _disc(cells)) > 0
    depth = cv2.distanceTransform(padded.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray((thick & (depth * resolution > SOLID_SKIN))[reach:-reach, reach:-reach], np.bool_)


def _opened(mask: Mask, cells: int) -> Mask:
    """The pixels, bool (h, w), that a disc of that radius in pixels covers, all of it inside of a mask."""
    if mask.all():  # no distance to anything
        return mask
    core = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > cells
    return dilate_by_disc(core, cells)


def _disc(cells: int) -> Bytes:
    # OpenCV's ellipse is broader than `morphology.disc`; the thresholds above were found with it.
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * cells + 1, 2 * cells + 1)), np.uint8)
