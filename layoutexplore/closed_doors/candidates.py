"""Candidate rectangles for the room behind a closed door, bounded by walls and the lines of other walls.

Everything happens in a grid turned so that the room lies towards lower rows of its door. A side may end a
wall's thickness short of what is known, lie in line with a wall seen elsewhere or in the mirrored plan, at a
jamb of a door or halfway to the next one, or make the room as wide or as deep as others.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.closed_doors.doors import ClosedDoor
from layoutexplore.closed_doors.scene import APART, LARGEST, Scene, in_line, peaks
from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.grids.grid import FREE

_LINES, _NEAREST, _SIDES = 7, 3, 12
"""Lines tried on each side, those with most support and the nearest; edges of all kinds."""

_USUAL = 3
"""Usual widths and depths tried."""

_SUPPORT = 0.75
"""Metres of wall that support a line."""


def rectangles(scene: Scene, door: ClosedDoor) -> Ints:
    """Candidates int64 (n, 4) as top, left, bottom, right (bottom and right not included)."""
    top, middle = door.row - max(scene.thickness - door.recess_other, 1), (door.start + door.stop) // 2
    nearest = max(top - 2 * scene.thickness, 0)
    bottom = next((r for r in range(door.row - 1, nearest, -1) if scene.possible[r, middle]), -1)
    if bottom < 0:
        return np.empty((0, 4), np.int64)
    bottom += 1
    reach, t = round(LARGEST / scene.resolution), scene.thickness
    strip = scene.possible[max(bottom - max(t, scene.span(0.4)), 0) : bottom].mean(0) > 0.6
    starts = [*_ends(strip, middle, -1, reach), *_beside(scene, door, -1, reach)]
    stops = [*_ends(strip, middle, 1, reach), *_beside(scene, door, 1, reach)]
    inner = scene.span(0.15)
    inside = np.s_[max(door.start + inner, 0) : max(door.stop - inner, door.start + scene.span(0.2))]
    shaft = scene.possible[:, inside]
    open_rows = shaft.sum(1) > 0.6 * shaft.shape[1]
    tops = _ends(open_rows, bottom - 1, -1, reach)
    left, right, far = _mirrored_room(scene, bottom, middle)
    starts, stops, tops = starts + left, stops + right, tops + far
    starts += _lines(scene, (0, 1), t, middle, -1)
    stops += _lines(scene, (1, 0), -t, middle, 1)
    tops += _lines(scene, (2, 3), t, bottom - 1, -1)
    usual = [_usual(lengths, scene) for lengths in scene.widths]
    usual_starts = [c - w for c in stops[:3] for w in usual[0]]
    usual_stops = [b + w for b in starts[:3] for w in usual[0]]
    starts, stops = starts + usual_starts, stops + usual_stops
    tops += [bottom - d for d in usual[1]]
    starts, stops, tops = (_distinct(sides, scene.span(0.1)) for sides in (starts, stops, tops))
    square = {(bottom - c + b, b, bottom, c) for b in starts[:4] for c in stops[:4]}
    corners = {(a, b, bottom, c) for a in tops for b in starts for c in stops} | square
    boxes = np.array([*corners]).reshape(-1, 4)
    boxes = boxes[np.lexsort(boxes.T)]
    boxes = boxes[
        (boxes[:, :2] >= 0).all(1)
        & (boxes[:, 3] <= scene.cells.shape[1])
        & (boxes[:, 1] <= door.start + scene.span(0.2))
        & (boxes[:, 3] >= door.stop - scene.span(0.2))
    ]
    if not len(boxes):
        return np.empty((0, 4), np.int64)
    width, depth = boxes[:, 3] - boxes[:, 1], boxes[:, 2] - boxes[:, 0]
    least = 0.6 / scene.resolution
    boxes = boxes[(width >= least) & (depth >= least) & (np.maximum(width, depth) <= reach)].astype(np.int64)
    size = (boxes[:, 3] - boxes[:, 1]) * (boxes[:, 2] - boxes[:, 0])
    return np.asarray(boxes[scene.count("possible", boxes) >= 0.75 * size])


def _beside(scene: Scene, door: ClosedDoor, sign: int, reach: int) -> list[int]:
    """Edges beside the door: at its jamb, halfway to the next door of the wall, and at that door's jamb."""
    t, jamb, away = scene.thickness, scene.span(0.15), scene.span(0.25)
    around = np.array(scene.leaves[max(door.row - jamb, 0) : door.row + jamb + 1].any(axis=0))
    if sign < 0:
        others = np.flatnonzero(around[max(door.start - reach, 0) : max(door.start - away, 0)])
        if not len(others):
            return [door.start - jamb]
        end = int(others[-1]) + max(door.start - reach, 0) + 1
        return [(end + door.start + t) // 2, door.start - jamb, end + jamb + t]
    others = np.flatnonzero(around[door.stop + away : door.stop + reach])
    if not len(others):
        return [door.stop + jamb]
    begin = int(others[0]) + door.stop + away
    return [(begin + door.stop - t) // 2, door.stop + jamb, begin - jamb - t]


def _mirrored_room(scene: Scene, bottom: int, middle: int) -> tuple[list[int], list[int], list[int]]:
    """Edges of the free space of the mirrored plan around the place behind the door."""
    row = max(bottom - scene.span(0.2), 0)
    if scene.mirrored[row, middle] != FREE:
        return [], [], []
    line, column = scene.mirrored[row] == FREE, scene.mirrored[:, middle] == FREE
    reach = round(LARGEST / scene.resolution)
    return _ends(line, middle, -1, reach), _ends(line, middle, 1, reach), _ends(column, row, -1, reach)


def _ends(line: Mask, start: int, sign: int, reach: int) -> list[int]:
    """Where a run of possible cells ends: its first index (sign -1) or the one behind its last (sign 1)."""
    part = line[start : start + reach] if sign > 0 else line[max(start - reach, 0) : start + 1][::-1]
    stop = np.flatnonzero(~part)
    if not len(stop):
        return []
    return [start + int(stop[0])] if sign > 0 else [start - int(stop[0]) + 1]


def _lines(scene: Scene, faces: tuple[int, int], shift: int, start: int, sign: int) -> list[int]:
    """Edges in line with walls seen elsewhere, by faces of the same side and of the other side.

    Args:
        scene: The turned grid.
        faces: Which of its faces are of the same side and which of the other.
        shift: Cells by which the other side's are moved.
        start: Where the search begins.
        sign: -1 towards lower lines, 1 towards higher ones.
    """
    same, moved = scene.faces[faces[0]], np.roll(scene.faces[faces[1]], shift)
    support = in_line(same + moved, scene.resolution)
    reach, apart = round(LARGEST / scene.resolution), scene.span(APART)
    low, high = max(start - reach, 0), start - apart
    if sign > 0:
        low, high = start + apart, min(start + reach, len(support))
    part = support[low:high].copy()
    found: list[int] = []
    while len(found) < _LINES and len(part) and part.max() >= scene.span(_SUPPORT):
        k = int(part.argmax())
        found.append(low + k + (1 if sign < 0 else 0))
        part[max(k - apart, 0) : k + apart + 1] = 0
    near = np.flatnonzero(peaks(same + moved, scene.resolution)[low:high])[::sign][:_NEAREST]
    return [low + int(k) + (1 if sign < 0 else 0) for k in near] + found


def _distinct(sides: list[int], apart: int) -> list[int]:
    """The first edges, less those that lie no further than `apart` from an earlier one."""
    kept: list[int] = []
    for side in sides:
        if len(kept) < _SIDES and all(abs(side - other) > apart for other in kept):
            kept.append(side)
    return kept


def _usual(lengths: Floats, scene: Scene) -> list[int]:
    """The most usual lengths above 1 m in cells."""
    part, apart = lengths.copy(), scene.span(0.3)
    found: list[int] = []
    part[: scene.span(1.0)] = 0
    while len(found) < _USUAL and part.max() >= 1.0:
        k = int(part.argmax())
        found.append(k)
        part[max(k - apart, 0) : k + apart + 1] = 0
    return found
