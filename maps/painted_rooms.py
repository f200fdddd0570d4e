"""Grid maps with painted rooms as truth: `NAME.png` beside `NAME_gt.png`.

An `index.csv` in their folder may give the scale of each (`file`, `m_per_px`).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError, checks_arguments, shortened
from layoutexplore.files import read_csv
from layoutexplore.files.images import Levels, read_levels
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Ints32, Mask
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import RESOLUTIONS, load_grid, read_image
from layoutexplore.maps.buildings import building_of

TRUTH_SUFFIX = "_gt"
INDEX = "index.csv"
"""Table beside maps that may give their scales."""

FREE_FROM = 250
"""A pixel at least this bright is free (the protocol of the published tables)."""

MIN_TRUTH_CELLS = 200
"""A colour of a truth image on at most so many pixels is noise of its antialiased borders."""


@dataclass(frozen=True)
class Case:
    """A map with its truth.

    Attributes:
        folder: Name of the folder, which is the name of the set; with those above it where two have one name.
        name: Name of the map.
        image: The map.
        truth: The painted rooms.
        building: Maps of one building stay in one fold.
        resolution: Metres a pixel by the folder's index; None where it says nothing.
        is_guess: Neither a table nor the map's name tells the building, and the folder stands for it.
    """

    folder: str
    name: str
    image: Path
    truth: Path
    building: str
    resolution: float | None = None
    is_guess: bool = False


@checks_arguments
def find_cases(
    folders: Iterable[str | os.PathLike[str]], buildings: dict[str, str] | None = None
) -> list[Case]:
    """The maps of folders that have a truth, by name; a folder that is named twice counts once.

    Maps with the same pixels are of one building, whatever they are called.

    Args:
        folders: Folders with NAME.png and NAME_gt.png; an `index.csv` inside may give `file` and `m_per_px`.
        buildings: Building of a map by "folder/name" or "name"; else what the name tells (`building_of`),
            and the folder's name where it tells nothing.

    Raises:
        MapError: A folder is missing or holds no such pair, or an index cannot be read. (What is wrong with a
            map says `read_case`.)
    """
    found: dict[Path, list[tuple[Path, Path]]] = {}
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
        found.setdefault(folder.resolve(), pairs)
    cases = []
    for here, (folder, pairs) in zip(_told_apart([*found]), found.items(), strict=True):
        scales = read_scales(folder / INDEX, [image.name for image, _ in pairs])
        for image, truth in pairs:
            name, known = image.stem, buildings or {}
            names = (f"{here}/{name}", f"{folder.name}/{name}", name)
            building = next((known[n] for n in names if known.get(n)), "") or building_of(
                name, "painted rooms"
            )
            scale = scales.get(image.name)
            cases.append(Case(here, name, image, truth, building or here, scale, is_guess=not building))
    return _united(cases)


def _told_apart(folders: Sequence[Path]) -> list[str]:
    """The name of each folder, with as many of those above it as tell it from others of its name."""
    names = []
    for folder in folders:
        alike = [other.parts for other in folders if other.name == folder.name]
        depth = 1
        while len({parts[-depth:] for parts in alike}) < len(alike):
            depth += 1
        names.append("/".join(folder.parts[-depth:]))
    return names


def _united(cases: Sequence[Case]) -> list[Case]:
    """The cases, those of two buildings that share a picture in one; a name that is told stays."""
    known = {case.building for case in cases if not case.is_guess}
    same = {case.building: case.building for case in cases}

    def whole(building: str) -> str:
        while same[building] != building:
            building = same[building]
        return building

    of_picture: dict[bytes, str] = {}
    for case in cases:
        first, second = whole(of_picture.setdefault(_digest(case.image), case.building)), whole(case.building)
        if first not in known and second in known:
            first, second = second, first
        same[second] = first
    return [replace(case, building=whole(case.building)) for case in cases]


def _digest(image: Path) -> bytes:
    """Of the grey levels of an image; of one that cannot be read, of its path."""
    try:
        grey = read_image(image)[0]
    except MapError:
        return os.fsencode(image)
    return hashlib.sha256(repr(grey.shape).encode() + grey.tobytes()).digest()


@checks_arguments
def read_scales(index: Path, names: Collection[str]) -> dict[str, float]:
    """Metres a pixel by the name of the file, as far as an index of maps says it; nothing without an index.

    Args:
        index: CSV with the columns `file` and `m_per_px`, which may be empty; one of other columns says none.
        names: Of the files that are asked for.

    Raises:
        MapError: It cannot be read, or a scale that is asked for is none.
    """
    if not is_file(index):
        return {}
    header, *lines = read_csv(index, error=MapError, what="index of maps") or [[]]
    columns = [column.strip().lower() for column in header]
    if not {"file", "m_per_px"} <= {*columns}:
        return {}
    name, scale = columns.index("file"), columns.index("m_per_px")
    out = {}
    for line in lines:
        cells = [cell.strip() for cell in line]
        if len(cells) <= name or cells[name] not in names or not "".join(cells[scale : scale + 1]):
            continue
        try:
            out[cells[name]] = float(cells[scale])
        except ValueError:
            told = shortened(cells[scale])
            raise MapError(f"{index}: m_per_px of {cells[name]} is no number: {told}") from None
        if not RESOLUTIONS[0] <= out[cells[name]] <= RESOLUTIONS[1]:
            raise MapError(
                f"{index}: m_per_px of {cells[name]} must be from {RESOLUTIONS[0]:g} to {RESOLUTIONS[1]:g}"
            )
    return out


@checks_arguments
def read_case(case: Case, resolution: float) -> tuple[OccupancyGrid, Ints32, Mask]:
    """The grid, the true rooms and the free cells of a map, rows from the lowest y.

    Args:
        case: The map.
        resolution: Metres a pixel where the map's folder does not say it.

    Raises:
        MapError: An image cannot be read, no room is painted, or the two differ in size.
    """
    grid = load_grid(case.image, resolution=case.resolution or resolution)
    truth = truth_labels(read_levels(case.truth))[::-1]
    if not truth.any():
        raise MapError(
            f"{case.truth}: no room is painted; each is one colour of 8 bit on more than {MIN_TRUTH_CELLS} "
            "pixels, or a grey level of 16 bit"
        )
    if truth.shape != grid.shape:
        raise MapError(f"{case.truth}: {truth.shape} pixels, but the map has {grid.shape}")
    free = read_image(case.image)[0][::-1] >= FREE_FROM
    return grid, np.ascontiguousarray(truth), np.ascontiguousarray(free)


@checks_arguments
def check_bright(case: Case, grid: OccupancyGrid, free: Mask) -> None:
    """Raise `MapError` where most of a map's free space is darker than what counts as free in scores."""
    counted, known = (int(np.count_nonzero(mask)) for mask in (free & grid.free, grid.free))
    if 2 * counted < max(known, 1):
        raise MapError(
            f"{case.image}: a pixel counts as free from grey {FREE_FROM} on, and only {counted} of {known} "
            "free ones are that bright: paint free space 254, occupied 0 and unknown 205"
        )


