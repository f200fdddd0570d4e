"""Floors of the KTH campus: an occupancy image and a room instance image of 0.05 m a pixel.

`ID_occ.png` is free inside and outside of the building, `ID_rooms.png` holds a number a room and 0 elsewhere,
also in the door gaps. Indoor is what the rooms hold, plus the free gaps between them: the parts of the rooms'
closing by 0.6 m that touch two rooms, or one room and no outdoor space. Walls are drawn as two lines with a
hollow between them that is open at the doors; what a disc of 0.2 m does not fit into is such a hollow and
becomes solid.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import cv2
import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files.images import read_levels
from layoutexplore.grids.arrays import Ints32, Mask, dense_ids
from layoutexplore.grids.ros_map import read_image
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.maps.sizes import check_raster
from layoutexplore.maps.tracing import plan_from_raster

RESOLUTION = 0.05
CLOSING_RADIUS = 0.6
HOLLOW_RADIUS = 0.2
_FREE_ABOVE = 128


@checks_arguments
def load_kth(path: str | os.PathLike[str]) -> FloorPlan:
    """Read one floor from its ID_occ.png (or ID_rooms.png; both are needed).

    Raises:
        MapError: One of the images is missing or damaged, or they do not fit together.
    """
    path = Path(path)
    if not path.name:
        raise MapError(f"{path}: is a folder: name one of the images inside it")
    occ_path, rooms_path = images_of_floor(path)
    stem = occ_path.stem.removesuffix("_occ")
    grey, _ = read_image(occ_path)
    rooms = read_room_ids(rooms_path)
    if grey.shape != rooms.shape:
        raise MapError(f"{rooms_path}: {rooms.shape} pixels do not fit the {grey.shape} of {occ_path.name}")
    free = (grey > _FREE_ABOVE)[::-1]
    rooms = np.where(free, rooms[::-1], 0).astype(np.int32)
    if not rooms.any():
        raise MapError(f"{rooms_path}: no room lies in free space")
    check_raster(str(rooms_path), ~free, rooms)
    source = PlanRaster(~_indoor(free, rooms), rooms, RESOLUTION)
    return plan_from_raster(
        source,
        name=stem,
        building=building_of(stem, "kth"),
        metadata={"format": "KTH", "scale": "0.05 m a pixel"},
    )


def images_of_floor(path: Path) -> tuple[Path, Path]:
    """The image of a floor's cells and that of its rooms, given either."""
    stem = re.sub(r"_(occ|rooms)$", "", path.stem)
    return path.with_name(f"{stem}_occ{path.suffix}"), path.with_name(f"{stem}_rooms{path.suffix}")


@checks_arguments
def read_room_ids(path: str | os.PathLike[str]) -> Ints32:
    """Room numbers int32 (h, w) of an image with a level of 8 or 16 bits or a colour a room; 0 is none."""
    path = Path(path)
    pixels = read_levels(path)
    if pixels.ndim == 2:
        return pixels.astype(np.int32)
    colours = pixels[..., :3].astype(np.int32) @ np.array([1, 256, 65536])
    return dense_ids(colours).astype(np.int32)


def _indoor(free: Mask, rooms: Ints32) -> Mask:
    """Free cells of the rooms and of the gaps between them, bool (rows, cols)."""
    near = free & _morphology(rooms > 0, cv2.MORPH_CLOSE, CLOSING_RADIUS)
    outdoors = free & ~near & (rooms == 0)
    wide = _morphology(near | (rooms > 0), cv2.MORPH_OPEN, HOLLOW_RADIUS) & (rooms == 0)
    count, gaps = cv2.connectedComponents(wide.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    keep = np.zeros(count, np.bool_)
    touching = _neighbours(gaps, rooms)
    to_outdoors = set(_neighbours(gaps, outdoors.astype(np.int32)))
    for gap in range(1, count):
        neighbours = touching.get(gap, set())
        keep[gap] = len(neighbours) >= 2 or (len(neighbours) == 1 and gap not in to_outdoors)
    return np.asarray((rooms > 0) | keep[gaps], np.bool_)


def _morphology(mask: Mask, operation: int, radius: float) -> Mask:
    """Opening or closing by a disc of a radius in metres; outside the image is empty."""
    cells = round(radius / RESOLUTION)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * cells + 1, 2 * cells + 1))
    inner = slice(2 * cells, -2 * cells)
    return np.asarray(
        cv2.morphologyEx(np.pad(mask, 2 * cells).astype(np.uint8), operation, disc)[inner, inner] > 0,
        np.bool_,
    )


def _neighbours(parts: Ints32, others: Ints32) -> dict[int, set[int]]:
    """For every part above 0, which values above 0 of the other image touch it along the side of a cell."""
    found: dict[int, set[int]] = {}
    views = ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:]))
    for low, high in views:
        for here, there in ((low, high), (high, low)):
            part, other = parts[here], others[there]
            both = (part > 0) & (other > 0)
            pairs = np.unique(part[both].astype(np.int64) << 32 | other[both])  # as one number: soon sorted
            for a, b in zip((pairs >> 32).tolist(), (pairs & 0xFFFFFFFF).tolist(), strict=True):
                found.setdefault(a, set()).add(b)
    return found
