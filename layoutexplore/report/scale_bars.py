"""Scale bars of maps: a round length, in the corner of the picture where it hides least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.grids.arrays import Floats

LETTER, INSET, HIGH = 7.0, 6.0, 24.0
"""Pixels of the page: width of a letter of the label, margin inside the bar's box, and height of that."""

AWAY = 2.0
"""Pixels between the box and the edges of the picture."""


@dataclass(frozen=True)
class ScaleBar:
    """A length on a map: its label, and its width in cells of the picture."""

    label: str
    width: float


def scale_bar(cols: int, resolution: float) -> ScaleBar:
    """A round length of about a fifth of a picture's width.

    Args:
        cols: Width of the picture in cells.
        resolution: Metres per cell.

    Example:
        >>> scale_bar(400, 0.1)
        ScaleBar(label='5 m', width=50.0)
    """
    steps = [base * 10**power for power in range(-1, 4) for base in (1, 2, 5)]
    metres = max((step for step in steps if step <= 0.22 * cols * resolution), default=steps[0])
    return ScaleBar(f"{metres:g} m", round(metres / resolution, 2))


@dataclass(frozen=True)
class PlacedScaleBar(ScaleBar):
    """A scale bar in a corner of its picture, in cells.

    Attributes:
        x, y: The box's left and upper edge, from the upper left corner of the picture.
        wide, high: Size of the box.
        pixel: A pixel of the page.
    """

    x: float
    y: float
    wide: float
    high: float
    pixel: float


def place_scale_bar(bar: ScaleBar, weight: Floats, shown: tuple[float, float]) -> PlacedScaleBar:
    """The bar in the corner where its box covers the least weight; below on the left where all are alike.

    Args:
        bar: The bar.
        weight: float64 (rows, cols), what it would be a pity to cover, the top row of the picture first.
        shown: The most pixels of the page that the picture has, in width and in height.

    Example:
        Only the corner below on the right is empty:

        >>> weight = np.ones((100, 100))
        >>> weight[50:, 50:] = 0.0
        >>> found = place_scale_bar(ScaleBar("5 m", 20.0), weight, (400.0, 400.0))
        >>> found.x, found.y, found.wide, found.high
        (76.5, 93.5, 23.0, 6.0)
    """
    rows, cols = weight.shape
    pixel = max(cols / shown[0], rows / shown[1])
    wide = max(bar.width, LETTER * pixel * len(bar.label)) + 2.0 * INSET * pixel
    high, away = HIGH * pixel, AWAY * pixel
    corners = [(x, y) for y in (rows - high - away, away) for x in (away, cols - wide - away)]
    covered = [
        float(weight[max(int(y), 0) : int(y + high) + 1, max(int(x), 0) : int(x + wide) + 1].sum())
        for x, y in corners
    ]
    x, y = corners[int(np.argmin(covered))]
    x, y, wide, high = (round(size, 2) for size in (x, y, wide, high))
    return PlacedScaleBar(bar.label, bar.width, x, y, wide, high, round(pixel, 4))
