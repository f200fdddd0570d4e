"""Blueprints and evacuation plans as occupancy grids (IAS-15, section IV-D).

Such plans show walls together with words, escape routes, equipment and door swings. Words are found by OCR
(Tesseract) and erased, symbols by their colour, by their size and thinness, and on demand by template
matching; what is left are the walls. Cells that a person could not reach from outside through a closed
envelope are the building's free space.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np

from layoutexplore.errors import ConfigError, MapError, MissingExtraError, checks_arguments, require
from layoutexplore.files.images import read_pixels
from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution
from layoutexplore.grids.morphology import closed_by_box, depth_inside, opened_by_box, with_neighbours
from layoutexplore.grids.outside import find_outside
from layoutexplore.grids.ros_map import DEFAULT_RESOLUTION
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.options import check_fields

_SECONDS = 60.0
"""The OCR of noise ends late or never."""

_MOST_PIXELS = 3e7
"""A picture is not enlarged further for the OCR: letters of large scans are large."""

OF_A_WORD = 0.9
"""A separate mark belongs to a word if more than this share of it lies in the word's box."""

WALL_SPREAD = 35.0
"""Grey levels by which a pixel of a wall differs from the usual wall at most."""


@dataclass(frozen=True, kw_only=True)
class BlueprintConfig:
    """How a plan's picture is read; lengths in metres.

    Attributes:
        words: Whether words are found by OCR and erased (needs the `blueprint` extra and Tesseract).
        word_confidence: Least confidence of a word, in percent.
        magnification: The picture is enlarged so much for the OCR.
        darkness: A wall's grey level is below this ...
        saturation: ... and its saturation (0..255) too: symbols and escape routes are coloured.
        wall_width: Strokes thinner than this are door swings, stairs and dimension lines ...
        wall_share: ... and so are those thinner than this share of the usual wall, for plans whose scale is
            not known well; a share of 0 leaves them.
        symbol_size: Separate marks that fit into a box of this side are symbols; words are no higher.
        tint: Dark boxes of up to that height with this colourfulness (0..1, channels' range over the
            brightest, on average) are symbols as well, even when they touch walls.
        opening: Gaps up to this width in the outer walls are closed before the outside is filled.
        keep_outside: The outside is free as well, for buildings with wider gaps.
        template_match: Least normalised correlation of a template.
    """

    words: bool = True
    word_confidence: float = 30.0
    magnification: float = 3.0
    darkness: int = 170
    saturation: int = 60
    wall_width: float = 0.1
    wall_share: float = 0.4
    tint: float = 0.25
    symbol_size: float = 1.5
    opening: float = 3.0
    keep_outside: bool = False
    template_match: float = 0.8

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 < self.darkness <= 255 or not 0 <= self.saturation <= 255:
            raise ConfigError("darkness and saturation are levels of 8 bit")
        if not 0 < self.magnification <= 10 or not 0 < self.template_match <= 1:
            raise ConfigError("magnification must be above 0 and at most 10, template_match in (0, 1]")
        if not 0 <= self.wall_share < 1 or not 0 < self.tint <= 1:
            raise ConfigError("wall_share must be in [0, 1), tint in (0, 1]")
        if self.wall_width < 0 or self.symbol_size < 0 or self.opening < 0:
            raise ConfigError("wall_width, symbol_size and opening must not be negative")


@checks_arguments
def load_blueprint(
    path: str | os.PathLike[str],
    *,
    resolution: float = DEFAULT_RESOLUTION,
    config: BlueprintConfig | None = None,
    templates: Sequence[Bytes] = (),
) -> OccupancyGrid:
    """Read a blueprint or evacuation plan as an occupancy grid; transparent pixels are paper.

    Raises:
        MapError: The file cannot be read, or it shows no walls.
        MissingExtraError: Words are to be erased and the OCR is not installed.
    """
    image = on_paper(read_pixels(Path(path)))
    try:
        return grid_from_blueprint(image, resolution, config=config, templates=templates)
    except MapError as error:
        raise MapError(f"{path}: {error}") from error


def on_paper(pixels: Bytes) -> Bytes:
    """RGB uint8 (h, w, 3) of grey or BGR pixels, those with an alpha channel laid on white."""
    channels = np.atleast_3d(pixels)
    colour = channels[..., : 1 if channels.shape[2] < 3 else 3]
    if channels.shape[2] in (2, 4):
        alpha = channels[..., -1:] / 255.0
        colour = np.rint(colour * alpha + 255 * (1 - alpha)).astype(np.uint8)
    return np.broadcast_to(colour[..., ::-1], (*colour.shape[:2], 3)).copy()


