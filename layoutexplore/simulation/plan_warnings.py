"""What to know of a floor plan before it is explored: a scale that is a guess, floor that is out of reach."""

from __future__ import annotations

import contextlib
import warnings
from multiprocessing import parent_process
from weakref import WeakSet

import numpy as np

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.grids.grid import Cell
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.image import ASSUMED
from layoutexplore.maps.raster import PlanRaster

LOST_SHARE = 0.1
"""A larger share of a plan's floor that a robot cannot get to is worth a warning."""

_LOOKED_AT: WeakSet[PlanRaster] = WeakSet()


def warn_of_plan(plan: FloorPlan, raster: PlanRaster, radius: float, *, whole: bool = True) -> None:
    """Warn once, and not in workers: of a scale that was assumed, and of floor that is out of reach.

    Args:
        plan: The floor plan.
        raster: Its cells.
        radius: Of the robot, in metres.
        whole: All of it is to be explored; otherwise what is out of reach may be meant to be.

    Warns:
        MapWarning: As said.
    """
    if raster in _LOOKED_AT or parent_process() is not None:
        return
    _LOOKED_AT.add(raster)
    scale = plan.metadata.get("scale", "")
    if ASSUMED in scale:
        warnings.warn(
            f"{plan.file or plan.name}: its scale is a guess, {scale}, and all lengths with it; "
            "`layoutexplore maps import FILE --scale-by '3.2 m = 118 px' --out PLAN.geojson` sets it",
            MapWarning,
            stacklevel=2,
        )
    if whole:
        with contextlib.suppress(MapError):  # a robot that fits nowhere is told of when a run begins
            warn_of_reach(plan, raster, radius)


def warn_of_reach(plan: FloorPlan, raster: PlanRaster, radius: float, start: Cell | None = None) -> None:
    """Warn where a large share of the floor cannot be seen from the part that holds the start.

    Args:
        plan: The floor plan; doors of it that are closed are meant to be.
        raster: Its cells.
        radius: Of the robot, in metres.
        start: A cell; the largest part when None.

    Raises:
        MapError: The robot fits nowhere.

    Warns:
        MapWarning: As said.
    """
    if not all(door.is_open for door in plan.doors):
        return
    seen = int(np.count_nonzero(raster.coverage_target(radius, start)))
    free = int(np.count_nonzero(raster.free))
    if free - seen > LOST_SHARE * free:
        cell = raster.resolution**2
        where = "its largest part" if start is None else "the start's part"
        warnings.warn(
            f"{plan.file or plan.name}: {(free - seen) / free:.0%} of the floor ({(free - seen) * cell:.0f} "
            f"of {free * cell:.0f} m2) cannot be reached from {where} by a robot {2 * radius:g} m wide and "
            "is not explored; `layoutexplore maps import FILE --out PLAN.geojson` says where",
            MapWarning,
            stacklevel=2,
        )
