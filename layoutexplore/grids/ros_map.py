"""Occupancy grids on disk: ROS map_server pairs (YAML and image) and plain images.

Reading follows nav2's map_server: trinary, scale and raw modes, `negate`, thresholds, an origin with a yaw,
transparent pixels as unknown; the image's top row is the largest y. Two things are kinder than there: the
unknown that `map_saver` writes stays unknown whatever the thresholds say, and an image that is not where the
YAML says is looked for beside it. Images without a YAML go through `layoutexplore.grids.image_map`.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import MapError, MapWarning, checks_arguments, shortened
from layoutexplore.files import read_yaml, write_atomically
from layoutexplore.files.images import read_pixels
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Bytes, Cells, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution
from layoutexplore.grids.image_map import grid_from_image, is_from_map_saver
from layoutexplore.options import check_kind

__all__ = ["DEFAULT_RESOLUTION", "grid_from_image", "load_grid", "read_image", "save_grid", "usable_maps"]

DEFAULT_RESOLUTION = 0.05
"""Metres a pixel of a plain image for which no resolution is given: that of most published grid maps."""

MODES = ("trinary", "scale", "raw")
IMAGE_SUFFIXES = (".png", ".pgm", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
YAML_SUFFIXES = (".yaml", ".yml")
RESOLUTIONS = (1e-3, 1e3)
"""Least and greatest metres a pixel of a map that brings its own scale."""

MOST_METRES = 1e8
"""No number of a map is larger: no building stands further from the origin of its coordinates."""

_LONGEST_NAME = 250
_OCCUPIED_THRESHOLD, _FREE_THRESHOLD = 0.65, 0.196
_SAVED_UNKNOWN = 205

S = TypeVar("S")
T = TypeVar("T")

UnknownGrey = int | Literal["auto", "none"]
"""Which grey level of a map is unknown: a number, "auto" (found in the map) or "none"."""


@checks_arguments
def load_grid(
    path: str | os.PathLike[str],
    *,
    resolution: float | None = None,
    unknown_grey: UnknownGrey = "auto",
    image_anywhere: bool = False,
) -> OccupancyGrid:
    """Read an occupancy grid.

    Args:
        path: A ROS map's YAML file, or an image.
        resolution: Metres a pixel of a plain image (0.05 when None). A YAML brings its own.
        unknown_grey: The grey level that is unknown whatever thresholds say. "auto": of a ROS map 205, where
            its image holds what `map_saver` writes (0, 205, 254) and the thresholds would make 205 free; of a
            plain image what `grid_from_image` finds. "none": thresholds and transparency alone.
        image_anywhere: Whether a ROS map's image may lie outside of the folder of its YAML.

    Raises:
        MapError: The file is missing, broken, of an unknown kind, or its numbers make no sense.

    Warns:
        MapWarning: 205 was read as unknown against the thresholds, or the image was found in another place
            than the YAML says.
    """
    check_kind("path", path, str, os.PathLike)
    path = Path(path)
    if resolution is not None:
        check_resolution(resolution)
    if not isinstance(unknown_grey, (str, int, np.integer)) or unknown_grey not in (
        "auto",
        "none",
        *range(256),
    ):
        raise MapError(
            f"unknown_grey must be a level from 0 to 255, 'auto' or 'none', got {shortened(unknown_grey)}"
        )
    if path.suffix.lower() in YAML_SUFFIXES:
        return _load_ros_map(path, unknown_grey, image_anywhere)
    grey, transparent = read_image(path, luma=True)
    return grid_from_image(
        grey,
        DEFAULT_RESOLUTION if resolution is None else resolution,
        transparent=transparent,
        unknown_grey=unknown_grey,
    )


@checks_arguments
def usable_maps(read: Callable[[S], T], maps: Iterable[S]) -> tuple[list[T], list[str]]:
    """What was read of those maps of a study that can be used, and what is wrong with each of the others.

    Args:
        read: Reads a map, or raises a `MapError`.
        maps: What it is to read, one after the other.

    Raises:
        MapError: None of them can be used.
    """
    found, wrong = [], []
    for each in maps:
        try:
            found.append(read(each))
        except MapError as error:
            wrong.append(str(error))
    if wrong and not found:
        raise MapError("; ".join(wrong))
    return found, wrong


@checks_arguments
def read_image(path: str | os.PathLike[str], *, luma: bool = False) -> tuple[Bytes, Mask]:
    """Grey levels uint8 (h, w) and which pixels are not opaque, bool (h, w), of an image of any kind.

    Args:
        path: The image.
        luma: Weigh colours as the eye does; otherwise average the channels, as map_server does.
    """
    path = Path(path)
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


def _load_ros_map(path: Path, unknown_grey: UnknownGrey, image_anywhere: bool) -> OccupancyGrid:
    entries = _parse(path, image_anywhere)
    pixels, transparent = read_image(entries.image)
    if unknown_grey == "auto":
        unknown_grey = _SAVED_UNKNOWN if _hides_unknown(path, pixels, entries) else "none"
    if unknown_grey != "none":
        transparent |= pixels == unknown_grey
    cells = _cells_of_levels(entries)[pixels[::-1]]
    if entries.mode != "raw" or unknown_grey != "none":
        cells = np.where(transparent[::-1], np.int8(UNKNOWN), cells)
    return OccupancyGrid(np.ascontiguousarray(cells), entries.resolution, entries.origin)


def _cells_of_levels(entries: _RosMap) -> Cells:
    """The cell int8 (256,) that each grey level means."""
    levels = np.arange(256)
    if entries.mode == "raw":
        return np.where(levels <= OCCUPIED, levels, UNKNOWN).astype(np.int8)
    shade = levels / 255.0
    occupancy = shade if entries.negate else 1.0 - shade
    low, high = entries.free_thresh, entries.occupied_thresh
    between = np.clip(np.rint((occupancy - low) / (high - low) * 100), FREE, OCCUPIED)
    between = between if entries.mode == "scale" else np.full(256, UNKNOWN)
    cells = np.where(occupancy >= high, OCCUPIED, np.where(occupancy <= low, FREE, between))
    return cells.astype(np.int8)


def _hides_unknown(path: Path, pixels: Bytes, entries: _RosMap) -> bool:
    """Whether the thresholds make floor of what `map_saver` left unknown; warns where they do.

    205 has an occupancy of 0.196: above ROS 1's `free_thresh` of 0.196, below the 0.25 of ROS 2.
    """
    occupancy = 1.0 - _SAVED_UNKNOWN / 255.0
    if entries.mode == "raw" or entries.negate or occupancy > entries.free_thresh:
        return False
    if not is_from_map_saver(pixels):
        return False
    warnings.warn(
        f"{path}: grey {_SAVED_UNKNOWN} is read as unknown, as map_saver writes it, although free_thresh "
        f"{entries.free_thresh:g} would make it free (unknown grey 'none' follows the thresholds)",
        MapWarning,
        stacklevel=4,
    )
    return True


def _find_image(path: Path, named: str, anywhere: bool) -> Path:
    """The image of a map's YAML: where it says, if that is in the YAML's folder or may be anywhere.

    An absolute path is often that of the computer on which the map was saved: what has its name beside the
    YAML then stands for it.
    """
    image = path.parent / named
    if not is_file(image):  # it may be written as on Windows
        image = path.parent / named.replace("\\", "/")
    home = Path(os.path.abspath(path.parent))  # noqa: PTH100 - links are followed by those who set them
    inside = Path(os.path.abspath(image)).is_relative_to(home)  # noqa: PTH100
    if (inside or anywhere) and is_file(image):
        return image
    beside = path.parent / Path(named.replace("\\", "/")).name
    if beside != image and is_file(beside):
        warnings.warn(f"{path}: reads {beside.name} beside it instead of {named}", MapWarning, stacklevel=5)
        return beside
    if inside or anywhere:
        return image
    raise MapError(
        f"{path}: its image {named} lies in another folder: put it beside the YAML, or allow it with "
        "image_anywhere=True (on the command line, `layoutexplore maps import --image-anywhere` makes a "
        "floor plan of it that every command takes)"
    )


@checks_arguments
def images_of(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Where the image of a ROS map may lie: where its YAML says, and beside it; nowhere if it says none."""
    path = Path(path)
    try:
        data = read_yaml(path)
    except MapError:
        return ()
    named = str(data.get("image") or "") if isinstance(data, dict) else ""
    if not 0 < len(named.encode(errors="replace")) <= _LONGEST_NAME or "\0" in named:
        return ()
    plain = named.replace("\\", "/")
    return path.parent / named, path.parent / plain, path.parent / Path(plain).name


