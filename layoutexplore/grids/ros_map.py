"""Occupancy grids on disk: ROS map_server pairs (YAML and image) and plain images.

Reading follows nav2's map_server: trinary, scale and raw modes, `negate`, thresholds, an origin with a yaw,
transparent pixels as unknown; the image's top row is the largest y. Images without a YAML go through
`layoutexplore.grids.image_map`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from layoutexplore.errors import MapError
from layoutexplore.files import write_atomically
from layoutexplore.grids.arrays import Bytes, Cells, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution
from layoutexplore.grids.image_map import grid_from_image

__all__ = ["DEFAULT_RESOLUTION", "grid_from_image", "load_grid", "read_image", "save_grid"]

DEFAULT_RESOLUTION = 0.05
"""Metres a pixel of a plain image for which no resolution is given: that of most published grid maps."""

MODES = ("trinary", "scale", "raw")
IMAGE_SUFFIXES = (".png", ".pgm", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
YAML_SUFFIXES = (".yaml", ".yml")
_OCCUPIED_THRESHOLD, _FREE_THRESHOLD = 0.65, 0.196


def load_grid(path: str | Path, *, resolution: float | None = None) -> OccupancyGrid:
    """Read an occupancy grid.

    Args:
        path: A ROS map's YAML file, or an image.
        resolution: Metres a pixel of a plain image (0.05 when None). A YAML brings its own.

    Raises:
        MapError: The file is missing, broken, of an unknown kind, or its numbers make no sense.
    """
    path = Path(path)
    if resolution is not None:
        check_resolution(resolution)
    if path.suffix.lower() in YAML_SUFFIXES:
        return _load_ros_map(path)
    grey, transparent = read_image(path, luma=True)
    return grid_from_image(
        grey, DEFAULT_RESOLUTION if resolution is None else resolution, transparent=transparent
    )


def read_image(path: Path, *, luma: bool = False) -> tuple[Bytes, Mask]:
    """Grey levels uint8 (h, w) and which pixels are not opaque, bool (h, w), of an image of any kind.

    Args:
        path: The image.
        luma: Weigh colours as the eye does; otherwise average the channels, as map_server does.
    """
    pixels = read_pixels(path)
    transparent = np.zeros(pixels.shape[:2], np.bool_)
    if pixels.ndim == 2:
        return pixels, transparent
    if pixels.shape[2] in (2, 4):
        transparent = pixels[..., -1] < 255
        pixels = pixels[..., :-1]
    weights = (
        np.array([0.114, 0.587, 0.299])
        if luma and pixels.shape[2] == 3
        else np.full(pixels.shape[2], 1 / pixels.shape[2])
    )
    return np.rint(pixels @ weights).astype(np.uint8), transparent


def read_pixels(path: Path) -> Bytes:
    """The pixels uint8 (h, w) or (h, w, channels) of an image file as they are stored.

    Raises:
        MapError: The file is missing or cannot be decoded.
    """
    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise MapError(f"{path}: cannot read the image: {error.strerror}") from error
    level = cv2.utils.logging.setLogLevel(0)  # a damaged image is our error to report, not OpenCV's
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:
        pixels = None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if pixels is None:
        raise MapError(f"{path}: not an image, or a damaged one")
    if pixels.dtype == np.uint16:
        pixels = (pixels // 257).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise MapError(f"{path}: images of {pixels.dtype} pixels are not supported; use 8 or 16 bits")
    return np.asarray(pixels, np.uint8)


@dataclass(frozen=True, kw_only=True)
class _RosMap:
    """The entries of a map's YAML, checked."""

    image: Path
    resolution: float
    origin: Pose
    negate: bool = False
    occupied_thresh: float = _OCCUPIED_THRESHOLD
    free_thresh: float = _FREE_THRESHOLD
    mode: str = "trinary"


def _load_ros_map(path: Path) -> OccupancyGrid:
    entries = _parse(path)
    pixels, transparent = read_image(entries.image)
    shade = pixels[::-1].astype(np.float64) / 255.0
    if entries.mode == "raw":
        values = pixels[::-1].astype(np.int16)
        cells = np.where(values <= OCCUPIED, values, UNKNOWN)
    else:
        occupancy = shade if entries.negate else 1.0 - shade
        low, high = entries.free_thresh, entries.occupied_thresh
        between = np.rint((occupancy - low) / (high - low) * 100) if entries.mode == "scale" else UNKNOWN
        cells = np.where(occupancy >= high, OCCUPIED, np.where(occupancy <= low, FREE, between))
        cells = np.where(transparent[::-1], UNKNOWN, cells)
    return OccupancyGrid(np.ascontiguousarray(cells.astype(np.int8)), entries.resolution, entries.origin)


