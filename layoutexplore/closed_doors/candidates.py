"""Rooms that may lie behind a closed door: rectangles bounded by seen walls and by the lines of the other walls.

Everything happens in a grid turned so that the room lies towards lower rows of its door. A side may end a wall's thickness
short of what is known, lie in line with a wall seen elsewhere, or halve the distance to the next door; the features say how
well each side is supported, how much the room touches, and how it fits among the doors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.closed_doors.doors import Door
from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN

FEATURES = (
    *("left_contact", "right_contact", "far_contact", "near_contact"),
    *("left_line", "right_line", "far_line", "left_gap", "right_gap", "far_gap"),
    *("left_end", "right_end", "far_end", "all_contact", "corner"),
    *("width", "depth", "area", "aspect", "possible", "hull", "in_box"),
    *("door_width", "recess", "recess_other", "offset", "doors", "same_doors", "depth_rank", "width_rank", "cut_ahead"),
)
"""What is known of a rectangle; see `Scene.features`."""

LARGEST = 18.0
"""Longest side of a room behind a closed door, in metres."""

_LINES = 7  # lines tried on each side


@dataclass(frozen=True, eq=False)
class Scene:
    """A turned grid and what is computed from it once for all doors of a direction.

    Attributes:
        cells: int8 (rows, cols), rooms lie towards lower rows of their doors.
        resolution: Metres a cell.
        thickness: Thickness of the walls in cells.
        hull: Bool (rows, cols): the convex hull of what is known.
        leaves: Bool (rows, cols): the closed doors of all directions.
    """

    cells: NDArray[np.int8]
    resolution: float
    thickness: int
    hull: NDArray[np.bool_]
    leaves: NDArray[np.bool_]

    @cached_property
    def possible(self) -> NDArray[np.bool_]:
        """Bool (rows, cols): unknown and at least a wall's thickness away from everything known."""
        return room_space(self.cells, self.thickness)

    @cached_property
    def sums(self) -> dict[str, NDArray[np.int64]]:
        """Integral images of what the features count."""
        known = self.cells != UNKNOWN
        layers = {"known": known, "possible": self.possible, "hull": self.hull, "leaves": self.leaves}
        return {name: np.pad(layer, ((1, 0), (1, 0))).cumsum(0).cumsum(1).astype(np.int64) for name, layer in layers.items()}

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        """First and last known row, first and last known column."""
        rows, cols = np.nonzero(self.cells != UNKNOWN)
        return int(rows.min()), int(rows.max()), int(cols.min()), int(cols.max())

    @cached_property
    def faces(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Length of the walls with their face on each column (free right, free left) and row (free below, free above)."""
        free, occupied = self.cells == FREE, self.cells == OCCUPIED
        right = (occupied[:, :-1] & free[:, 1:] & _solid(occupied[:, :-1], (9, 1))).sum(0)
        left = (occupied[:, 1:] & free[:, :-1] & _solid(occupied[:, 1:], (9, 1))).sum(0)
        below = (occupied[:-1] & free[1:] & _solid(occupied[:-1], (1, 9))).sum(1)
        above = (occupied[1:] & free[:-1] & _solid(occupied[1:], (1, 9))).sum(1)
        return np.append(right, 0), np.insert(left, 0, 0), np.append(below, 0), np.insert(above, 0, 0)

    def count(self, name: str, box: NDArray[np.int64]) -> NDArray[np.int64]:
        """Cells of a layer in boxes int (n, 4) of top, left, bottom, right (bottom and right not included)."""
        s = self.sums[name]
        top, bottom = np.clip(box[:, 0], 0, s.shape[0] - 1), np.clip(box[:, 2], 0, s.shape[0] - 1)
        left, right = np.clip(box[:, 1], 0, s.shape[1] - 1), np.clip(box[:, 3], 0, s.shape[1] - 1)
        return np.asarray(s[bottom, right] - s[top, right] - s[bottom, left] + s[top, left])

    def rectangles(self, door: Door) -> NDArray[np.int64]:
        """Candidates int64 (n, 4) as top, left, bottom, right (bottom and right not included)."""
        top = door.row - max(self.thickness - door.recess, 1)
        middle = (door.start + door.stop) // 2
        bottom = next((r for r in range(top, max(top - 2 * self.thickness, 0), -1) if self.possible[r, middle]), -1)
        if bottom < 0:
            return np.empty((0, 4), np.int64)
        bottom += 1
        reach, t = round(LARGEST / self.resolution), self.thickness
        strip = self.possible[max(bottom - max(t, 8), 0) : bottom].mean(0) > 0.6
        starts = [*_ends(strip, middle, -1, reach), *_lines(self.faces[0], self.faces[1], t, middle, -1, reach)]
        stops = [*_ends(strip, middle, 1, reach), *_lines(self.faces[1], self.faces[0], -t, middle, 1, reach)]
        shaft = self.possible[:, max(door.start + 3, 0) : max(door.stop - 3, door.start + 4)].mean(1) > 0.6
        tops = [*_ends(shaft, bottom - 1, -1, reach), *_lines(self.faces[2], self.faces[3], t, bottom - 1, -1, reach)]
        around = np.asarray(self.leaves[max(door.row - 3, 0) : door.row + 4].any(axis=0))
        for sign, sides in ((-1, starts), (1, stops)):
            sides += _halfway(around, door, sign, reach, t)
        boxes = np.array(
            [(a, b, bottom, c) for a in dict.fromkeys(tops) for b in dict.fromkeys(starts) for c in dict.fromkeys(stops)]
        )
        if not len(boxes):
            return np.empty((0, 4), np.int64)
        width, depth = boxes[:, 3] - boxes[:, 1], boxes[:, 2] - boxes[:, 0]
        least = 0.6 / self.resolution
        boxes = boxes[(width >= least) & (depth >= least) & (np.maximum(width, depth) <= reach)].astype(np.int64)
        size = (boxes[:, 3] - boxes[:, 1]) * (boxes[:, 2] - boxes[:, 0])
        return np.asarray(boxes[self.count("possible", boxes) >= 0.75 * size])

    def features(self, door: Door, boxes: NDArray[np.int64]) -> NDArray[np.float64]:
        """`FEATURES` of rectangles, float64 (n, features); lengths in metres, shares 0..1."""
        top, left, bottom, right = boxes.T
        height, width = bottom - top, right - left
        t, res, reach = self.thickness, self.resolution, self.thickness + 4

        contacts = [
            self._contact(boxes, "left", reach), self._contact(boxes, "right", reach),
            self._contact(boxes, "top", reach), self._contact(boxes, "bottom", reach),
        ]  # fmt: skip
        lines, gaps = [], []
        for same, other, position, shift in (
            (self.faces[0], self.faces[1], left - 1, -t),
            (self.faces[1], self.faces[0], right, t),
            (self.faces[2], self.faces[3], top - 1, -t),
        ):
            support = _around(same, position) + _around(other, position + shift)
            lines.append(np.log1p(support * res))
            gaps.append(_around(same, position) * res)
        area = width * height
        known_box = self.box
        inside = (
            (np.minimum(bottom, known_box[1] + 1) - np.maximum(top, known_box[0])).clip(0)
            * (np.minimum(right, known_box[3] + 1) - np.maximum(left, known_box[2])).clip(0)
        )  # fmt: skip
        ends = [
            self._contact(boxes, "left", reach, part="far"), self._contact(boxes, "right", reach, part="far"),
            self._contact(np.stack([top, left, bottom, right], 1), "top", 3 * reach),
        ]  # fmt: skip
        rim = np.stack([top - reach, left - reach, bottom + reach, right + reach], 1)
        rows = np.full_like(top, door.row)
        front = np.stack([rows - 3, left, rows + 4, right], 1)
        sides = np.stack(contacts[:3])
        ahead = np.stack([top - round(1.5 / res), left, top, right], 1)
        columns = [
            *contacts, *lines, *gaps, *ends, sides.mean(0), np.sort(sides, 0)[1],
            width * res, height * res, area * res**2, np.minimum(width, height) / np.maximum(width, height),
            self.count("possible", boxes) / area, self.count("hull", boxes) / area, inside / area,
            np.full(len(boxes), (door.stop - door.start) * res), np.full(len(boxes), door.recess * res),
            np.full(len(boxes), door.recess_other * res),
            np.abs((door.start + door.stop) / 2 - (left + right) / 2) / width,
            self.count("leaves", rim) * res, self.count("leaves", front) * res,
            _rank(height), _rank(width), self.count("possible", ahead) / np.maximum(width * round(1.5 / res), 1),
        ]  # fmt: skip
        return np.stack(columns, 1).astype(np.float64)

    def _contact(self, boxes: NDArray[np.int64], side: str, reach: int, part: str = "all") -> NDArray[np.float64]:
        """Share of a side behind which something known lies within reach, from samples along it."""
        top, left, bottom, right = boxes.T
        first, last = (top, bottom) if side in ("left", "right") else (left, right)
        if part == "far":
            last = first + np.minimum(last - first, round(1.0 / self.resolution))
        found = np.zeros(len(boxes))
        samples = 12
        for k in range(samples):
            a = first + (last - first) * k // samples
            b = np.maximum(first + (last - first) * (k + 1) // samples, a + 1)
            box = {
                "left": [a, left - reach, b, left],
                "right": [a, right, b, right + reach],
                "top": [top - reach, a, top, b],
                "bottom": [bottom, a, bottom + reach, b],
            }[side]
            found += self.count("known", np.stack(box, 1)) >= (b - a) * 0.5
        return found / samples


def room_space(cells: NDArray[np.int8], thickness: int) -> NDArray[np.bool_]:
    """Bool (rows, cols): unknown cells at least a wall's thickness away from everything known."""
    unknown = (cells == UNKNOWN).astype(np.uint8)
    size = 2 * max(thickness - 1, 0) + 1
    return np.asarray(cv2.erode(unknown, np.ones((size, size), np.uint8)) > 0)


def wall_thickness(cells: NDArray[np.int8], resolution: float) -> int:
    """Usual thickness of the walls in cells: that of most stretches that are not free between two free cells."""
    counts = np.zeros(round(0.8 / resolution) + 1, np.int64)
    for turned in (cells, cells.T):
        free = np.pad(turned == FREE, ((0, 0), (1, 1)), constant_values=True).ravel()
        edges = np.flatnonzero(np.diff(free.astype(np.int8)))
        lengths = edges[1:][free[edges[1:] + 1]] - edges[:-1][free[edges[1:] + 1]]
        lengths = lengths[lengths < len(counts)]
        counts += np.bincount(lengths, minlength=len(counts))
    counts[: max(round(0.2 / resolution), 2)] = 0
    if counts.sum() < 100:
        return max(round(0.2 / resolution), 2)
    return max(int(np.argmax(np.convolve(counts, [1, 2, 1], "same"))), 2)


def _solid(mask: NDArray[np.bool_], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Cells of a mask that belong to a straight run of the size of a kernel, small breaks forgiven."""
    share = cv2.blur(mask.astype(np.float32), (size[1], size[0]), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(mask & (share >= 0.6))


def _ends(line: NDArray[np.bool_], start: int, sign: int, reach: int) -> list[int]:
    """Where a run of possible cells ends: the first index of it (sign -1) or the one behind its last (sign 1)."""
    part = line[start : start + reach] if sign > 0 else line[max(start - reach, 0) : start + 1][::-1]
    stop = np.flatnonzero(~part)
    if not len(stop):
        return []
    return [start + int(stop[0])] if sign > 0 else [start - int(stop[0]) + 1]


def _lines(same: NDArray[np.int64], other: NDArray[np.int64], shift: int, start: int, sign: int, reach: int) -> list[int]:
    """Edges in line with walls seen elsewhere: faces of the same side, and of the other side a wall's thickness away."""
    support = same.astype(np.float64)
    moved = np.roll(other, shift)
    support = np.convolve(support + moved, [1, 1, 1], "same")
    low, high = (max(start - reach, 0), start - 5) if sign < 0 else (start + 5, min(start + reach, len(support)))
    part = support[low:high].copy()
    found: list[int] = []
    while len(found) < _LINES and len(part) and part.max() >= 15:
        k = int(part.argmax())
        found.append(low + k + (1 if sign < 0 else 0))
        part[max(k - 5, 0) : k + 6] = 0
    return found


def _halfway(leaves: NDArray[np.bool_], door: Door, sign: int, reach: int, thickness: int) -> list[int]:
    """The edge halfway to the next door in the same wall, less half a wall."""
    if sign < 0:
        others = np.flatnonzero(leaves[max(door.start - reach, 0) : max(door.start - 5, 0)])
        return [(int(others[-1]) + max(door.start - reach, 0) + door.start + thickness) // 2] if len(others) else []
    others = np.flatnonzero(leaves[door.stop + 5 : door.stop + reach])
    return [(int(others[0]) + door.stop + 5 + door.stop - thickness) // 2] if len(others) else []


def _around(support: NDArray[np.int64], position: NDArray[np.int64]) -> NDArray[np.int64]:
    index = np.clip(position, 2, len(support) - 3)
    return np.asarray(sum(support[index + k] for k in (-2, -1, 0, 1, 2)))


def _rank(values: NDArray[np.int64]) -> NDArray[np.float64]:
    """Place of each value among the candidates', 0 for the least and 1 for the greatest."""
    order = np.searchsorted(np.unique(values), values)
    return np.asarray(order / max(int(order.max(initial=0)), 1))
