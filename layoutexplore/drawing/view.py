"""Where the cells of a grid and the points of its world lie in a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.palette import Image
from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.grids.grid import Pose
from layoutexplore.layout.frame import to_local

SHIFT = 4
"""OpenCV's fixed-point bits: shapes are placed to a sixteenth of a pixel."""


@dataclass(frozen=True)
class View:
    """Where the cells of a grid lie in a picture."""

    shape: tuple[int, int]
    size: tuple[int, int]
    scale: float
    left: float
    top: float
    resolution: float
    origin: Pose

    @classmethod
    def fit(cls, shape: tuple[int, int], size: tuple[int, int], resolution: float, origin: Pose) -> View:
        """The largest view of a grid that fits into (width, height) pixels, with a narrow border."""
        (rows, cols), (width, height) = shape, size
        border = 0.012 * width
        scale = min((width - 2 * border) / cols, (height - 2 * border) / rows)
        return cls(
            shape, size, scale, (width - cols * scale) / 2, (height - rows * scale) / 2, resolution, origin
        )

    def place(self, cells: Image) -> Image:
        """The picture (height, width, 3) of cells (rows, cols, 3) in grid order, smoothly scaled."""
        rows, cols = self.shape
        whole = max(1, math.ceil(self.scale))
        wide, high = max(1, round(cols * self.scale)), max(1, round(rows * self.scale))
        large = cells[::-1].repeat(whole, axis=0).repeat(whole, axis=1) if whole > 1 else cells[::-1]
        image = np.full((self.size[1], self.size[0], 3), palette.CANVAS, np.uint8)
        top, left = round(self.top), round(self.left)
        image[top : top + high, left : left + wide] = cv2.resize(
            large, (wide, high), interpolation=cv2.INTER_AREA
        )
        return image

    def cells(self, top: float, left: float, height: float, width: float) -> tuple[slice, slice]:
        """Rows and columns of the cells in a part of the picture, given in pixels."""
        first = (left - self.left) / self.scale
        last = self.shape[0] - (top - self.top) / self.scale
        ends = (
            (last - height / self.scale, last, self.shape[0]),
            (first, first + width / self.scale, self.shape[1]),
        )
        rows, cols = (slice(*np.clip((math.floor(a), math.ceil(b)), 0, most).tolist()) for a, b, most in ends)
        return rows, cols

    def pixels(self, points: Floats) -> Floats:
        """Pixel coordinates (x right, y down) of world points (n, 2)."""
        cells = to_local(points, self.origin) / self.resolution
        xs = self.left + self.scale * cells[:, 0]
        ys = self.top + self.scale * (self.shape[0] - cells[:, 1])
        return np.stack([xs, ys], axis=1)

    def fixed(self, points: Floats) -> Ints32:
        """The same in OpenCV's fixed-point form, shifted by half a pixel to pixel centres."""
        return np.round((self.pixels(points) - 0.5) * (1 << SHIFT)).astype(np.int32)
