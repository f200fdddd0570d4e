"""Prior plans from files: floor plans of every known format, and pictures of evacuation plans."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import warnings
from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.errors import MapError, MapWarning, MissingExtraError, checks_arguments
from layoutexplore.files import naming
from layoutexplore.files.images import read_pixels
from layoutexplore.files.reading import is_file, is_there
from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.grids.ros_map import IMAGE_SUFFIXES, YAML_SUFFIXES
from layoutexplore.layout.blueprint import BlueprintConfig, channel_range, grid_from_blueprint, on_paper
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.formats.building_files import split_level
from layoutexplore.maps.library import load_plan, shows_rooms
from layoutexplore.priors.plan import (
    HINTED_SPREAD,
    LEAST_AREA,
    LONGEST,
    PriorHints,
    PriorPlan,
    check_here,
    expected_scale,
    plan_of_nothing,
    prior_of_plan,
    with_doors_to_all,
)

LONGER_SIDE = 50.0
"""Metres that the longer side of a picture's drawing is taken for until its rooms tell better."""

PICTURE_SPREAD = 0.25
"""Standard deviation of the logarithm of a scale that follows from a picture's rooms and doors, at least."""

MOST_PIXELS = 6e6
"""Pixels of a picture; larger ones are scaled down when they are read."""

READ_AGAIN, READINGS = 1.3, 2
"""A picture whose scale turns out to be wrong by more than this factor is read again with the better one, so
often at most."""

PAPER_SHARE, PAPER_LEVEL, PAPER_REACH = 0.65, 0.9, 0.05
"""A drawing is lines on paper: at least so large a share of its pixels is nearly as bright (by that ratio) as
the paper around them, within that share of the longer side; in a photo of something else, fewer are."""

PAPER_PIXELS = 3e5
"""Pixels by which paper is judged."""

PLACE_SHARE = 0.3
"""Separate walls this long, as a share of the longest, belong to the drawing; what lies outside does not."""


_FAR = 2
"""Marks on a sheet may lie so many times farther from each other than the drawing is long."""


@dataclass(frozen=True, eq=False)
class ReadPicture:
    """A prior plan from a picture.

    Attributes:
        prior: The plan.
        pixels: Metres of the plan a pixel of the picture.
        corner: Pixel (x, y) of the picture that is the plan's (0, 0), y from the top.
    """

    prior: PriorPlan
    pixels: float
    corner: tuple[float, float]


@dataclass(eq=False)
class _Sheet:
    """A picture while it is read: that its words cannot be is said once."""

    image: Bytes
    name: str
    words: bool = True


@checks_arguments
def read_prior(path: str | os.PathLike[str], hints: PriorHints | None = None) -> PriorPlan:
    """A prior plan from a floor plan (file or name), or from a picture of one.

    An image without rooms of its own is read as a blueprint or evacuation plan; its scale follows from the
    usual sizes of doors and rooms unless one is told. A plan that tells nothing comes back with the reason in
    `unused`.

    Raises:
        MapError: The file cannot be read, is no plan, or shows no walls.
    """
    hints = hints or PriorHints()
    path = os.fspath(path)
    place, _ = split_level(path)
    if place.suffix.lower() in IMAGE_SUFFIXES and is_file(place) and not shows_rooms(path):
        image = on_paper(read_pixels(place))
        try:
            return prior_of_picture(image, name=place.name, hints=hints).prior
        except MapError as error:
            raise MapError(f"{place}: {error}") from error
    plan = load_plan(path)
    with naming(place, MapError):
        prior = prior_of_plan(plan, hints)
    reason = prior.unused
    if reason and place.suffix.lower() in YAML_SUFFIXES and not shows_rooms(path):
        reason += f"; `layoutexplore maps import {place} --out PLAN.geojson` makes a plan with rooms of it"
    return dataclasses.replace(prior, name=path if is_there(place) else plan.name, unused=reason)


