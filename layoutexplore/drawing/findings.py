"""A floor plan with the numbered places of what is to be corrected in it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.dashboard import put_dot, put_text, text_width
from layoutexplore.drawing.floor_plans import CAPTION, Box, draw_sheet
from layoutexplore.drawing.palette import Image
from layoutexplore.drawing.view import SHIFT
from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.polygons import Point
from layoutexplore.importing.findings import Finding
from layoutexplore.maps.floorplan import FloorPlan

RADIUS = 12.0
"""Pixels of a finding's circle."""

DOT = 3.0
"""Pixels of the dot at a place whose circle stands beside it."""

DRAWN_OVER = 70.0
"""Pixels that a circle is rather moved than put over a door or the number of a room."""

MOST_MOVED = 400
"""More circles than these are left at their places: they lie too densely to be read anyway."""


@checks_arguments
def draw_findings(plan: FloorPlan, findings: Sequence[Finding] = ()) -> Image:
    """The plan as `draw_sheet` draws it, and a number at every finding's place.

    A number whose place is taken stands beside it, with a thin line to a dot there, or to the number of the
    room where the dot would cover that.

    Args:
        plan: What to draw.
        findings: Numbered from 1 in their order.

    Returns:
        uint8 (height, width, 3) RGB, the highest y at the top.
    """
    sheet = draw_sheet(plan)
    places = [sheet.pixel((finding.x, finding.y)) for finding in findings]
    centres = circle_places(
        places, sheet.doors + sheet.numbers, (sheet.image.shape[1], sheet.image.shape[0] - CAPTION)
    )
    moved = [(place, centre) for place, centre in zip(places, centres, strict=True) if place != centre]
    for place, centre in moved:
        start = place
        if box := next((box for box in sheet.numbers if _gap(place, box) < DOT + 2), None):
            start = _rim(box, centre)
        cv2.line(sheet.image, _fixed(start), _fixed(centre), palette.INK, 1, cv2.LINE_AA, SHIFT)
    for place, _ in moved:
        if all(_gap(place, box) >= DOT + 2 for box in sheet.numbers):
            put_dot(sheet.image, _fixed(place), DOT, palette.VERMILLION)
    for number, centre in enumerate(centres, start=1):
        put_dot(sheet.image, _fixed(centre), RADIUS, palette.VERMILLION)
        text = str(number)
        height = 9.0 if number < 100 else 7.0
        left = centre[0] - text_width(text, height) / 2
        put_text(sheet.image, text, left, centre[1] + height / 2, height, palette.WHITE)
    return sheet.image


@checks_arguments
def circle_places(places: Sequence[Point], taken: Sequence[Box], size: tuple[int, int]) -> list[Point]:
    """Centres of circles near their places, none over another while there is room for it.

    Args:
        places: Where the circles belong, in pixels.
        taken: Boxes that they had better not cover.
        size: Width and height of the image, which they do not leave.

    Example:
        >>> first, second = circle_places([(50.0, 50.0), (50.0, 50.0)], [], (200, 100))
        >>> first, np.hypot(second[0] - 50.0, second[1] - 50.0) > 2 * RADIUS
        ((50.0, 50.0), np.True_)
    """
    if len(places) > MOST_MOVED:
        return list(places)
    found: list[Point] = []
    points = np.array(places, np.float64).reshape(-1, 2)
    fixed = np.array(taken, np.float64).reshape(-1, 4)
    for place in places:
        # The dots of other circles' places are not to be covered either.
        others = points[np.hypot(*(points - place).T) > DOT]
        boxes = np.concatenate([fixed, np.hstack([others - DOT, others + DOT])])
        reach = 6.0 * RADIUS
        centre = None
        while centre is None and reach < 2 * max(size):
            centre = _free_centre(place, np.array(found, np.float64).reshape(-1, 2), boxes, size, reach)
            reach *= 2
        found.append(centre or place)
    return found


def _free_centre(
    place: Point, circles: Floats, boxes: Floats, size: tuple[int, int], reach: float
) -> Point | None:
    """The nearest centre within reach (pixels) over no other circle and, if not too far, over no box."""
    candidates = place + _offsets(reach)
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2
    wide = np.hypot(*(boxes[:, 2:] - boxes[:, :2]).T) / 2
    boxes = boxes[np.hypot(*(centre - place).T) <= reach + wide + 2 * RADIUS]
    low, high = RADIUS + 2.0, np.array(size) - RADIUS - 2.0
    cost = np.hypot(*(candidates - place).T)
    near = circles[np.hypot(*(circles - place).T) <= reach + 3 * RADIUS]
    gaps = np.hypot(*(candidates[:, None] - near[None]).transpose(2, 0, 1))
    possible = ((candidates >= low) & (candidates <= high)).all(axis=1) & (gaps > 2 * RADIUS + 3).all(axis=1)
    if not possible.any():
        return None
    beside = np.maximum(boxes[None, :, :2] - candidates[:, None], candidates[:, None] - boxes[None, :, 2:])
    covers = np.hypot(*np.maximum(beside, 0.0).transpose(2, 0, 1)) < RADIUS + 3
    cost += DRAWN_OVER * covers.sum(axis=1)
    x, y = candidates[possible][int(cost[possible].argmin())].tolist()
    return x, y


def _offsets(reach: float) -> Floats:
    """Steps float64 (n, 2) in rings from the middle on, each ring from above clockwise."""
    rings = [np.zeros((1, 2))]
    for radius in np.arange(RADIUS + 6.0, reach, 6.0):
        angles = np.linspace(-np.pi / 2, 1.5 * np.pi, 24, endpoint=False)
        rings.append(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    return np.concatenate(rings)


def _gap(point: Point, box: Box) -> float:
    """Pixels from a point to a box, 0 inside."""
    x, y = point
    return float(np.hypot(max(box[0] - x, x - box[2], 0.0), max(box[1] - y, y - box[3], 0.0)))


def _rim(box: Box, centre: Point) -> Point:
    """The place on a circle around a box on the way to a point outside."""
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    radius = float(np.hypot(box[2] - box[0], box[3] - box[1])) / 2 + 2
    away = max(float(np.hypot(centre[0] - x, centre[1] - y)), radius)
    return x + (centre[0] - x) * radius / away, y + (centre[1] - y) * radius / away


def _fixed(point: Point) -> tuple[int, int]:
    return round(point[0] * (1 << SHIFT)), round(point[1] * (1 << SHIFT))
