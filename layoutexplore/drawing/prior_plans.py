"""A plan known beforehand, drawn over the map as it is believed to lie, and beside the robot's way."""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.dashboard import Keys, keys_width, put_keys, put_text, text_width
from layoutexplore.drawing.palette import Image
from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.grids.arrays import Bytes, Floats
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import check_picture
from layoutexplore.options import SHARE, Rule, check_kind
from layoutexplore.priors.completion import Compared, compared
from layoutexplore.priors.registration import Registration

CAPTION = 28
"""Least height of the caption (on screen)."""

GAP = 24
"""Space between two pictures side by side (on screen)."""

_KEYS = {
    Compared.FORESEEN_FLOOR: (palette.PREDICTED, "floor of the plan"),
    Compared.FORESEEN_WALL: (palette.BLUE, "walls of the plan"),
    Compared.OTHER_FLOOR: (palette.VERMILLION, "seen otherwise"),
    Compared.OTHER_WALL: (palette.VERMILLION, "seen otherwise"),
}
"""What the colours mean; said of those that are there, where the picture is wide enough for it."""


@checks_arguments
def draw_registered(
    grid: OccupancyGrid, registration: Registration, confidence: float, track: Floats, *, scale: int = 3
) -> Image:
    """The map with the plan as the best hypothesis places it, where it agrees and where it does not.

    Floor that only the plan knows is tinted, strongly where the plan is sure; walls that only the plan knows
    are blue; seen floor and walls that the plan shows otherwise are red. The way is drawn on top, from a
    green dot to a blue one.

    Args:
        grid: What the robot knows.
        registration: Of the plan.
        confidence: Of its best hypothesis, 0..1.
        track: float64 (n, 3), the poses so far as (x, y, theta).
        scale: Pixels a cell.

    Returns:
        uint8 (rows * scale + caption, cols * scale, 3) RGB; the top row is the highest y.
    """
    check_kind("grid", grid, OccupancyGrid)
    check_kind("registration", registration, Registration)
    Rule(kind=int, low=1, high=64).convert("scale", scale)
    codes = compared(grid, registration)
    image = draw_comparison(codes, confidence)
    large = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    picture = np.asarray(large, np.uint8)
    _draw_way(picture, grid, track, scale)
    words = f"confidence {confidence:.2f}" if registration.hypotheses else "no place found"
    return _captioned(picture, words, list(dict.fromkeys(_KEYS[k] for k in _KEYS if (codes == k).any())))


@checks_arguments
def draw_comparison(codes: Bytes, confidence: float) -> Image:
    """What `compared` found as a picture, a pixel a cell.

    Args:
        codes: uint8 (rows, cols), values of `Compared`.
        confidence: Of the plan's place, 0..1: foreseen floor and walls are paler where it is low.

    Returns:
        uint8 (rows, cols, 3) RGB; the top row is the highest y.
    """
    SHARE.convert("confidence", confidence)
    if codes.ndim != 2 or not np.isin(codes, list(Compared)).all():
        raise MapError(f"codes are a table of values of Compared, got {codes.dtype} {codes.shape}")
    colours = np.empty((len(Compared), 3), np.float64)
    colours[Compared.SILENT] = palette.CANVAS
    colours[Compared.FLOOR] = palette.FREE
    colours[Compared.WALL] = palette.WALL
    colours[Compared.FORESEEN_FLOOR] = _mixed(palette.CANVAS, palette.PREDICTED, confidence)
    colours[Compared.FORESEEN_WALL] = _mixed(palette.CANVAS, palette.BLUE, 0.3 + 0.7 * confidence)
    colours[Compared.OTHER_FLOOR] = _mixed(palette.FREE, palette.VERMILLION, 0.35)
    colours[Compared.OTHER_WALL] = palette.VERMILLION
    return np.asarray(colours.astype(np.uint8)[codes[::-1]], np.uint8)


@checks_arguments
def side_by_side(left: Image, right: Image) -> Image:
    """Two pictures of one height, the left one scaled to that of the right one."""
    for name, image in (("left", left), ("right", right)):
        check_picture(name, image)
    height = right.shape[0]
    width = max(1, round(left.shape[1] * height / left.shape[0]))
    fitted = np.asarray(cv2.resize(left, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    gap = np.full((height, GAP, 3), 255, np.uint8)
    return np.concatenate([fitted, gap, right], axis=1)


def _captioned(picture: Image, words: str, keys: Keys) -> Image:
    """The picture below a line of words and, where there is room, what its colours mean."""
    wide = picture.shape[1]
    bar = max(CAPTION, round(0.03 * wide))
    framed = np.pad(picture, ((bar, 0), (0, 0), (0, 0)), constant_values=255)
    letters = 0.36 * bar
    put_text(framed, words, 6, (bar + letters) / 2, letters, palette.INK)
    left = 6 + text_width(words, letters) + 3 * letters
    if left + keys_width(keys, letters) <= wide:
        put_keys(framed, keys, left, bar // 2, letters)
    return framed


def _mixed(first: palette.Colour, second: palette.Colour, share: float) -> Floats:
    """A colour between two, `share` of the second."""
    return (1.0 - share) * np.array(first, np.float64) + share * np.array(second, np.float64)


def _draw_way(image: Image, grid: OccupancyGrid, track: Floats, scale: int) -> None:
    """The poses as a line, with a dot at the start and one at the end."""
    if not len(track):
        return
    cells = np.array([grid.nearest_cell(x, y) for x, y in track[:, :2].tolist()], np.float64)
    points = np.stack([cells[:, 1] + 0.5, grid.shape[0] - cells[:, 0] - 0.5], axis=1) * scale
    line = np.rint(points).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(image, [line], False, palette.ORANGE, max(1, scale // 2), cv2.LINE_AA)
    for place, colour in ((line[0, 0], palette.GREEN), (line[-1, 0], palette.ROBOT)):
        cv2.circle(image, (int(place[0]), int(place[1])), 2 * scale, colour, -1, cv2.LINE_AA)
