"""Crops of explored maps with the true floor: what the network that completes maps learns from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from layoutexplore.grids.arrays import Bytes, Floats32, Mask
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors.floor_model.completion import MOST_AHEAD, SQUARE, known_squares
from layoutexplore.predictors.floor_model.network import FOLD, KINDS
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.training.explorations import (
    MakeAgent,
    stopped_explorations,
    stretched_copies,
    upright_plan,
)
from layoutexplore.training.folds import Progress

SIDE = 256
"""Squares on a side of a crop."""

SHIFT = 30
"""Squares that the middle of a crop may lie away from a cell at the border of the known."""

NEAR, LEAST = 2.0, 0.05
"""Metres over which a square that is farther from known floor counts less, and what any one counts."""

PLANES = KINDS + 1
"""Known to be free, known to be occupied, and truly floor."""


class Batch(NamedTuple):
    """What a step learns from.

    Attributes:
        known: float32 (n, KINDS, SIDE, SIDE), as the network sees it.
        floor: float32 (n, SIDE, SIDE), 1 where there is floor.
        weight: float32 (n, SIDE, SIDE), what each square counts: 0 where it is known or far from known floor.
    """

    known: Floats32
    floor: Floats32
    weight: Floats32


def crops_of_plans(
    plans: Sequence[FloorPlan],
    make_agent: MakeAgent,
    *,
    starts: int,
    snapshots: int,
    copies: int,
    seed: int,
    store: Path | None,
    progress: Progress,
) -> Bytes:
    """Crops of maps of floor plans as they are explored, a crop of each map: uint8 (n, bytes), packed bits.

    Args:
        plans: Floor plans.
        make_agent: Makes an agent by its name.
        starts: Explorations of each plan by each sensor.
        snapshots: Maps of each exploration.
        copies: Stretched copies of each plan that are explored besides.
        seed: Of the places of the crops.
        store: Folder in which explorations are kept.
        progress: Told of the plans.
    """
    rng = np.random.default_rng(seed)
    crops: list[Bytes] = []
    for done, plan in enumerate(plans):
        for copy in (plan, *stretched_copies(plan, copies)):
            for found in stopped_explorations(upright_plan(copy), make_agent, starts, snapshots, store):
                crops += crops_of_maps(found, rng)
        progress("plans explored", done + 1, len(plans))
    return np.array(crops, np.uint8).reshape(len(crops), -1)


def crops_of_maps(maps: Iterable[Snapshot], rng: np.random.Generator) -> list[Bytes]:
    """A crop of each map, somewhere along the border of what is known: uint8 (bytes,) of packed bits."""
    return [
        drawn for one in maps if (drawn := _drawn(one.decision.grid, one.truth.raster.free, rng)) is not None
    ]


def _drawn(grid: OccupancyGrid, free: Mask, rng: np.random.Generator) -> Bytes | None:
    known = known_squares(grid.cells, grid.resolution)
    floor = known_squares(np.where(free, np.int8(0), np.int8(UNKNOWN)), grid.resolution)[:1]
    planes = np.concatenate([known, floor])
    around = np.asarray(cv2.dilate(planes[0], np.ones((3, 3), np.uint8)))
    border = np.argwhere((around > 0) & ~planes[:KINDS].any(axis=0))
    if not len(border):
        return None
    middle = border[rng.integers(len(border))] + rng.integers(-SHIFT, SHIFT + 1, 2)
    wide = np.pad(planes, ((0, 0), (SIDE, SIDE), (SIDE, SIDE)))
    row, col = np.clip(middle, -SIDE // 2, np.array(planes.shape[1:]) + SIDE // 2) + SIDE // 2
    return np.packbits(wide[:, row : row + SIDE, col : col + SIDE])


def draw_batch(crops: Bytes, count: int, rng: np.random.Generator) -> Batch:
    """So many crops drawn at random, each in one of the eight orientations and moved by up to a place.

    Args:
        crops: uint8 (n, bytes), as of `crops_of_plans`.
        count: Crops.
        rng: Source of randomness.
    """
    known = np.zeros((count, KINDS, SIDE, SIDE), np.float32)
    floor, weight = (np.zeros((count, SIDE, SIDE), np.float32) for _ in range(2))
    for k, which in enumerate(rng.integers(len(crops), size=count)):
        planes = np.unpackbits(crops[which])[: PLANES * SIDE**2].reshape(PLANES, SIDE, SIDE)
        planes = np.rot90(planes, int(rng.integers(4)), (1, 2))
        planes = planes[:, :, ::-1] if rng.random() < 0.5 else planes
        planes = np.roll(planes, rng.integers(FOLD, size=2).tolist(), (1, 2))
        known[k], floor[k] = planes[:KINDS], planes[KINDS]
        away = cv2.distanceTransform(1 - planes[0], cv2.DIST_L2, cv2.DIST_MASK_3) * SQUARE
        asked = ~planes[:KINDS].any(axis=0) & (away < MOST_AHEAD)
        weight[k] = np.where(asked, np.exp(-away / NEAR) + LEAST, 0.0)
    return Batch(known, floor, weight)