def truth_labels(image: Levels) -> Ints32:
    """Room ids of a truth image: one colour a room; black and rare colours, noise of the borders, are none.

    Args:
        image: uint8 or uint16 (h, w) or (h, w, 3) or (h, w, 4); of four channels the last is ignored. Grey
            levels of 16 bit are numbers of rooms, however small; of colours of 16 bit the upper eight count.

    Returns:
        int32 (h, w), 1-based by rising colour value.

    Raises:
        MapError: The image is neither grey nor colour of 8 or 16 bit.
    """
    if image.dtype not in (np.uint8, np.uint16) or image.ndim not in (2, 3):
        raise MapError(
            "a truth image has 8 or 16 bit and one to four channels, "
            f"got {image.dtype} of shape {image.shape}"
        )
    # Levels that are all multiples of 257 are those of 8 bit, written with 16.
    is_numbered = image.dtype == np.uint16 and image.ndim == 2 and bool((image % 257).any())
    if image.dtype == np.uint16 and not is_numbered:
        image = image // 257
    channels = image[..., None] if image.ndim == 2 else image[..., :3]
    codes = np.zeros(image.shape[:2], np.int64)
    for k in range(channels.shape[2]):
        codes = codes * 256 + channels[..., k]
    counts = np.bincount(codes.ravel())
    rooms = counts > (0 if is_numbered else MIN_TRUTH_CELLS)
    rooms[0] = False
    ids = np.zeros(len(counts), np.int32)
    ids[rooms] = np.arange(1, int(rooms.sum()) + 1, dtype=np.int32)
    return ids[codes]
