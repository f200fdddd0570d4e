"""Limits of what is read: sizes, depths and counts that are checked before a file is decoded.

A file may come from anybody. What a decoder would do with it (allocate an image of the size that its header
declares, descend into its lists, intersect its outlines) is bounded before it begins. The environment
variable `LAYOUTEXPLORE_LIMITS="image_pixels=4e8,file_mb=500"` raises or lowers limits by their names.
"""

from __future__ import annotations

import dataclasses
import math
import os
from dataclasses import dataclass
from functools import lru_cache

from layoutexplore.errors import ConfigError, shortened, unknown_name

VARIABLE = "LAYOUTEXPLORE_LIMITS"
"""The environment variable that changes limits."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How large the files may be that are read; each default holds the largest known public data.

    Attributes:
        file_mb: Megabytes of any file: images, archives of arrays, weights, tables.
        text_mb: Megabytes of a JSON or XML document.
        settings_mb: Megabytes of a YAML or TOML document.
        depth: Lists and tables inside each other.
        nodes: Values of a document.
        image_pixels: Pixels that an image declares, and cells that a floor plan needs. The maps that gmapping
            makes as it comes have 1.6e7, photos of usual phones 1.2e7 and a little more.
        array_mb: Megabytes of all arrays of an archive when they are unpacked.
        rooms: Rooms of a floor plan, and doors.
        room_ids: The highest number that a room may have; tables by these numbers are as long as it.
        vertices: Corners of all outlines of a floor plan, also where they are traced from an image.
        crossings: Times that outlines of a floor plan cut across themselves or each other.
        files: Files and folders in a folder that is searched for floor plans, at any depth.
    """

    file_mb: float = 256.0
    text_mb: float = 32.0
    settings_mb: float = 2.0
    depth: float = 50.0
    nodes: float = 2e6
    image_pixels: float = 2.5e7
    array_mb: float = 512.0
    rooms: float = 5e3
    room_ids: float = 1e5
    vertices: float = 2e5
    crossings: float = 1e4
    files: float = 1e5


def limits() -> Limits:
    """The limits that hold now: the defaults, and what the environment variable says.

    Raises:
        ConfigError: The variable names a limit that does not exist, or a value that is no number above 0.
    """
    return read_limits(os.environ.get(VARIABLE, ""))


@lru_cache(maxsize=8)
def read_limits(text: str) -> Limits:
    """The limits that a text `NAME=number,NAME=number` describes.

    Example:
        >>> read_limits("image_pixels=4e8, file_mb=500").image_pixels
        400000000.0
    """
    known = [field.name for field in dataclasses.fields(Limits)]
    values = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, _, number = (part.strip() for part in item.partition("="))
        if name not in known:
            raise unknown_name(f"limit in {VARIABLE}", name, known)
        try:
            values[name] = float(number)
        except ValueError:
            values[name] = math.nan
        if not values[name] > 0:
            raise ConfigError(f"{VARIABLE}: {name} must be a number above 0, got {shortened(number)}")
    return dataclasses.replace(Limits(), **values)


def raise_it(name: str, least: float) -> str:
    """What to do about something larger than a limit, for the end of a message.

    Args:
        name: The limit.
        least: What would be enough.
    """
    return f"raise it with {VARIABLE}={name}={float(f'{1.05 * least:.2g}'):g} if you trust the file"