def _parse(path: Path, image_anywhere: bool) -> _RosMap:
    """The YAML's entries, or a `MapError` that names the entry that is wrong."""
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise MapError(f"{path}: a map's YAML needs the entries image, resolution and origin")
    if missing := [key for key in ("image", "resolution", "origin") if key not in data]:
        raise MapError(f"{path}: the entry {missing[0]!r} is missing")
    named = data["image"]
    if not isinstance(named, str | int | float) or not 0 < len(str(named).encode()) <= _LONGEST_NAME:
        raise MapError(f"{path}: image must be the name of a file, got {shortened(data['image'])}")
    origin = data["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapError(f"{path}: origin must be [x, y, yaw], got {shortened(origin)}")
    mode = data.get("mode", "trinary")
    mode = mode.lower() if isinstance(mode, str) else mode  # as nav2 takes it
    if mode not in MODES:
        raise MapError(f"{path}: mode must be one of {', '.join(MODES)}, got {shortened(mode)}")
    x, y = (_number(value, "origin", path) for value in origin[:2])
    negate = _number(data.get("negate", 0), "negate", path, flag=True)
    if negate not in (0, 1):
        raise MapError(f"{path}: negate must be 0 or 1, got {shortened(data['negate'])}")
    entries = _RosMap(
        image=_find_image(path, str(data["image"]), image_anywhere),
        resolution=_number(data["resolution"], "resolution", path),
        origin=Pose(x, y, _yaw(origin[2], path)),
        negate=bool(negate),
        occupied_thresh=_number(data.get("occupied_thresh", _OCCUPIED_THRESHOLD), "occupied_thresh", path),
        free_thresh=_number(data.get("free_thresh", _FREE_THRESHOLD), "free_thresh", path),
        mode=mode,
    )
    if not RESOLUTIONS[0] <= entries.resolution <= RESOLUTIONS[1]:
        raise MapError(
            f"{path}: resolution must be above 0, from {RESOLUTIONS[0]:g} to {RESOLUTIONS[1]:g} metres a "
            f"pixel, got {entries.resolution:g}"
        )
    if not 0 <= entries.free_thresh < entries.occupied_thresh <= 1:
        raise MapError(f"{path}: needs 0 <= free_thresh < occupied_thresh <= 1")
    return entries


def _yaw(value: Any, path: Path) -> float:
    """The yaw of a map's origin; what `map_saver` writes as nan was no rotation, and is none."""
    if str(value).strip().lower().lstrip("-+.") == "nan":
        warnings.warn(f"{path}: the yaw of the origin is {value} and is read as 0", MapWarning, stacklevel=6)
        return 0.0
    return _number(value, "origin", path)


def _number(value: Any, name: str, path: Path, *, flag: bool = False) -> float:
    try:
        number = math.nan if isinstance(value, bool) and not flag else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) <= MOST_METRES:
        raise MapError(
            f"{path}: {name} must be a finite number up to {MOST_METRES:g}, got {shortened(value)}"
        )
    return number


