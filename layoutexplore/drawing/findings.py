"""A floor plan with its doors and the numbered places of what is to be corrected in it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.dashboard import put_text, text_width
from layoutexplore.drawing.palette import Image
from layoutexplore.drawing.pictures import draw_plan
from layoutexplore.errors import checks_arguments
from layoutexplore.grids.polygons import Point
from layoutexplore.importing.findings import Finding
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster

LONGEST_SIDE = 1600


@checks_arguments
def draw_findings(plan: FloorPlan, findings: Sequence[Finding] = ()) -> Image:
    """The plan, a line on every door, and a number at every finding's place.

    Args:
        plan: What to draw.
        findings: Numbered from 1 in their order.

    Returns:
        uint8 (height, width, 3) RGB, the highest y at the top.
    """
    extent = max(plan.bounds[2] - plan.bounds[0], plan.bounds[3] - plan.bounds[1])
    raster = plan.rasterize(max(0.05, round(extent / LONGEST_SIDE, 2)))
    scale = max(1, LONGEST_SIDE // max(raster.shape))
    image = np.ascontiguousarray(draw_plan(raster, scale=scale))
    for door in plan.doors:
        ends = [_pixel(raster, point, scale) for point in (door.start, door.end)]
        colour = palette.GREEN if door.is_open else palette.VERMILLION
        cv2.line(image, ends[0], ends[1], colour, 3, cv2.LINE_AA)
    for number, finding in enumerate(findings, start=1):
        x, y = _pixel(raster, (finding.x, finding.y), scale)
        cv2.circle(image, (x, y), 13, palette.VERMILLION, -1, cv2.LINE_AA)
        text = str(number)
        put_text(image, text, x - text_width(text, 9) / 2, y + 5, 9, palette.WHITE)
    return image


def _pixel(raster: PlanRaster, point: Point, scale: int) -> tuple[int, int]:
    """Column and row of a world point in the picture."""
    x = (point[0] - raster.origin.x) / raster.resolution * scale
    y = (point[1] - raster.origin.y) / raster.resolution * scale
    return round(x), round(raster.shape[0] * scale - y)