def grid_from_blueprint(
    image: Bytes, resolution: float, *, config: BlueprintConfig | None = None, templates: Sequence[Bytes] = ()
) -> OccupancyGrid:
    """The walls and the indoor space of a plan.

    Args:
        image: uint8 (h, w, 3) RGB, row 0 at the top.
        resolution: Metres a pixel.
        config: The options.
        templates: Symbols to erase, uint8 (h, w, 3) RGB each, at the scale of the image.

    Raises:
        MapError: The picture shows no walls.
        MissingExtraError: Words are to be erased and the OCR is not installed.
    """
    config = config or BlueprintConfig()
    check_resolution(resolution)
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise MapError(f"a blueprint is an RGB image of 8 bit, got {image.dtype} of shape {image.shape}")
    plain = image.copy()
    for top, left, height, width in _templates_found(image, templates, config.template_match):
        plain[top : top + height, left : left + width] = 255
    words = find_words(plain, config) if config.words else []
    ink = _dark(plain, config)
    boxes = _tinted_boxes(plain, ink, resolution, config)
    if ink.any():
        # The wall that a symbol hangs on is as bright as other walls.
        high = channel_range(plain)[1].astype(np.float32)
        ink &= ~(boxes & (np.abs(high - np.median(high[ink])) > WALL_SPREAD))
    lines = _large(ink, config.symbol_size / resolution)
    walls = _bridge(
        _without_symbols(ink, resolution, config),
        boxes,
        cells_at_most(config.symbol_size, resolution, max(ink.shape)),
    )
    walls &= ~_written(walls, [box for box in words if min(box[2:]) * resolution <= config.symbol_size])
    if not walls.any():
        raise MapError(
            f"the blueprint shows no walls: they are dark strokes of {config.wall_width:g} m and more, at "
            f"{resolution:g} m a pixel (see BlueprintConfig): is the scale right? Walls that are single "
            "lines are read where it is taken for a plain image, without --blueprint"
        )
    # A gate may be drawn as a thin line: no wall, but no way out either.
    cells = np.where(walls, OCCUPIED, FREE).astype(np.int8)
    if not config.keep_outside:
        cells[find_outside(walls | lines, resolution, opening=config.opening) & ~walls] = UNKNOWN
    return OccupancyGrid(np.ascontiguousarray(cells[::-1]), resolution, Pose(0.0, 0.0, 0.0))


def has_ocr() -> bool:
    """Whether words can be found here: pytesseract and the program tesseract are installed."""
    return bool(find_spec("pytesseract") and shutil.which("tesseract"))


@checks_arguments
def find_words(image: Bytes, config: BlueprintConfig) -> list[tuple[int, int, int, int]]:
    """Boxes (top, left, height, width) in pixels of the words of a picture, by Tesseract.

    Raises:
        MissingExtraError: pytesseract or the program tesseract is not installed, or the program fails
            (without its language data, say), or takes more than a minute.
    """
    if image.ndim not in (2, 3) or not image.size:
        raise MapError(f"a picture has the shape (h, w) or (h, w, 3), got {image.shape}")
    tesseract, pillow = require("pytesseract", "blueprint"), require("PIL.Image", "blueprint")
    pixels = image.shape[0] * image.shape[1]
    scale = min(config.magnification, max(math.sqrt(_MOST_PIXELS / pixels), 1.0))
    large = pillow.fromarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC))
    large.format = "TIFF"  # of the file that it is handed over in: to compress one takes longer
    try:
        found = tesseract.image_to_data(
            large, config="--psm 11", output_type=tesseract.Output.DICT, timeout=_SECONDS
        )
    except tesseract.TesseractNotFoundError as error:
        raise MissingExtraError(
            "the program tesseract is not installed: apt install tesseract-ocr (Debian, Ubuntu)"
        ) from error
    except tesseract.TesseractError as error:
        raise MissingExtraError(f"tesseract has failed: {' '.join(str(error.message).split())}") from error
    except RuntimeError as error:
        if "timeout" not in str(error):
            raise
        raise MissingExtraError(
            f"tesseract has found no end within {_SECONDS:g} s: is this the picture of a plan?"
        ) from error
    boxes = []
    for text, confidence, *box in zip(
        *(found[key] for key in ("text", "conf", "top", "left", "height", "width")), strict=True
    ):
        letters = sum(c.isalnum() for c in text)
        if float(confidence) >= config.word_confidence and letters >= 2:
            top, left, height, width = (v / scale for v in box)
            boxes.append((int(top), int(left), int(np.ceil(height)) + 1, int(np.ceil(width)) + 1))
    return boxes


