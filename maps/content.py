"""What tells floor plans apart: digests of what they hold, whatever they are called."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from layoutexplore.maps.raster import PlanRaster


def geometry_digest(
    rooms: Iterable[Any], doors: Iterable[Any], shapes: Iterable[BaseGeometry], source: PlanRaster | None
) -> str:
    """SHA-256 (hex) of the geometry to 0.1 mm: of rooms by their ids, of doors, and of further shapes.

    Seeds and the hashes of released suites follow from it: it never changes.
    """
    digest = hashlib.sha256()
    for room in sorted(rooms, key=lambda room: int(room.id)):
        digest.update(b"room" + _fingerprint(room.polygon))
    for door in doors:
        digest.update(f"door {door.is_open}".encode() + _fingerprint(LineString([door.start, door.end])))
    for shape in shapes:
        digest.update(b"shape" + _fingerprint(shape))
    if source is not None:
        digest.update(
            repr((source.shape, source.resolution)).encode() + np.packbits(source.occupied).tobytes()
        )
    return digest.hexdigest()


def raster_digest(
    geometry: str, rooms: Iterable[Any], doors: Iterable[Any], source: PlanRaster | None
) -> str:
    """SHA-256 (hex) of what rasters of a plan depend on.

    Args:
        geometry: The digest of its geometry.
        rooms: Their ids stand in the cells.
        doors: How deep an opening cuts depends on the rooms of its door.
        source: Its ids and its origin count, too.
    """
    ids = sorted(int(room.id) for room in rooms)
    pairs = [sorted(int(room) for room in door.rooms) for door in doors]
    digest = hashlib.sha256(repr((geometry, ids, pairs)).encode())
    if source is not None:
        digest.update(repr([float(value) for value in source.origin]).encode())
        digest.update(np.ascontiguousarray(source.room_ids, np.int32).tobytes())
    return digest.hexdigest()


def _fingerprint(shape: BaseGeometry) -> bytes:
    rounded = shapely.transform(shape, lambda points: np.round(points, 4) + 0.0)
    return bytes(shapely.to_wkb(shapely.normalize(rounded)))
