"""Features of a rectangle behind a closed door: support of each side, what it touches, how usual it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from layoutexplore.closed_doors.doors import ClosedDoor
from layoutexplore.closed_doors.scene import Scene, peaks
from layoutexplore.grids.arrays import Floats, Ints

FEATURES = (
    *("left_contact", "right_contact", "far_contact", "near_contact"),
    *("left_line", "right_line", "far_line", "left_gap", "right_gap", "far_gap"),
    *("left_end", "right_end", "far_end", "all_contact", "corner"),
    *("width", "depth", "area", "aspect", "possible", "hull", "in_box"),
    *("door_width", "recess", "recess_other", "offset", "doors", "same_doors", "cut_ahead"),
    *(
        "left_edge",
        "right_edge",
        "left_door",
        "right_door",
        "width_seen",
        "depth_seen",
        "left_lines",
        "right_lines",
        "far_lines",
    ),
    *(
        "mirror_free",
        "mirror_wall",
        "mirror_left",
        "mirror_right",
        "mirror_far",
        "mirror_score",
        "mirror_overlap",
    ),
    *("left_beyond", "right_beyond", "far_left", "far_right", "left_outline", "right_outline", "side_lines"),
)
"""What is known of a rectangle; see `describe`."""


def describe(scene: Scene, door: ClosedDoor, boxes: Ints) -> Floats:
    """`FEATURES` of rectangles, float64 (n, features); lengths in metres, shares 0..1."""
    top, left, bottom, right = boxes.T
    height, width = bottom - top, right - left
    t, res, near = scene.thickness, scene.resolution, scene.span(0.15)
    reach = t + scene.span(0.2)

    contacts = [
        _contact(scene, boxes, "left", reach), _contact(scene, boxes, "right", reach),
        _contact(scene, boxes, "top", reach), _contact(scene, boxes, "bottom", reach),
    ]  # fmt: skip
    lines, gaps = [], []
    for same, other, position, shift in (
        (scene.faces[0], scene.faces[1], left - 1, -t),
        (scene.faces[1], scene.faces[0], right, t),
        (scene.faces[2], scene.faces[3], top - 1, -t),
    ):
        support = _around(scene, same, position) + _around(scene, other, position + shift)
        lines.append(np.log1p(support * res))
        gaps.append(_around(scene, same, position) * res)
    area = width * height
    known_box = scene.box
    inside = (
        (np.minimum(bottom, known_box[1] + 1) - np.maximum(top, known_box[0])).clip(0)
        * (np.minimum(right, known_box[3] + 1) - np.maximum(left, known_box[2])).clip(0)
    )  # fmt: skip
    ends = [
        _contact(scene, boxes, "left", reach, part="far"), _contact(scene, boxes, "right", reach, part="far"),
        _contact(scene, np.stack([top, left, bottom, right], 1), "top", 3 * reach),
    ]  # fmt: skip
    rim = np.stack([top - reach, left - reach, bottom + reach, right + reach], 1)
    rows = np.full_like(top, door.row)
    front = np.stack([rows - near, left, rows + near + 1, right], 1)
    sides = np.stack(contacts[:3])
    ahead = np.stack([top - round(1.5 / res), left, top, right], 1)
    columns = [
        *contacts, *lines, *gaps, *ends, sides.mean(0), np.sort(sides, 0)[1],
        width * res, height * res, area * res**2, np.minimum(width, height) / np.maximum(width, height),
        scene.count("possible", boxes) / area, scene.count("hull", boxes) / area, inside / area,
        np.full(len(boxes), (door.stop - door.start) * res), np.full(len(boxes), door.recess * res),
        np.full(len(boxes), door.recess_other * res),
        np.abs((door.start + door.stop) / 2 - (left + right) / 2) / width,
        scene.count("leaves", rim) * res, scene.count("leaves", front) * res,
        scene.count("possible", ahead) / np.maximum(width * round(1.5 / res), 1),
        *_fit(scene, door, boxes), *_neighbours(scene, boxes),
    ]  # fmt: skip
    return np.stack(columns, 1).astype(np.float64)


def _fit(scene: Scene, door: ClosedDoor, boxes: Ints) -> list[Floats]:
    """Distances to the doors, how usual the size is, lines beyond, and the mirrored plan."""
    top, left, bottom, right = boxes.T
    res, near, rim = scene.resolution, scene.span(0.15), scene.span(0.1)
    reach, inner = scene.thickness + scene.span(0.2), scene.span(0.2)
    around = np.array(scene.leaves[max(door.row - near, 0) : door.row + near + 1].any(axis=0))
    around[door.start : door.stop] = False
    others = np.flatnonzero(around)
    far = round(5.0 / res)
    places = np.concatenate([[-far], others, [len(around) + far]])
    before = left - places[np.searchsorted(places, left) - 1]
    after = places[np.searchsorted(places, right)] - right
    area, size = (bottom - top) * (right - left), len(boxes)
    lines = []
    for same, a, b in (
        (scene.faces[0], left - 1, np.full(size, door.start)),
        (scene.faces[1], np.full(size, door.stop), right),
        (scene.faces[2], top - 1, bottom),
    ):
        strong = np.concatenate([[0], np.cumsum(peaks(same, res))])
        first, last = (np.clip(v, 0, len(strong) - 1) for v in (a + near + 1, b - near))
        lines.append(strong[last] - strong[first])
    rims = [
        np.stack([top, left - reach, bottom, left + rim], 1),
        np.stack([top, right - rim, bottom, right + reach], 1),
        np.stack([top - reach, left, top + rim, right], 1),
    ]  # fmt: skip
    lengths = (bottom - top, bottom - top, right - left)
    mirrored = [
        np.minimum(scene.count("mirror_wall", box) / length, 2.0)
        for box, length in zip(rims, lengths, strict=True)
    ]
    inner_box = np.stack([top + inner, left + inner, bottom - inner, right - inner], 1)
    return [
        (door.start - left) * res, (right - door.stop) * res,
        np.minimum(before, far) * res, np.minimum(after, far) * res,
        _seen(scene.widths[0], right - left), _seen(scene.widths[1], bottom - top), *lines,
        scene.count("mirror_free", boxes) / area, scene.count("mirror_wall", inner_box) / np.sqrt(area),
        *mirrored,
        np.full(size, scene.likeness[0]), np.full(size, scene.likeness[1]),
    ]  # fmt: skip


def _neighbours(scene: Scene, boxes: Ints) -> list[Floats]:
    """How the far side fits the walls of the rooms beside, and the sides those of the rooms opposite."""
    top, left, bottom, right = boxes.T
    res, t, near = scene.resolution, scene.thickness, scene.span(0.15)
    reach = t + scene.span(0.2)
    metre, wide = round(1.0 / res), round(6.0 / res)
    above = np.stack([np.maximum(top - metre, 0), left, top, right], 1)
    out: list[NDArray[np.floating]] = [_contact(scene, above, side, reach) for side in ("left", "right")]
    for a, b in ((left - t - wide, left - t), (right + t, right + t + wide)):
        out.append(scene.count("far", np.stack([top - near, a, top + near, b], 1)) * res)
    for a, b in ((left - t - metre, left - t), (right + t, right + t + metre)):
        out.append(scene.count("outline", np.stack([top - near - t // 2, a, top + near, b], 1)) / metre)
    across = np.stack([bottom, left - near, bottom + wide * 2, left + near], 1)
    other = np.stack([bottom, right - near, bottom + wide * 2, right + near], 1)
    out.append((scene.count("start", across) + scene.count("stop", other)) * res)
    return [np.asarray(column, np.float64) for column in out]


def _contact(scene: Scene, boxes: Ints, side: str, reach: int, part: str = "all") -> Floats:
    """Share of a side behind which something known lies within reach, from samples along it."""
    top, left, bottom, right = boxes.T
    first, last = (top, bottom) if side in ("left", "right") else (left, right)
    if part == "far":
        last = first + np.minimum(last - first, round(1.0 / scene.resolution))
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
        found += scene.count("known", np.stack(box, 1)) >= (b - a) * 0.5
    return found / samples


def _seen(lengths: Floats, values: Ints) -> Floats:
    """Logarithm of 1 + the metres of free space of such a length."""
    return np.asarray(np.log1p(lengths[np.clip(values, 0, len(lengths) - 1)]))


def _around(scene: Scene, support: Ints, position: Ints) -> Ints:
    """Cells of wall on the lines within 0.1 m of each position."""
    beside = scene.span(0.1)
    index = np.clip(position, beside, len(support) - 1 - beside)
    return np.asarray(sum(support[index + k] for k in range(-beside, beside + 1)))
