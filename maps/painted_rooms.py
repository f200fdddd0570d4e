"""Grid maps with painted rooms as truth: `NAME.png` beside `NAME_gt.png`."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files.images import read_pixels
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Bytes, Ints32, Mask
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import load_grid, read_image
from layoutexplore.maps.buildings import building_of

TRUTH_SUFFIX = "_gt"
FREE_FROM = 250
"""A pixel at least this bright is free (the protocol of the published tables)."""

MIN_TRUTH_CELLS = 200
"""A colour of a truth image on at most so many pixels is noise of its antialiased borders."""


@dataclass(frozen=True)
class Case:
    """A map with its truth.

    Attributes:
        folder: Name of the folder, which is the name of the set.
        name: Name of the map.
        image: The map.
        truth: The painted rooms.
        building: Maps of one building stay in one fold.
    """

    folder: str
    name: str
    image: Path
    truth: Path
    building: str


@checks_arguments
def find_cases(
    folders: Iterable[str | os.PathLike[str]], buildings: dict[str, str] | None = None
) -> list[Case]:
    """The maps of folders that have a truth, by name.

    Args:
        folders: Folders with NAME.png and NAME_gt.png.
        buildings: Building of a map by "folder/name" or "name"; else what the name tells (`building_of`),
            and the folder's name where it tells nothing.

    Raises:
        MapError: A folder is missing or holds no such pair.
    """
    cases = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise MapError(f"{folder}: no such folder")
        pairs = []
        for truth in sorted(folder.glob(f"*{TRUTH_SUFFIX}.png")):
            image = truth.with_name(truth.name.replace(f"{TRUTH_SUFFIX}.png", ".png"))
            if is_file(image):
                pairs.append((image, truth))
        if not pairs:
            raise MapError(f"{folder}: no map NAME.png with its rooms NAME{TRUTH_SUFFIX}.png")
        known = buildings or {}
        for image, truth in pairs:
            name, here = image.stem, folder.resolve().name
            building = (
                known.get(f"{here}/{name}") or known.get(name) or building_of(name, "painted rooms") or here
            )
            cases.append(Case(here, name, image, truth, building))
    return cases


@checks_arguments
def read_case(case: Case, resolution: float) -> tuple[OccupancyGrid, Ints32, Mask]:
    """The grid, the true rooms and the free cells of a map, rows from the lowest y.

    Raises:
        MapError: An image cannot be read, no room is painted, or the two differ in size.
    """
    grid = load_grid(case.image, resolution=resolution)
    pixels = read_pixels(case.truth)
    truth = truth_labels(pixels)[::-1]
    free = read_image(case.image)[0][::-1] >= FREE_FROM
    if not truth.any():
        raise MapError(
            f"{case.truth}: no room is painted; "
            f"each is one colour of 8 bit on more than {MIN_TRUTH_CELLS} pixels"
        )
    if truth.shape != grid.shape:
        raise MapError(f"{case.truth}: {truth.shape} pixels, but the map has {grid.shape}")
    return grid, np.ascontiguousarray(truth), np.ascontiguousarray(free)


def truth_labels(image: Bytes) -> Ints32:
    """Room ids of a truth image: one colour a room; black and rare colours, noise of the borders, are none.

    Args:
        image: uint8 (h, w) or (h, w, 3) or (h, w, 4); of four channels the last is ignored.

    Returns:
        int32 (h, w), 1-based by rising colour value.

    Raises:
        MapError: The image is neither grey nor colour of 8 bit.
    """
    if image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise MapError(
            f"a truth image has 8 bit and one to four channels, got {image.dtype} of shape {image.shape}"
        )
    channels = image[..., None] if image.ndim == 2 else image[..., :3]
    codes = np.zeros(image.shape[:2], np.int64)
    for k in range(channels.shape[2]):
        codes = codes * 256 + channels[..., k]
    counts = np.bincount(codes.ravel())
    rooms = counts > MIN_TRUTH_CELLS
    rooms[0] = False
    ids = np.zeros(len(counts), np.int32)
    ids[rooms] = np.arange(1, int(rooms.sum()) + 1, dtype=np.int32)
    return ids[codes]