@checks_arguments
def prior_of_picture(image: Bytes, *, name: str = "picture", hints: PriorHints | None = None) -> ReadPicture:
    """A prior plan from a picture: words, symbols and swings erased, walls kept, rooms and doors found.

    Args:
        image: uint8 (h, w, 3) RGB, row 0 at the top.
        name: For messages.
        hints: What is told of it; a scale is metres a pixel.

    Raises:
        MapError: It shows no walls, is a photo of something else than a plan, or no picture.
        ConfigError: The robot is said to start outside of the picture.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise MapError(f"a picture needs rows, columns and three colours, got shape {image.shape}")
    hints = hints or PriorHints()
    check_here(hints, (0.0, 0.0, float(image.shape[1]), float(image.shape[0])), f"{name}, in its pixels")
    shrink = max(1.0, float(np.sqrt(image.shape[0] * image.shape[1] / MOST_PIXELS)))
    if shrink > 1:
        small = cv2.resize(image, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
        image = np.asarray(small, np.uint8)
    dark = np.argwhere(channel_range(image)[1] < BlueprintConfig().darkness)
    if not len(dark):
        raise MapError("the picture shows no walls: nothing in it is dark")
    if (share := paper_share(image)) < PAPER_SHARE:
        raise MapError(
            f"the picture shows no plan: {share:.0%} of it is paper, and of a drawing at least "
            f"{PAPER_SHARE:.0%} are; cut a photo to the plan that it shows"
        )
    told = hints.scale and hints.scale * shrink
    if told and (reason := _hopeless(*(np.ptp(dark, axis=0) + 1.0) * told)):
        return ReadPicture(plan_of_nothing(name, reason), 1.0 / shrink, (0.0, float(image.shape[0])))
    pixel = told or LONGER_SIDE / max(float(np.ptp(dark, axis=0).max()), 1.0)
    # Thin walls of a plan that is larger than it was taken for would be erased as thin strokes.
    config = BlueprintConfig(wall_width=0.0)
    sheet = _Sheet(image, name)
    drawn, corner = _drawing_of_lines(sheet, pixel) if told else _drawing(sheet, pixel, config)
    spread = HINTED_SPREAD
    if not told:
        factor, spread = expected_scale(drawn)
        # At a scale that is still wrong symbols may take walls with them: then what was read before stays.
        with contextlib.suppress(MapError):
            for _ in range(READINGS):
                if max(factor, 1 / factor) <= READ_AGAIN:
                    break
                drawn, corner = _drawing(sheet, drawn.resolution * factor, config)
                factor, spread = expected_scale(drawn)
        spread = max(spread, PICTURE_SPREAD)
        drawn = drawn.rescaled(factor, spread)
    here = hints.here
    if here is not None:
        low = image.shape[0] - corner[1]
        here = (
            (here[0] / shrink - corner[0]) * drawn.resolution,
            (here[1] / shrink - low) * drawn.resolution,
        )
    prior = dataclasses.replace(
        drawn, scale_spread=spread, hints=dataclasses.replace(hints, here=here), unused=""
    )
    place = corner[0] * shrink, corner[1] * shrink
    return ReadPicture(with_doors_to_all(prior), prior.resolution / shrink, place)


def _hopeless(height: float, width: float) -> str:
    """Why a drawing of at most so many metres cannot be a building's; empty where it may."""
    if height * width < LEAST_AREA:
        return f"all of it is {height:.2g} x {width:.2g} m at the scale that is told, and no building is"
    if max(height, width) > _FAR * LONGEST:
        return f"it is {max(height, width):.2g} m long at the scale that is told, and no building is"
    return ""


@checks_arguments
def paper_share(image: Bytes) -> float:
    """The share of a picture uint8 (h, w, 3) that is about as bright as the brightest around it, 0..1.

    Example:
        >>> paper_share(np.full((40, 40, 3), 200, np.uint8))
        1.0
    """
    if image.ndim != 3 or not image.size:
        raise MapError(f"a picture has the shape (h, w, 3), got {image.shape}")
    bright = image.max(axis=2)
    shrink = max(1.0, math.sqrt(bright.size / PAPER_PIXELS))
    small = cv2.resize(bright, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    side = max(3, round(PAPER_REACH * max(small.shape))) | 1
    # Lines are narrower than the window: what is left of them after closing is the paper beside them.
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    paper = cv2.blur(closed.astype(np.float32), (side, side))
    return float(np.mean(small >= PAPER_LEVEL * paper))


def _drawing(sheet: _Sheet, pixel: float, config: BlueprintConfig) -> tuple[PriorPlan, tuple[float, float]]:
    """The plan of a picture at that many metres a pixel, and the pixel of its lower left corner."""
    grid = _walls_of(sheet, pixel, config)
    walls = grid.cells == OCCUPIED
    rows, cols = _place_of(walls)
    cells = grid.cells[rows, cols].copy()
    if not (cells == FREE).any():
        raise MapError("the picture shows no plan: its dark lines enclose no floor")
    part = OccupancyGrid(cells, grid.resolution)
    labels = reconstruct(part, "doorways").room_labels()
    free = cells == FREE
    ids = np.where(free, labels, 0).astype(np.int32)
    prior = PriorPlan(name=sheet.name, free=free, room_ids=ids, resolution=pixel)
    return prior, (float(cols.start), float(sheet.image.shape[0] - rows.start))


def _drawing_of_lines(sheet: _Sheet, pixel: float) -> tuple[PriorPlan, tuple[float, float]]:
    """The same at a scale that is told: thin strokes are no walls, unless they are all that parts rooms."""
    with contextlib.suppress(MapError):
        found = _drawing(sheet, pixel, BlueprintConfig())
        if found[0].rooms > 1:
            return found
    return _drawing(sheet, pixel, BlueprintConfig(wall_width=0.0))


def _walls_of(sheet: _Sheet, pixel: float, config: BlueprintConfig) -> OccupancyGrid:
    """The picture as a grid; without the OCR, words are told from walls by their size alone."""
    try:
        return grid_from_blueprint(sheet.image, pixel, config=dataclasses.replace(config, words=sheet.words))
    except MissingExtraError as error:
        if not sheet.words:
            raise
        sheet.words = False
        text = f"{sheet.name}: words are erased by their size alone: {error}"
        warnings.warn(text, MapWarning, stacklevel=2)
        return _walls_of(sheet, pixel, config)


def _place_of(walls: Mask) -> tuple[slice, slice]:
    """The box of a drawing on its sheet: that of all long walls."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(walls.astype(np.uint8), connectivity=8)
    boxes = stats[1:]
    sides = np.maximum(boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT])
    long = boxes[sides >= PLACE_SHARE * sides.max()]
    left, top = long[:, cv2.CC_STAT_LEFT], long[:, cv2.CC_STAT_TOP]
    right, bottom = left + long[:, cv2.CC_STAT_WIDTH], top + long[:, cv2.CC_STAT_HEIGHT]
    return slice(int(top.min()), int(bottom.max())), slice(int(left.min()), int(right.max()))
