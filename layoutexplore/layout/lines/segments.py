"""Wall segments: probabilistic Hough transform of a binary map, aligned to the dominant directions.

ROSE2, section III-B: segments come from the clean map itself, and each is replaced by its projection on the
line of the nearest dominant direction through its midpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Bytes, Floats, Ints, Mask
from layoutexplore.grids.boxes import true_box
from layoutexplore.layout.frame import undirected
from layoutexplore.layout.limits import most_segments
from layoutexplore.layout.lines.hough import LONGEST_IMAGE, hough_segments
from layoutexplore.options import check_fields


@dataclass(frozen=True, kw_only=True)
class SegmentConfig:
    """The Hough transform's lengths, in metres.

    Attributes:
        votes: Cells of a line that must be occupied, as a length.
        min_length: Shortest segment.
        max_gap: Longest gap inside a segment.
        twice: Search the mirror image of the map as well, and keep what either search finds. A search visits
            the cells in a random order and takes those of a segment from the others: what it finds depends on
            how the map lies, and where one leaves a gap the other may not.
    """

    votes: float = 1.25
    min_length: float = 0.25
    max_gap: float = 0.0
    twice: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
        if self.votes <= 0 or self.min_length < 0 or self.max_gap < 0:
            raise ConfigError("votes must be above 0, min_length and max_gap at least 0 metres")


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignedSegments:
    """Segments projected on their dominant direction; n segments, k directions.

    A point p on a line of direction a has the coordinate p . (cos a, sin a) along it and the offset p . (-sin
    a, cos a).

    Attributes:
        directions: float64 (k,), radians in [0, pi).
        direction: int64 (n,), index of each segment's direction.
        offset: float64 (n,), offset of the midpoint, in metres.
        start: float64 (n,), smaller coordinate along the direction.
        end: float64 (n,), larger coordinate along the direction.
    """

    directions: Floats
    direction: Ints
    offset: Floats
    start: Floats
    end: Floats

    def __len__(self) -> int:
        return len(self.direction)

    @property
    def length(self) -> Floats:
        """float64 (n,), in metres."""
        return self.end - self.start


def find_segments(mask: Mask, resolution: float, config: SegmentConfig) -> Floats:
    """Segments float64 (n, 4) as (x0, y0, x1, y1) through the centres of cells, in metres of the local frame.

    Args:
        mask: bool (rows, cols), the cells that may be wall.
        resolution: Metres a cell.
        config: The lengths.
    """
    _, rows, _, cols = true_box(mask)
    if not rows:
        return np.zeros((0, 4))
    # nothing lies behind the last occupied row and column; the origin has to stay, for the rounding of the
    # lines
    image = np.ascontiguousarray(mask[:rows, :cols]).view(np.uint8)
    found = _hough(image, resolution, config)
    if config.twice:
        mirrored = _hough(np.ascontiguousarray(image[::-1]), resolution, config)
        mirrored[:, 1::2] = rows - 1 - mirrored[:, 1::2]
        found = np.concatenate((found, mirrored))
    return np.asarray((_longest(found, most_segments(mask.shape)) + 0.5) * resolution, np.float64)


def _longest(segments: Ints, most: int) -> Ints:
    """At most so many segments (n, 4), the longest, in the order in which they were found."""
    if len(segments) <= most:
        return segments
    length = np.abs(segments[:, 2:] - segments[:, :2]).max(axis=1)
    return np.asarray(segments[np.sort(np.argsort(-length, kind="stable")[:most])])


def _hough(image: Bytes, resolution: float, config: SegmentConfig) -> Ints:
    """Segments int64 (n, 4) as column and row of both ends."""
    votes, length, gap = (
        round(min(metres / resolution, 2**30)) for metres in (config.votes, config.min_length, config.max_gap)
    )
    parts = [np.zeros((0, 4), np.int64)]
    # longer images are searched in parts of `LONGEST_IMAGE` rows and columns: votes are counted in 16 bits
    for row, col in product(*(range(0, n, LONGEST_IMAGE) for n in image.shape)):
        part = np.ascontiguousarray(image[row : row + LONGEST_IMAGE, col : col + LONGEST_IMAGE])
        found = hough_segments(part, max(votes, 2), length, gap)
        parts.append(found + np.array((col, row, col, row)))
    return np.concatenate(parts)


def segment_angles(segments: Floats) -> Floats:
    """Directions float64 (n,) of segments (n, 4), radians in [0, pi)."""
    return undirected(np.arctan2(segments[:, 3] - segments[:, 1], segments[:, 2] - segments[:, 0]))


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angle between undirected lines of directions a and b, radians in [0, pi / 2].

    Example:
        >>> round(float(angle_between(np.array(0.1), np.array(np.pi - 0.1))), 6)
        0.2
    """
    return np.abs(np.mod(a - b + np.pi / 2, np.pi) - np.pi / 2)


def align(segments: Floats, directions: Floats, max_deviation: float) -> tuple[AlignedSegments, Ints]:
    """Give each segment its nearest direction.

    Args:
        segments: float64 (n, 4).
        directions: float64 (k,), radians in [0, pi); at least one.
        max_deviation: Segments farther from every direction than this, in radians, are left out.

    Returns:
        The aligned segments, and the rows of `segments` they come from, int64 (m,).
    """
    deviation = angle_between(segment_angles(segments)[:, None], directions[None, :])
    nearest = deviation.argmin(axis=1)
    kept = np.flatnonzero(deviation[np.arange(len(segments)), nearest] <= max_deviation)
    return project(segments[kept], directions, nearest[kept]), kept


def project(segments: Floats, directions: Floats, direction: Ints) -> AlignedSegments:
    """Project segments (n, 4) on the directions they were given, int64 (n,)."""
    c, s = np.cos(directions)[direction], np.sin(directions)[direction]
    x0, y0, x1, y1 = segments.T
    along0, along1 = x0 * c + y0 * s, x1 * c + y1 * s
    return AlignedSegments(
        directions=directions,
        direction=direction.astype(np.int64),
        offset=((y0 + y1) * c - (x0 + x1) * s) / 2,
        start=np.minimum(along0, along1),
        end=np.maximum(along0, along1),
    )
