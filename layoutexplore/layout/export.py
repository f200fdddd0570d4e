"""Layouts as GeoJSON, in metres of the world frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from layoutexplore.layout.types import OUTSIDE, Face, Layout, LayoutRoom
from layoutexplore.options import check_kind


def layout_to_geojson(layout: Layout) -> dict[str, Any]:
    """A FeatureCollection of the rooms, faces, lines and walls of a layout.

    Every feature has a property `kind` ("room", "face", "line" or "wall"); the collection's `layout` member
    holds the method, the directions in degrees, the structure score and the warnings. A face's `neighbours`
    are objects of the neighbour's id (`face`) and the share of the common boundary that seen wall covers
    (`weight`). A room has the `area` of its polygon and its `free_area` (`Layout.free_areas`), both in square
    metres.
    """
    check_kind("layout", layout, Layout)
    free = layout.free_areas
    features = [
        *(_feature(room.polygon, "room", **_room(room, free[room.id])) for room in layout.rooms),
        *(
            _feature(
                face.polygon,
                "face",
                id=face.id,
                face_kind=face.kind.value,
                inside_share=round(face.inside_share, 4),
                room=face.room,
                neighbours=_neighbours(face),
            )
            for face in layout.faces
        ),
        *(
            _feature(
                shapely.LineString((line.start, line.end)),
                "line",
                weight=round(line.weight, 4),
                local=line.is_local,
            )
            for line in layout.lines
            if not line.is_border
        ),
        *(
            _feature(shapely.LineString((wall.start, wall.end)), "wall", line=wall.line)
            for wall in layout.walls
        ),
    ]
    score = layout.structure_score
    return {
        "type": "FeatureCollection",
        "layout": {
            "method": layout.method,
            "directions": [round(float(v), 4) for v in np.degrees(layout.directions)],
            "structure_score": None if math.isnan(score) else round(score, 4),
            "warnings": list(layout.warnings),
        },
        "features": features,
    }


def _neighbours(face: Face) -> list[dict[str, Any]]:
    """The faces on the other side of a face's edges, with the covered share of the boundary between them."""
    sums: dict[int, tuple[float, float]] = {}
    for edge in face.edges:
        length, covered = sums.get(edge.neighbour, (0.0, 0.0))
        step = math.dist(edge.start, edge.end)
        sums[edge.neighbour] = length + step, covered + edge.weight * step
    return [
        {"face": other, "weight": round(covered / length if length else 0.0, 4)}
        for other, (length, covered) in sorted(sums.items())
        if other != OUTSIDE
    ]


def _room(room: LayoutRoom, free: float) -> dict[str, Any]:
    return {
        "id": room.id,
        "area": round(room.area, 4),
        "free_area": round(free, 4),
        "seen_share": round(room.seen_share, 4),
        "partial": room.is_partial,
        "closed": room.is_closed,
        "faces": list(room.faces),
    }


def _feature(geometry: shapely.Geometry, kind: str, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": shapely.geometry.mapping(geometry),
        "properties": {"kind": kind, **properties},
    }
