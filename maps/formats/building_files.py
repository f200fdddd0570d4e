"""Files that hold several floors: which format one is of, and FILE#LEVEL as the name of a floor."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from layoutexplore.errors import checks_arguments
from layoutexplore.files import is_there
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.ifc import ifc_levels, is_ifc, load_ifc
from layoutexplore.maps.formats.imdf import imdf_levels, is_imdf, load_imdf
from layoutexplore.maps.formats.osm import load_osm, osm_levels
from layoutexplore.maps.formats.rmf import is_rmf, load_rmf, rmf_levels


class BuildingFormat(NamedTuple):
    """How a kind of file is told from others, which floors are in one, and how one floor is read."""

    recognises: Callable[[Path], bool]
    levels: Callable[[Path], list[str]]
    load: Callable[[Path, str], FloorPlan]


def _is_osm(path: Path) -> bool:
    return path.suffix.lower() == ".osm"


FORMATS = (
    BuildingFormat(is_imdf, imdf_levels, load_imdf),
    BuildingFormat(_is_osm, osm_levels, load_osm),
    BuildingFormat(is_rmf, rmf_levels, load_rmf),
    BuildingFormat(is_ifc, ifc_levels, load_ifc),
)


@checks_arguments
def building_format(path: str | os.PathLike[str]) -> BuildingFormat | None:
    """The format of a file or folder that holds several floors; None for everything else."""
    return next((known for known in FORMATS if known.recognises(Path(path))), None)


_MOST_SIGNS = 100
"""Of a text, those of its # behind which a floor is looked for."""


@checks_arguments
def split_level(text: str) -> tuple[Path, str]:
    """The file and the floor of FILE#LEVEL; without one, or for a file with a # in its name, no floor.

    Where both may have a # in their names, the file is the longest one that exists.

    Example:
        >>> split_level("campus.osm#-1")
        (PosixPath('campus.osm'), '-1')
    """
    if "#" not in text or is_there(Path(text)):
        return Path(text), ""
    ends = [k for k, letter in enumerate(text) if letter == "#" and k > 0][-_MOST_SIGNS:]
    if not ends:
        return Path(text), ""
    end = next((k for k in reversed(ends) if is_there(Path(text[:k]))), ends[-1])
    return Path(text[:end]), text[end + 1 :]


@checks_arguments
def floors_of(path: str | os.PathLike[str]) -> list[str]:
    """FILE#LEVEL for every floor of a file of several.

    Raises:
        MapError: The file is broken.
    """
    path = Path(path)
    known = building_format(path)
    return [] if known is None else [f"{path}#{level}" for level in known.levels(path)]
