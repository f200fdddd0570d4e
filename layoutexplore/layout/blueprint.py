"""Blueprints and evacuation plans as occupancy grids (IAS-15, section IV-D).

Such plans show walls together with words, escape routes, equipment and door swings. Words are found by OCR
(Tesseract) and erased, symbols by their colour, by their size and thinness, and on demand by template
matching; what is left are the walls. Cells that a person could not reach from outside through a closed
envelope are the building's free space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from layoutexplore.errors import ConfigError, MapError, MissingExtraError, require
from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution
from layoutexplore.grids.ros_map import DEFAULT_RESOLUTION, read_pixels


@dataclass(frozen=True, kw_only=True)
class BlueprintConfig:
    """How a plan's picture is read; lengths in metres.

    Attributes:
        words: Whether words are found by OCR and erased (needs the `blueprint` extra and Tesseract).
        word_confidence: Least confidence of a word, in percent.
        magnification: The picture is enlarged so much for the OCR.
        darkness: A wall's grey level is below this ...
        saturation: ... and its saturation (0..255) too: symbols and escape routes are coloured.
        wall_width: Strokes thinner than this are door swings, stairs and dimension lines.
        symbol_size: Separate marks that fit into a box of this side are symbols.
        opening: Gaps up to this width in the outer walls are closed before the outside is filled.
        template_match: Least normalised correlation of a template.
    """

    words: bool = True
    word_confidence: float = 30.0
    magnification: float = 3.0
    darkness: int = 170
    saturation: int = 60
    wall_width: float = 0.1
    symbol_size: float = 1.5
    opening: float = 3.0
    template_match: float = 0.8

    def __post_init__(self) -> None:
        if not 0 < self.darkness <= 255 or not 0 <= self.saturation <= 255:
            raise ConfigError("darkness and saturation are levels of 8 bit")
        if self.magnification <= 0 or not 0 < self.template_match <= 1:
            raise ConfigError("magnification must be above 0, template_match in (0, 1]")
        if self.wall_width < 0 or self.symbol_size < 0 or self.opening < 0:
            raise ConfigError("wall_width, symbol_size and opening must not be negative")


def load_blueprint(
    path: str | Path,
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
    image = _on_paper(read_pixels(Path(path)))
    try:
        return grid_from_blueprint(image, resolution, config=config, templates=templates)
    except MapError as error:
        raise MapError(f"{path}: {error}") from error


def _on_paper(pixels: Bytes) -> Bytes:
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
    ink = _dark(plain, config)
    walls = _without_symbols(ink, resolution, config)
    if config.words:
        for top, left, height, width in find_words(plain, config):
            walls[top : top + height, left : left + width] = False
    if not walls.any():
        raise MapError(
            "the blueprint shows no walls: see darkness, saturation and wall_width of BlueprintConfig"
        )
    outside = _outside(walls, round(config.opening / resolution / 2))
    cells = np.where(walls, OCCUPIED, np.where(outside, UNKNOWN, FREE)).astype(np.int8)
    return OccupancyGrid(np.ascontiguousarray(cells[::-1]), resolution, Pose(0.0, 0.0, 0.0))


def find_words(image: Bytes, config: BlueprintConfig) -> list[tuple[int, int, int, int]]:
    """Boxes (top, left, height, width) in pixels of the words of a picture, by Tesseract.

    Raises:
        MissingExtraError: pytesseract or the program tesseract is not installed, or the program fails
            (without its language data, say).
    """
    tesseract = require("pytesseract", "blueprint")
    scale = config.magnification
    large = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    try:
        found = tesseract.image_to_data(large, config="--psm 11", output_type=tesseract.Output.DICT)
    except tesseract.TesseractNotFoundError as error:
        raise MissingExtraError(
            "the program tesseract is not installed: apt install tesseract-ocr (Debian, Ubuntu)"
        ) from error
    except tesseract.TesseractError as error:
        raise MissingExtraError(f"tesseract has failed: {' '.join(str(error.message).split())}") from error
    boxes = []
    for text, confidence, *box in zip(
        *(found[key] for key in ("text", "conf", "top", "left", "height", "width")), strict=True
    ):
        letters = sum(c.isalnum() for c in text)
        if float(confidence) >= config.word_confidence and letters >= 2:
            top, left, height, width = (v / scale for v in box)
            boxes.append((int(top), int(left), int(np.ceil(height)) + 1, int(np.ceil(width)) + 1))
    return boxes


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
    high, low = image.max(axis=2).astype(np.int16), image.min(axis=2).astype(np.int16)
    return np.asarray((high < config.darkness) & (high - low < config.saturation))


def _without_symbols(ink: Mask, resolution: float, config: BlueprintConfig) -> Mask:
    """The marks without thin strokes and without small separate ones, bool (h, w)."""
    width = max(round(config.wall_width / resolution), 1)
    thick = cv2.morphologyEx(ink.astype(np.uint8), cv2.MORPH_OPEN, np.ones((width, width), np.uint8))
    _, part, stats, _ = cv2.connectedComponentsWithStats(thick, connectivity=8)
    size = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * resolution
    large = size > config.symbol_size
    large[0] = False
    return np.asarray(large[part])


def _outside(walls: Mask, reach: int) -> Mask:
    """What the picture's border reaches once gaps of walls up to twice `reach` pixels are closed, bool."""
    padded = np.pad(walls, reach + 1).astype(np.uint8)
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    closed = cv2.dilate(padded, square)
    _, part = cv2.connectedComponents(1 - closed, connectivity=4, ltype=cv2.CV_32S)
    outside = (part == part[0, 0]) & (closed == 0)
    grown = cv2.dilate(outside.astype(np.uint8), square) > 0
    return np.asarray(grown[reach + 1 : -reach - 1, reach + 1 : -reach - 1] & ~walls)
