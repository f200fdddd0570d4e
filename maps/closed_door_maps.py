"""Grid maps with closed doors: `NAME_k_doors_IN.png`, a reference's answer and the truth."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files.reading import is_file, is_there
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.ros_map import read_image

OCCUPIED_GREY, UNKNOWN_GREY, FREE_GREY = 0, 205, 254
_NAME = re.compile(r"(?P<building>.+)_(?P<k>\d+)_doors_IN\.png")


@dataclass(frozen=True)
class Triple:
    """A map with shut rooms, its truth, and the reference's answer where there is one."""

    building: str
    doors: int
    seen: Path
    truth: Path
    reference: Path | None

    @property
    def name(self) -> str:
        """NAME_k_doors."""
        return f"{self.building}_{self.doors}_doors"


@checks_arguments
def find_triples(folder: str | os.PathLike[str]) -> list[Triple]:
    """The maps of a folder, by building and number of doors.

    Raises:
        MapError: No such folder, no maps in it, or a map without its truth.
    """
    folder = Path(folder)
    if not (is_there(folder) and folder.is_dir()):
        raise MapError(f"{folder}: no such folder")
    triples = []
    for seen in folder.glob("*_doors_IN.png"):
        match = _NAME.fullmatch(seen.name)
        if not match:
            raise MapError(f"{seen}: the name must be NAME_k_doors_IN.png with a number k")
        truth = seen.with_name(f"{match['building']}_GT.png")
        if not is_file(truth):
            raise MapError(f"{seen}: its truth {truth.name} is missing")
        reference = seen.with_name(seen.name.replace("_IN.png", "_OUT.png"))
        triples.append(
            Triple(match["building"], int(match["k"]), seen, truth, reference if is_file(reference) else None)
        )
    if not triples:
        raise MapError(f"{folder}: no map NAME_k_doors_IN.png with its truth NAME_GT.png")
    return sorted(triples, key=lambda t: (t.building, t.doors))


@checks_arguments
def read_cells(path: str | os.PathLike[str], shape: tuple[int, int] | None = None) -> Cells:
    """The cells int8 (rows, cols) of an image, its rows from the top.

    Raises:
        MapError: The image is damaged, has other grey levels than the three, or not the expected size.
    """
    path = Path(path)
    grey = read_image(path)[0]
    if shape is not None and grey.shape != shape:
        raise MapError(
            f"{path}: {grey.shape[1]} x {grey.shape[0]} pixels, but its map has {shape[1]} x {shape[0]}"
        )
    free, occupied = grey == FREE_GREY, grey == OCCUPIED_GREY
    odd = grey[~(free | occupied | (grey == UNKNOWN_GREY))]
    if odd.size:
        raise MapError(
            f"{path}: grey level {odd[0]}: only 0 (occupied), 205 (unknown) and 254 (free) are expected"
        )
    return np.where(free, FREE, np.where(occupied, OCCUPIED, UNKNOWN)).astype(np.int8)
