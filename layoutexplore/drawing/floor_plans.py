"""A floor plan as a sheet to read: the building alone, its rooms numbered, its doors, and a scale bar."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.dashboard import put_text, text_width
from layoutexplore.drawing.palette import Colour, Image
from layoutexplore.drawing.pictures import draw_plan
from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import in_cells
from layoutexplore.grids.morphology import depth_inside
from layoutexplore.grids.polygons import Point
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.sizes import windows
from layoutexplore.options import Rule

LONGEST_SIDE = 1600
"""Pixels of the building's longer side, about."""

SMALLEST_CELL = 0.02
"""Metres a cell of small plans."""

MARGIN = 0.5
"""Metres of the walls around the building that are shown."""

BORDER = 22
"""Empty pixels around it."""

CAPTION = 34
"""Pixels of the strip below it."""

OPEN_DOOR: Colour = palette.GREEN
CLOSED_DOOR: Colour = palette.PURPLE

BAR_LENGTHS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""Metres of a scale bar: the longest that takes at most `WIDEST_BAR` pixels."""

WIDEST_BAR = 170

NUMBER_HEIGHTS = (13.0, 11.0, 9.5, 8.0)
"""Pixels of the digits of a room: the first that fits into it."""

_RESOLUTION = Rule(above=0.0)

Box = tuple[float, float, float, float]
"""Left, top, right and bottom in pixels."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A drawn floor plan that more is to be drawn on.

    Attributes:
        image: uint8 (height, width, 3) RGB, the highest y at the top.
        left: World x of the left edge of the image in metres.
        top: World y of its upper edge.
        metre: Pixels a metre.
        doors: Boxes of the doors.
        numbers: Boxes of the numbers of rooms.
    """

    image: Image
    left: float
    top: float
    metre: float
    doors: tuple[Box, ...] = ()
    numbers: tuple[Box, ...] = ()

    def pixel(self, point: Point) -> Point:
        """Column and row of a world point."""
        return (point[0] - self.left) * self.metre, (self.top - point[1]) * self.metre


@checks_arguments
def draw_sheet(plan: FloorPlan, resolution: float | None = None) -> Sheet:
    """The building with its rooms numbered as in its plan, open and closed doors, and a scale bar.

    Args:
        plan: What to draw.
        resolution: Metres a cell; what suits the plan's size when None.
    """
    if resolution is not None:
        _RESOLUTION.convert("resolution", resolution)
    raster = plan.rasterize(resolution or _suitable_resolution(plan))
    rows, cols = _building(raster)
    scale = max(1, round(LONGEST_SIDE / max(rows.stop - rows.start, cols.stop - cols.start)))
    drawn = draw_plan(raster)[raster.shape[0] - rows.stop : raster.shape[0] - rows.start, cols]
    drawn = drawn.repeat(scale, axis=0).repeat(scale, axis=1)
    shape = drawn.shape[0] + 2 * BORDER + CAPTION, drawn.shape[1] + 2 * BORDER, 3
    image = np.full(shape, palette.CANVAS, np.uint8)
    image[BORDER : BORDER + drawn.shape[0], BORDER : BORDER + drawn.shape[1]] = drawn
    metre = scale / raster.resolution
    left = raster.origin.x + cols.start * raster.resolution - BORDER / metre
    top = raster.origin.y + rows.stop * raster.resolution + BORDER / metre
    sheet = Sheet(image, left, top, metre)
    doors, numbers = _draw_doors(sheet, plan), _draw_numbers(sheet, plan, raster)
    _draw_caption(sheet, plan)
    return replace(sheet, doors=tuple(doors), numbers=tuple(numbers))


def _suitable_resolution(plan: FloorPlan) -> float:
    """Metres a cell: about a pixel each, or those of the plan's own raster where they are not too many."""
    x0, y0, x1, y1 = plan.bounds
    pixel = max(x1 - x0, y1 - y0) / LONGEST_SIDE
    if plan.source is not None and plan.source.resolution >= 0.5 * pixel:
        return plan.source.resolution
    return max(SMALLEST_CELL, round(pixel, 3))


