"""Real maps read for their statistics; simulated ones written with their rooms; ranges of noise as TOML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.files import all_or_none, naming, read_toml, safe_name, write_atomically, write_csv
from layoutexplore.files.schema import Items, Number, Record
from layoutexplore.grids.arrays import Bytes, Floats
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.ros_map import encode_png, load_grid, usable_maps
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.painted_rooms import INDEX, TRUTH_SUFFIX, read_scales
from layoutexplore.training.map_noise.fit import SimulatedMaps
from layoutexplore.training.map_noise.simulate import MapNoiseConfig, NoisyMap
from layoutexplore.training.map_noise.statistics import MapStatistics, describe_grid, statistics_table

GREYS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}
"""Grey of each kind of cell in a picture, as `map_saver` has them."""

_NOT_MAPS = (TRUTH_SUFFIX, "_vendor_rooms")
"""Endings of pictures that lie beside maps."""


def describe_folders(folders: Sequence[Path], resolution: float) -> tuple[Floats, list[str], list[str]]:
    """The statistics of the maps in some folders, float64 (n, statistics), and the building of each.

    Also what is wrong with each map that cannot be read or has no statistics.

    Args:
        folders: Folders of PNG maps, each counted once; an `index.csv` inside may give `file` and `m_per_px`.
        resolution: Metres a pixel where no index says it.

    Raises:
        MapError: A folder is missing or holds no map, or no map at all can be used.
    """

    def describe(item: tuple[Path, float]) -> tuple[MapStatistics, str]:
        path, scale = item
        cells = load_grid(path, resolution=scale).cells
        try:
            return describe_grid(cells, scale), building_of(path.stem, "painted rooms") or path.stem
        except MapError as error:
            raise MapError(f"{path}: {error}") from error

    maps: list[tuple[Path, float]] = []
    for folder in {folder.resolve(): folder for folder in folders}.values():
        if not folder.is_dir():
            raise MapError(f"{folder}: no such folder")
        paths = [path for path in sorted(folder.glob("*.png")) if not path.stem.endswith(_NOT_MAPS)]
        if not paths:
            raise MapError(f"{folder}: no map NAME.png inside this folder")
        scales = read_scales(folder / INDEX, [path.name for path in paths])
        maps += [(path, scales.get(path.name, resolution)) for path in paths]
    found, failed = usable_maps(describe, maps)
    return statistics_table([row for row, _ in found]), [building for _, building in found], failed


def read_noise(path: Path) -> MapNoiseConfig:
    """Ranges of noise from a TOML file, each `name = [low, high]`; what it does not name is as by default.

    Raises:
        ConfigError: The file cannot be read, or a range is none.
    """
    names = [field.name for field in fields(MapNoiseConfig)]
    given = read_toml(path, Record({}, dict.fromkeys(names, Items(Number()))))
    for name, ends in given.items():
        if name not in names:
            raise ConfigError(f"{path}: no noise is called {name}; known are {', '.join(names)}")
        if len(ends) != 2:
            raise ConfigError(f"{path}: {name} needs two numbers, [low, high]")
    with naming(path, ConfigError):
        return MapNoiseConfig(**{name: (float(low), float(high)) for name, (low, high) in given.items()})


def write_cases(made: SimulatedMaps, folder: Path) -> int:
    """Write maps as `evaluate segmentation` reads them, with their scales and what they are maps of, or none.

    The scales stand in index.csv (`file`, `m_per_px`), the buildings in buildings.csv (`map`, `building`).

    Returns the number of maps written: one in which no room is seen is left out.
    """
    lines, scales = [], []
    with all_or_none(folder) as beside:
        for k, (one, building) in enumerate(zip(made.maps, made.buildings, strict=True)):
            if not ((one.rooms > 0) & (one.cells == FREE)).any():
                continue
            name = f"{safe_name(building)}_{k:03d}"
            write_atomically(beside / f"{name}.png", encode_png(_picture(one)))
            write_atomically(beside / f"{name}{TRUTH_SUFFIX}.png", encode_png(_painted(one)))
            lines.append({"map": name, "building": building})
            scales.append({"file": f"{name}.png", "m_per_px": float(one.resolution)})
        write_csv(beside / "buildings.csv", lines, columns=["map", "building"], digits=None)
        write_csv(beside / INDEX, scales, columns=["file", "m_per_px"], digits=None)
    return len(lines)


def _picture(one: NoisyMap) -> Bytes:
    out = np.zeros(one.cells.shape, np.uint8)
    for kind, grey in GREYS.items():
        out[one.cells == kind] = grey
    return out[::-1].copy()


def _painted(one: NoisyMap) -> Bytes:
    """A colour a room over what the map knows of it, black elsewhere."""
    seen = np.where(one.cells != UNKNOWN, one.rooms, 0).astype(np.uint32)
    # an odd factor permutes the numbers modulo a power of two: no two rooms share a colour, none is black
    codes = np.where(seen > 0, seen * 2654435 % 2**24, 0)
    channels = [(codes >> shift & 255).astype(np.uint8) for shift in (16, 8, 0)]
    return np.stack(channels, axis=2)[::-1].copy()