@checks_arguments
def save_grid(grid: OccupancyGrid, path: str | os.PathLike[str], *, mode: str = "trinary") -> None:
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
    check_kind("grid", grid, OccupancyGrid)
    check_kind("path", path, str, os.PathLike)
    if not isinstance(mode, str) or mode not in MODES:
        raise MapError(f"mode must be one of {', '.join(MODES)}, got {shortened(mode)}")
    path = Path(path)
    if not path.name:
        raise MapError(f"{path}: cannot write a map there: name a file")
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
    _, encoded = cv2.imencode(image.suffix, _to_pixels(grid, mode))
    write_atomically(image, encoded.tobytes())
    import yaml

    write_atomically(path, yaml.safe_dump(text, sort_keys=False, default_flow_style=None).encode())


def _to_pixels(grid: OccupancyGrid, mode: str) -> Bytes:
    cells = (grid.trinary if mode == "trinary" else grid).cells[::-1]
    if mode == "raw":
        return np.where(cells == UNKNOWN, 255, cells).astype(np.uint8)
    if mode == "scale":
        grey = np.rint((100 - np.maximum(cells, 0).astype(np.float64)) * 2.55).astype(np.uint8)
        opaque = np.where(cells == UNKNOWN, 0, 255).astype(np.uint8)
        return np.dstack([grey, grey, grey, opaque])
    return np.where(cells == FREE, 254, np.where(cells == OCCUPIED, 0, 205)).astype(np.uint8)


MOST_DRAWN, MOST_IN_PNG = 32_767, 1_000_000
"""Pixels on a side of a picture that OpenCV still resizes, and that a PNG file holds."""


def check_picture(name: str, image: object, most: int = MOST_DRAWN) -> None:
    """Raise `MapError` unless it is a picture: an array (h, w) grey or (h, w, 3) RGB of uint8 or uint16.

    Args:
        name: What it is called in the message.
        image: What may be one.
        most: Pixels on a side.
    """
    if not (
        isinstance(image, np.ndarray)
        and image.dtype in (np.uint8, np.uint16)
        and (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3))
        and min(image.shape[:2]) > 0
    ):
        raise MapError(f"{name} must be a picture, uint8 (h, w) or (h, w, 3), got {shortened(image)}")
    if max(image.shape[:2]) > most:
        high, wide = image.shape[:2]
        raise MapError(
            f"{name} is a picture of {wide} x {high} pixels, of which a side may have {most}: larger cells "
            "or a part of it make it smaller"
        )


@checks_arguments
def encode_png(image: Bytes | NDArray[np.uint16]) -> bytes:
    """A picture (h, w) grey or (h, w, 3) RGB as a PNG file's content, packed as small as it goes.

    Raises:
        MapError: It is none, or a side has more than a million pixels.
    """
    check_picture("image", image, MOST_IN_PNG)
    pixels = image if image.ndim == 2 else image[:, :, ::-1]
    _, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return data.tobytes()
