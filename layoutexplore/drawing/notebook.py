"""What a notebook shows of a grid, a floor plan or a layout beside its text: a picture.

`layoutexplore` gives these classes their `_repr_png_`, for which notebooks ask.
"""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.drawing.palette import Image
from layoutexplore.drawing.pictures import draw_grid, draw_plan
from layoutexplore.errors import LayoutExploreError, checks_arguments
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.types import Layout
from layoutexplore.maps.floorplan import FloorPlan

LONGEST = 800
"""Pixels of the longer side of a picture; of a layout, those of each panel are half as many."""


@checks_arguments
def notebook_png(shown: OccupancyGrid | FloorPlan | Layout) -> bytes | None:
    """A picture as PNG; None of what cannot be drawn, of which a notebook then shows the text.

    Args:
        shown: What to draw.
    """
    try:
        image = _drawn(shown)
    except LayoutExploreError:  # it has too many cells, or no free space that would be seen
        return None
    _, data = cv2.imencode(".png", image[..., ::-1])
    return data.tobytes()


def _drawn(shown: OccupancyGrid | FloorPlan | Layout) -> Image:
    if isinstance(shown, Layout):
        return draw_layout(shown, panel=LONGEST // 2)
    if isinstance(shown, FloorPlan):
        x0, y0, x1, y1 = shown.bounds
        return draw_plan(shown.rasterize(max(x1 - x0, y1 - y0) / LONGEST))
    longest = max(shown.shape)
    image = draw_grid(shown, scale=max(LONGEST // longest, 1))
    if longest <= LONGEST:
        return image
    rows, cols = (max(round(side * LONGEST / longest), 1) for side in shown.shape)
    return np.asarray(cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA), np.uint8)