def _written(marks: Mask, words: Sequence[tuple[int, int, int, int]]) -> Mask:
    """The separate marks that lie in boxes of words, bool (h, w); the OCR takes walls for words as well."""
    boxes = np.zeros_like(marks)
    for top, left, height, width in words:
        boxes[top : top + height, left : left + width] = True
    count, part = cv2.connectedComponents(marks.astype(np.uint8), connectivity=8)
    sizes, inside = (np.bincount(part[mask], minlength=count) for mask in (marks, marks & boxes))
    return np.asarray((inside > OF_A_WORD * sizes)[part] & marks)


def _templates_found(
    image: Bytes, templates: Sequence[Bytes], least: float
) -> list[tuple[int, int, int, int]]:
    boxes = []
    for template in templates:
        height, width = template.shape[:2]
        if height > image.shape[0] or width > image.shape[1]:
            continue
        match = cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED)
        boxes += [(int(top), int(left), height, width) for top, left in np.argwhere(match >= least)]
    return boxes


def _dark(image: Bytes, config: BlueprintConfig) -> Mask:
    """Dark pixels without colour, bool (h, w)."""
    low, high = channel_range(image)
    return np.asarray((high < config.darkness) & (high - low < config.saturation))


def channel_range(image: Bytes) -> tuple[Bytes, Bytes]:
    """The darkest and the brightest of the three channels of each pixel, uint8 (h, w).

    Example:
        >>> channel_range(np.array([[[3, 9, 5]]], np.uint8))
        (array([[3]], dtype=uint8), array([[9]], dtype=uint8))
    """
    a, b, c = (image[..., k] for k in range(3))  # NumPy is slow along an axis as short as this
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _tinted_boxes(image: Bytes, ink: Mask, resolution: float, config: BlueprintConfig) -> Mask:
    """Boxes of dark pixels with a tint, bool (h, w): symbols whose colour is too dark for `_dark`."""
    darkest, brightest = channel_range(image)
    range_, high = (np.where(ink, band, 0).astype(np.float32) for band in (brightest - darkest, brightest))
    longest = max(ink.shape)
    side = cells_at_most(0.25, resolution, longest) | 1
    count, tint, brightness = (
        cv2.blur(band, (side, side)) for band in (ink.astype(np.float32), range_, high)
    )
    # Near black the ratio is noise.
    tinted = ink & (brightness > 0.15 * 255 * count) & (tint > config.tint * brightness)
    box = max(cells_at_most(config.symbol_size / 4, resolution, longest), 2)
    # Light glyphs stand in dark boxes; walls and letters are thinner than a box.
    wide = opened_by_box(closed_by_box(tinted, box, box), 2 * box, 2 * box)
    _, part, stats, _ = cv2.connectedComponentsWithStats(wide.view(np.uint8), connectivity=8)
    low = (
        np.minimum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * resolution
        <= config.symbol_size
    )
    low[0] = False
    return with_neighbours(low[part])


def _bridge(walls: Mask, boxes: Mask, length: int) -> Mask:
    """The walls, and what is behind symbols in line with walls on both sides, bool (h, w)."""
    for shape in ((1, length // 3 + 1), (length // 3 + 1, 1)):
        strokes = opened_by_box(walls, *shape)
        # Several symbols stand in a row.
        rows, cols = (1 if side == 1 else 4 * length for side in shape)
        walls = walls | (closed_by_box(strokes, rows, cols) & boxes)
    return walls


def _without_symbols(ink: Mask, resolution: float, config: BlueprintConfig) -> Mask:
    """The marks without thin strokes and without small separate ones, bool (h, w)."""
    usual = _usual_width(_large(ink, config.symbol_size / resolution))
    least = cells_at_most(config.wall_width, resolution, max(ink.shape) + 1)
    width = max(least, round(config.wall_share * usual))
    return _large(opened_by_box(ink, width, width), config.symbol_size / resolution)


def _usual_width(ink: Mask) -> float:
    """The width in pixels of the strokes that most of the ink belongs to; 0 without ink.

    Along the middle of a stroke the distance to paper is half its width: those of all middles are weighed by
    the area that they stand for.
    """
    if not ink.any():
        return 0.0
    depth = depth_inside(ink)
    middles = depth[(depth > 0) & (depth >= cv2.dilate(depth, np.ones((3, 3), np.uint8)))]
    order = np.sort(middles)
    return float(2 * order[np.searchsorted(np.cumsum(order), order.sum() / 2)] - 1)


def _large(marks: Mask, side: float) -> Mask:
    """The separate marks, bool (h, w), that do not fit into a square of a side in pixels."""
    _, part, stats, _ = cv2.connectedComponentsWithStats(marks.astype(np.uint8), connectivity=8)
    large = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) > side
    large[0] = False
    return np.asarray(large[part])
