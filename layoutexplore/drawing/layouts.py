"""Pictures of a layout and its stages, as in the first figures of the papers; numpy and OpenCV only."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import shapely

from layoutexplore.drawing.palette import BLUE, ORANGE, VERMILLION, Colour, Image
from layoutexplore.drawing.room_fills import fills_of_rooms
from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.layout.frame import to_local
from layoutexplore.layout.types import FaceKind, Layout
from layoutexplore.options import Rule, check_kind

INK: Colour = (30, 30, 36)
PAPER: Colour = (250, 250, 250)
UNSEEN: Colour = (205, 208, 212)
LINE: Colour = VERMILLION
LOCAL: Colour = ORANGE
FACES: dict[FaceKind, Colour] = {
    FaceKind.EXTERNAL: (236, 238, 240),
    FaceKind.PARTIAL: (190, 196, 205),
    FaceKind.INTERNAL: (205, 226, 246),
}

WIDE = 1.6
"""Width over height from which the panels stand below each other."""


def draw_layout(layout: Layout, grid: OccupancyGrid | None = None, *, panel: int = 600) -> Image:
    """Overview uint8 RGB (h, w, 3), y up: map, clean map, lines, faces, rooms; in a row, or a column if wide.

    Lines: pieces of walls blue, the lines through them vermillion, orange where only parts of them are kept.
    Faces: inside blue, half-seen ones grey. Rooms: outlines of half-seen ones vermillion.

    Args:
        layout: The layout.
        grid: The grid it was made from, for the first panel and the labels; the clean grid without it.
        panel: Longer side of a panel, in pixels.
    """
    check_kind("layout", layout, Layout)
    check_kind("grid", grid, OccupancyGrid, optional=True)
    Rule(kind=int, low=16, high=16_384).convert("panel", panel)
    canvas = _Canvas(layout.clean_grid, panel)
    panels: list[tuple[str, Callable[[], Image]]] = [
        ("map", lambda: canvas.background(grid or layout.clean_grid)),
        ("clean map", lambda: canvas.background(layout.clean_grid)),
    ]
    if layout.lines or len(layout.segments):
        panels.append(("lines", lambda: _draw_lines(canvas, layout)))
    if layout.faces:
        panels.append(("faces", lambda: _draw_faces(canvas, layout)))
    panels.append(("rooms", lambda: _draw_rooms(canvas, layout, grid)))
    images = [_titled(draw(), title) for title, draw in panels]
    width, height = canvas.size
    return np.concatenate(images, axis=0 if width > WIDE * height else 1)


class _Canvas:
    """Maps the known part of a grid to a panel; pictures are drawn upside up, `finish` flips them."""

    def __init__(self, grid: OccupancyGrid, panel: int) -> None:
        known = np.argwhere(grid.cells >= 0)
        low, high = np.zeros(2, int), np.array(grid.shape)
        if len(known):
            low, high = known.min(axis=0), known.max(axis=0) + 1
        pad = 10
        self.grid = grid
        self.low = np.maximum(low - pad, 0)
        self.high = np.minimum(high + pad, grid.shape)
        rows, cols = (int(v) for v in self.high - self.low)
        self.scale = panel / max(rows, cols)
        self.size = max(round(cols * self.scale), 1), max(round(rows * self.scale), 1)

    def resize(self, image: Image) -> Image:
        shown = image[self.low[0] : self.high[0], self.low[1] : self.high[1]]
        way = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_NEAREST
        return np.ascontiguousarray(cv2.resize(np.ascontiguousarray(shown), self.size, interpolation=way))

    def background(self, grid: OccupancyGrid) -> Image:
        image = np.full((*grid.shape, 3), UNSEEN, np.uint8)
        image[grid.cells == FREE] = PAPER
        image[grid.cells > FREE] = (150, 150, 155)
        image[grid.cells == OCCUPIED] = INK
        return self.resize(image)

    def pixels(self, points: Floats) -> Ints32:
        """Pixels int32 (n, 2) with 4 fractional bits of world points (n, 2)."""
        local = to_local(points, self.grid.origin)
        at = (local / self.grid.resolution - self.low[::-1]) * self.scale - 0.5
        return np.asarray(np.rint(at * 16), np.int32)

    def line(self, image: Image, start: Floats, end: Floats, colour: Colour, width: int) -> None:
        a, b = self.pixels(np.stack((start, end))).tolist()
        cv2.line(image, a, b, colour, width, cv2.LINE_AA, 4)

    def fill(self, image: Image, polygon: shapely.Polygon, colour: Colour) -> None:
        rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
        cv2.fillPoly(image, [self.pixels(ring)[:, None] for ring in rings], colour, cv2.LINE_AA, 4)

    def outline(self, image: Image, polygon: shapely.Polygon, colour: Colour, width: int) -> None:
        for ring in (polygon.exterior, *polygon.interiors):
            corners = self.pixels(shapely.get_coordinates(ring))[:, None]
            cv2.polylines(image, [corners], True, colour, width, cv2.LINE_AA, 4)


def _draw_lines(canvas: _Canvas, layout: Layout) -> Image:
    image = canvas.background(layout.clean_grid)
    image = np.asarray(255 - (255 - image.astype(np.int16)) // 3, np.uint8)
    for line in layout.lines:
        if not line.is_border:
            colour, width = (LOCAL, 1) if line.is_local else (LINE, 1)
            canvas.line(image, np.array(line.start), np.array(line.end), colour, width)
    for x0, y0, x1, y1 in layout.segments:
        canvas.line(image, np.array((x0, y0)), np.array((x1, y1)), BLUE, 2)
    return image


def _draw_faces(canvas: _Canvas, layout: Layout) -> Image:
    image = canvas.background(layout.clean_grid)
    for face in layout.faces:
        if not face.polygon.is_empty:
            canvas.fill(image, face.polygon, FACES[face.kind])
    for face in layout.faces:
        for edge in face.edges:
            grey = round(200 - 180 * edge.weight)
            width = 1 + 2 * (edge.weight > 0.5)
            canvas.line(image, np.array(edge.start), np.array(edge.end), (grey, grey, grey), width)
    return image


def _draw_rooms(canvas: _Canvas, layout: Layout, grid: OccupancyGrid | None) -> Image:
    labels = layout.room_labels(grid)
    shown = grid or layout.clean_grid
    fills = fills_of_rooms(labels, shown.resolution)
    fills[0] = PAPER
    image = fills.take(labels, axis=0)
    image[(labels == 0) & (shown.cells < FREE)] = UNSEEN
    image[shown.cells == OCCUPIED] = INK
    image = canvas.resize(image)
    for room in layout.rooms:
        if not room.polygon.is_empty:
            canvas.outline(image, room.polygon, LINE if room.is_partial else (60, 60, 70), 1)
    return image


def _titled(image: Image, title: str) -> Image:
    """The picture flipped so that y is up, with a title bar and a margin on its right."""
    shown = np.pad(image[::-1], ((26, 0), (0, 8), (0, 0)), constant_values=255)
    cv2.putText(shown, title, (4, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.55, INK, 1, cv2.LINE_AA)
    return shown
