"""A plan drawn as the evacuation plan that hangs on a wall: a picture with all that is not a wall on it.

Black walls on white, corridors tinted green, dashed escape routes and arrows, room numbers, door swings, red
and blue signs of equipment, "you are here", a title and a legend. What reads such pictures has to find the
walls among all this.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import scipy  # its parts are loaded where they are used

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.grids.arrays import Bytes, Floats, Ints, Ints32, Labels, Mask
from layoutexplore.grids.grid import check_resolution
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.options import Rule, check

Place = tuple[int, int]
Colour = tuple[int, int, int]

WHITE, BLACK, GREEN = (255, 255, 255), (0, 0, 0), (0, 150, 70)
TINT, RED, BLUE = (222, 243, 226), (205, 25, 30), (20, 70, 190)
SIGNS = (RED, GREEN, BLUE)
MOST_PIXELS = 200_000_000
"""What a picture may have at most: more is a mistake in the scale."""


@dataclass(frozen=True, kw_only=True)
class PictureStyle:
    """How an evacuation plan is drawn; lengths in metres of the plan.

    Attributes:
        pixels_per_metre: Scale of the picture.
        signs: Signs of equipment, a room on average.
        numbers: Whether rooms have numbers.
        routes: Whether escape routes and arrows are drawn.
        swings: Whether doors' swings are drawn, as thin arcs.
        legend: Whether there are a title and a legend.
        text: Height of letters.
        wall: Walls are drawn at least this thick.
    """

    pixels_per_metre: float = 16.0
    signs: float = 0.4
    numbers: bool = True
    routes: bool = True
    swings: bool = True
    legend: bool = True
    text: float = 0.4
    wall: float = 0.2

    def __post_init__(self) -> None:
        check(
            self,
            pixels_per_metre=Rule(low=2.0, high=200.0),
            signs=Rule(low=0.0, high=20.0),
            numbers=Rule(kind=bool),
            routes=Rule(kind=bool),
            swings=Rule(kind=bool),
            legend=Rule(kind=bool),
            text=Rule(above=0.0, high=5.0),
            wall=Rule(low=0.0, high=1.0),
        )


@checks_arguments
def draw_evacuation_plan(
    free: Mask,
    room_ids: Labels,
    resolution: float,
    rng: np.random.Generator,
    *,
    style: PictureStyle | None = None,
) -> Bytes:
    """The picture, uint8 (h, w, 3) RGB, row 0 at the top.

    Args:
        free: bool (rows, cols), floor; row 0 has the lowest y.
        room_ids: int16 or int32 (rows, cols), rooms, 0 for none.
        resolution: Metres a cell.
        rng: For places of signs.
        style: How it is drawn.

    Raises:
        MapError: Floor and rooms are no equal rasters, a room's id is below 0, the resolution is unusable,
            or the picture would have more than `MOST_PIXELS`.
    """
    check_resolution(resolution)
    if free.ndim != 2 or free.size == 0 or free.shape != room_ids.shape:
        raise MapError(f"floor {free.shape} and rooms {room_ids.shape} must be equal 2-d shapes")
    if room_ids.min() < 0:
        raise MapError(f"rooms count from 1, and 0 is none: got the id {room_ids.min()}")
    style = style or PictureStyle()
    scale = style.pixels_per_metre * resolution
    height, width = (max(1, round(n * scale)) for n in free.shape)
    if height * width > MOST_PIXELS:
        raise MapError(f"the picture would have {width} x {height} pixels: draw fewer pixels a metre")
    size, nearest = (width, height), cv2.INTER_NEAREST
    floor = np.asarray(cv2.resize(free[::-1].astype(np.uint8), size, interpolation=nearest) > 0)
    ids = cv2.resize(room_ids[::-1].astype(np.float32), size, interpolation=nearest).astype(np.int32)
    ink = _Ink(floor, ids, style)
    largest = ink.rooms[np.argsort(-ink.areas, kind="stable")]
    corridor = _corridors(floor, ids, largest, ink)
    ink.image[corridor] = TINT
    ink.walls()
    if style.swings:
        ink.swings(rng)
    if style.routes and corridor.any():
        ink.routes(corridor)
    if style.numbers:
        ink.numbers()
    ink.signs(rng)
    ink.you_are_here(ink.centre(int(largest[0])) if len(largest) else (width // 2, height // 2))
    return ink.with_legend() if style.legend else ink.image


def _corridors(floor: Mask, ids: Ints32, largest: Ints, ink: _Ink) -> Mask:
    """Floor to tint: long rooms and what belongs to none, bool (h, w)."""
    long = [room for room in largest.tolist() if ink.thinness(room) > 2.5] or largest[:1].tolist()
    return np.asarray(floor & ((ids == 0) | np.isin(ids, long)))


class _Ink:
    """A picture in the making."""

    def __init__(self, floor: Mask, ids: Ints32, style: PictureStyle) -> None:
        self.floor, self.ids, self.style = floor, ids, style
        self.unit = style.pixels_per_metre
        self.letters = style.text * self.unit / 22.0
        self.image = np.full((*floor.shape, 3), 255, np.uint8)
        counts = np.bincount(ids.ravel())
        counts[0] = 0
        self.rooms: Ints = np.flatnonzero(counts)
        self.areas: Ints = counts[self.rooms]
        self.boxes = scipy.ndimage.find_objects(ids)

    def thinness(self, room: int) -> float:
        """How long a room is for its area: 1 for a square."""
        box = self.boxes[room - 1]
        longer = max(side.stop - side.start for side in box)
        return float(longer / math.sqrt(np.count_nonzero(self.ids[box] == room)))

    def centre(self, room: int) -> Place:
        """The pixel (x, y) of a room that is farthest from its walls."""
        box = self.boxes[room - 1]
        depth = cv2.distanceTransform(np.pad(self.ids[box] == room, 1).astype(np.uint8), cv2.DIST_L2, 3)
        row, col = np.unravel_index(int(depth.argmax()), depth.shape)
        return box[1].start + int(col) - 1, box[0].start + int(row) - 1

    def walls(self) -> None:
        """Black where a wall is: solid cells near floor, the outside stays white."""
        near = max(1, round(0.3 * self.unit))
        walls: Mask = with_neighbours(self.floor, near) & ~self.floor
        # What an opening by a wall's thickness would lose is thinner, and is drawn thicker.
        side = max(1, round(self.style.wall * self.unit))
        brush = np.ones((side, side), np.uint8)
        # OpenCV's opening by an even brush moves what is left by a pixel: its dilation is not mirrored.
        back = ((side - 1) // 2,) * 2
        wide = cv2.dilate(cv2.erode(walls.astype(np.uint8), brush), brush, anchor=back)
        thin = walls & (wide == 0)
        self.image[walls | (cv2.dilate(thin.astype(np.uint8), brush) > 0)] = BLACK

    def swings(self, rng: np.random.Generator) -> None:
        """A thin quarter circle at every small piece of floor without a room: a door."""
        gaps = (self.floor & (self.ids == 0)).astype(np.uint8)
        count, _, stats, middles = cv2.connectedComponentsWithStats(gaps, connectivity=4)
        for part in range(1, count):
            if stats[part, cv2.CC_STAT_AREA] <= 1.5 * self.unit**2:
                x, y = np.rint(middles[part]).astype(int).tolist()
                start = 90.0 * float(rng.integers(4))
                cv2.ellipse(self.image, (x, y), (round(0.8 * self.unit),) * 2, 0, start, start + 90, BLACK, 1)

    def routes(self, corridor: Mask) -> None:
        """Dashed green lines along the middle of corridors, with arrow heads."""
        depth = cv2.distanceTransform(corridor.astype(np.uint8), cv2.DIST_L2, 5)
        ridge = (depth >= cv2.dilate(depth, np.ones((5, 5), np.uint8))) & (depth > 0.4 * self.unit)
        places = np.argwhere(ridge)
        step = max(1, round(1.5 * self.unit))
        _, first = np.unique(places // step, axis=0, return_index=True)
        size = max(2, round(0.35 * self.unit))
        for row, col in places[first].tolist():
            left = (int(col) - size, int(row))
            cv2.arrowedLine(
                self.image, left, (int(col) + size, int(row)), GREEN, max(1, size // 3), tipLength=0.5
            )

    def numbers(self) -> None:
        """The number of every room, in thin letters in its middle."""
        for room in self.rooms.tolist():
            x, y = self.centre(room)
            place = x - round(1.6 * self.style.text * self.unit / 2), y
            self._write(f"{100 + room}", place, self.letters)

    def _write(self, text: str, at: Place, size: float, ink: Colour = BLACK, thick: int = 1) -> None:
        cv2.putText(self.image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, ink, thick, cv2.LINE_AA)

    def signs(self, rng: np.random.Generator) -> None:
        """Coloured squares with a white mark: extinguishers, exits, first aid."""
        for room in self.rooms.tolist():
            for _ in range(rng.poisson(self.style.signs)):
                box = self.boxes[room - 1]
                cells = np.argwhere(self.ids[box] == room)
                row, col = cells[rng.integers(len(cells))].tolist()
                self._sign((box[1].start + int(col), box[0].start + int(row)), SIGNS[rng.integers(3)])

    def _sign(self, at: Place, colour: Colour) -> None:
        half = max(2, round(0.35 * self.unit))
        (x, y), arm = at, max(1, half // 2)
        cv2.rectangle(self.image, (x - half, y - half), (x + half, y + half), colour, -1)
        cv2.line(self.image, (x - arm, y), (x + arm, y), WHITE, max(1, half // 4))
        cv2.line(self.image, (x, y - arm), (x, y + arm), WHITE, max(1, half // 4))

    def you_are_here(self, at: Place) -> None:
        """A blue dot with a ring, and the words."""
        radius = max(3, round(0.45 * self.unit))
        cv2.circle(self.image, at, radius, BLUE, -1)
        cv2.circle(self.image, at, round(1.5 * radius), BLUE, max(1, radius // 4))
        self._write("You are here", (at[0] + 2 * radius, at[1]), self.letters, BLUE)

    def with_legend(self) -> Bytes:
        """The picture on its sheet: a title above, a legend below."""
        side, line = _margins(self.unit)
        margins = ((side + line, side + 5 * line), (side, side), (0, 0))
        self.image = np.pad(self.image, margins, constant_values=255)
        size, bottom = line / 32.0, self.image.shape[0] - 4 * line
        self._write("EVACUATION PLAN", (side, side), 2 * size, GREEN, 2)
        for k, (words, colour) in enumerate(
            (("Fire extinguisher", RED), ("Escape route", GREEN), ("You are here", BLUE))
        ):
            self._sign((side + line // 2, bottom + k * line), colour)
            self._write(words, (side + 2 * line, bottom + k * line + line // 4), size)
        return self.image


def _margins(unit: float) -> tuple[int, int]:
    """Pixels of a sheet's border and of a line on it, from those of a metre."""
    return round(2.0 * unit), max(14, round(1.2 * unit))


def picture_points(points: Floats, height: int, style: PictureStyle) -> Floats:
    """Pixels (x, y) float64 (n, 2) on the sheet of points of the plan (n, 2) in metres.

    Args:
        points: In metres from the plan's lower left corner.
        height: Of the plan alone, in pixels.
        style: How it was drawn.
    """
    unit = style.pixels_per_metre
    side, line = _margins(unit)
    offset = np.array([side, side + line]) if style.legend else np.zeros(2)
    return np.asarray(np.stack([points[:, 0] * unit, height - points[:, 1] * unit], axis=1) + offset)
