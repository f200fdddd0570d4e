"""A layout as GeoJSON that is a floor plan as well: with its doors, its walls and the floor of no room."""

from __future__ import annotations

from typing import Any

import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from layoutexplore.grids.grid import Pose
from layoutexplore.importing.building import is_door, without_strips
from layoutexplore.layout.export import layout_to_geojson
from layoutexplore.layout.types import Layout
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import plan_from_raster


def layout_with_doors(layout: Layout) -> dict[str, Any]:
    """What `layout_to_geojson` gives, and features of kind "door", "walls" and "passages" as in floor plans.

    Without any free cell in a room there is nothing to add.
    """
    collection = layout_to_geojson(layout)
    grid = layout.clean_grid
    labels = without_strips(layout.labels, grid)
    if labels.any():
        frame = Pose(grid.origin.x, grid.origin.y, 0.0)
        source = PlanRaster(~grid.free, labels, grid.resolution, frame)
        plan = plan_from_raster(source, name=layout.method, oblique=True)
        kept = {room.id for room in layout.rooms}
        collection["features"] += _plan_features(plan, kept, grid.origin)
    return collection


def _plan_features(plan: FloorPlan, kept: set[int], origin: Pose) -> list[dict[str, Any]]:
    found = [
        _feature(shapely.LineString([d.start, d.end]), origin, kind="door", rooms=list(d.rooms), open=True)
        for d in plan.doors
        if is_door(d) and set(d.rooms) <= kept | {0}
    ]
    for kind in ("walls", "passages"):
        shape = getattr(plan, kind)
        if not shape.is_empty:
            found.append(_feature(shape, origin, kind=kind))
    return found


def _feature(shape: BaseGeometry, origin: Pose, **properties: Any) -> dict[str, Any]:
    turned = shapely.affinity.rotate(shape, origin.theta, origin=(origin.x, origin.y), use_radians=True)
    return {"type": "Feature", "geometry": mapping(turned), "properties": properties}