def _parse(path: Path) -> _RosMap:
    """The YAML's entries, or a `MapError` that names the entry that is wrong."""
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MapError(f"{path}: cannot read the map: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapError(f"{path}: broken YAML: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict):
        raise MapError(f"{path}: a map's YAML needs the entries image, resolution and origin")
    if missing := [key for key in ("image", "resolution", "origin") if key not in data]:
        raise MapError(f"{path}: the entry {missing[0]!r} is missing")
    origin = data["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapError(f"{path}: origin must be [x, y, yaw], got {origin!r}")
    mode = data.get("mode", "trinary")
    if mode not in MODES:
        raise MapError(f"{path}: mode must be one of {', '.join(MODES)}, got {mode!r}")
    entries = _RosMap(
        image=path.parent / str(data["image"]),
        resolution=_number(data["resolution"], "resolution", path),
        origin=Pose(*(_number(value, "origin", path) for value in origin)),
        negate=bool(_number(data.get("negate", 0), "negate", path)),
        occupied_thresh=_number(data.get("occupied_thresh", _OCCUPIED_THRESHOLD), "occupied_thresh", path),
        free_thresh=_number(data.get("free_thresh", _FREE_THRESHOLD), "free_thresh", path),
        mode=mode,
    )
    if entries.resolution <= 0:
        raise MapError(f"{path}: resolution must be above 0, got {entries.resolution:g}")
    if not 0 <= entries.free_thresh < entries.occupied_thresh <= 1:
        raise MapError(f"{path}: needs 0 <= free_thresh < occupied_thresh <= 1")
    return entries


def _number(value: Any, name: str, path: Path) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise MapError(f"{path}: {name} must be a finite number, got {value!r}")
    return number


def save_grid(grid: OccupancyGrid, path: str | Path, *, mode: str = "trinary") -> None:
    """Write a ROS map: NAME.yaml beside NAME.pgm (trinary) or NAME.png (scale, raw).

    Scale and raw keep every value from 0 to 100; trinary keeps free (up to 19), occupied (from 65) and
    unknown. Each file appears whole or not at all.

    Args:
        grid: What to write.
        path: NAME.yaml or NAME.
        mode: "trinary", "scale" or "raw".

    Raises:
        MapError: The mode is not known, or the files cannot be written.
    """
    if mode not in MODES:
        raise MapError(f"mode must be one of {', '.join(MODES)}, got {mode!r}")
    path = Path(path)
    if path.suffix.lower() not in YAML_SUFFIXES:
        path = path.with_name(path.name + ".yaml")
    image = path.with_suffix(".pgm" if mode == "trinary" else ".png")
    text = {
        "image": image.name,
        "mode": mode,
        "resolution": float(grid.resolution),
        "origin": [float(value) for value in grid.origin],
        "negate": 0,
        "occupied_thresh": 1.0 if mode == "scale" else _OCCUPIED_THRESHOLD,
        "free_thresh": 0.0 if mode == "scale" else _FREE_THRESHOLD,
    }
    _, encoded = cv2.imencode(image.suffix, _to_pixels(grid.cells[::-1], mode))
    write_atomically(image, encoded.tobytes())
    write_atomically(path, yaml.safe_dump(text, sort_keys=False, default_flow_style=None).encode())


def _to_pixels(cells: Cells, mode: str) -> Bytes:
    if mode == "raw":
        return np.where(cells == UNKNOWN, 255, cells).astype(np.uint8)
    if mode == "scale":
        grey = np.rint((100 - np.maximum(cells, 0).astype(np.float64)) * 2.55).astype(np.uint8)
        opaque = np.where(cells == UNKNOWN, 0, 255).astype(np.uint8)
        return np.dstack([grey, grey, grey, opaque])
    free, occupied = (cells >= 0) & (cells <= 100 * _FREE_THRESHOLD), cells >= 100 * _OCCUPIED_THRESHOLD
    return np.where(free, 254, np.where(occupied, 0, 205)).astype(np.uint8)


def encode_png(image: Bytes | NDArray[np.uint16]) -> bytes:
    """A picture (h, w) grey or (h, w, 3) RGB as a PNG file's content, packed as small as it goes."""
    pixels = image if image.ndim == 2 else image[:, :, ::-1]
    _, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return data.tobytes()