def _building(raster: PlanRaster) -> tuple[slice, slice]:
    """The rows and columns of the free cells with a margin."""
    return window(raster.free, in_cells(MARGIN, raster.resolution))


def _draw_doors(sheet: Sheet, plan: FloorPlan) -> list[Box]:
    """A thin line across each open door and a thick one over each closed one; the boxes of all."""
    boxes = []
    for door in plan.doors:
        (x0, y0), (x1, y1) = sheet.pixel(door.start), sheet.pixel(door.end)
        colour, width = (OPEN_DOOR, 3) if door.is_open else (CLOSED_DOOR, 5)
        ends = [(round(x * 16), round(y * 16)) for x, y in ((x0, y0), (x1, y1))]
        cv2.line(sheet.image, ends[0], ends[1], colour, width, cv2.LINE_AA, 4)
        boxes.append((min(x0, x1) - 2, min(y0, y1) - 2, max(x0, x1) + 2, max(y0, y1) + 2))
    return boxes


def _draw_numbers(sheet: Sheet, plan: FloorPlan, raster: PlanRaster) -> list[Box]:
    """The id of each room in its widest part, where it fits; the boxes of the numbers."""
    boxes = []
    cell = sheet.metre * raster.resolution
    known = {room.id for room in plan.rooms}
    for room, (rows, cols) in windows(plan.name, raster.room_ids.astype(np.int32)):
        if room not in known:
            continue
        row, col, depth = _widest(raster.free[rows, cols] & (raster.room_ids[rows, cols] == room))
        x, y = sheet.pixel(raster.cell_to_world(rows.start + row, cols.start + col))
        for height in NUMBER_HEIGHTS:
            width = text_width(str(room), height)
            if np.hypot(width, height) / 2 + 1 <= depth * cell:
                put_text(sheet.image, str(room), x - width / 2, y + height / 2, height, palette.ROOM_NUMBER)
                boxes.append((x - width / 2, y - height / 2, x + width / 2, y + height / 2))
                break
    return boxes


def _widest(mask: Mask) -> tuple[int, int, float]:
    """Of the cells (row, col) about as far from the rim as any the one nearest to the middle, and how far."""
    depth = depth_inside(mask)
    far = np.argwhere(depth >= 0.95 * depth.max())
    middle = (np.array(mask.shape) - 1) / 2
    row, col = far[int(np.abs(far - middle).sum(axis=1).argmin())].tolist()
    return row, col, float(depth[row, col])


def _draw_caption(sheet: Sheet, plan: FloorPlan) -> None:
    """A scale bar and what the doors' colours mean, in the strip below the building."""
    image = sheet.image
    line = image.shape[0] - CAPTION // 2 - 6
    lengths = [length for length in BAR_LENGTHS if length * sheet.metre <= WIDEST_BAR] or [BAR_LENGTHS[0]]
    right = BORDER + round(lengths[-1] * sheet.metre)
    cv2.line(image, (BORDER, line), (right, line), palette.INK, 2)
    for x in (BORDER, right):
        cv2.line(image, (x, line - 5), (x, line + 5), palette.INK, 2)
    x = right + 10 + put_text(image, f"{lengths[-1]:g} m", right + 10, line + 5, 10, palette.INK)
    kinds = {door.is_open for door in plan.doors}
    for is_open, colour, name in ((True, OPEN_DOOR, "door"), (False, CLOSED_DOOR, "closed door")):
        end = x + 64 + text_width(name, 10)
        if is_open in kinds and end < image.shape[1]:
            cv2.line(image, (x + 30, line), (x + 54, line), colour, 3 if is_open else 5, cv2.LINE_AA)
            put_text(image, name, x + 64, line + 5, 10, palette.INK)
            x = end
