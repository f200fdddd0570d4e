"""Small files of several formats, and how much of a plan a robot can reach."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import shapely

from layoutexplore.maps.floorplan import Door, FloorPlan, Room

RADIUS = 0.2


def share_reached(plan: FloorPlan) -> float:
    """The largest component's share of the cells that a robot of 0.2 m can be in, at 0.1 m a cell."""
    raster = plan.rasterize(0.1)
    return float(raster.reachable(RADIUS).sum() / (~raster.blocked(RADIUS)).sum())


SCHOOL = """<building id="b"><scale>
<represented_distance><value>30</value><um>pixel</um></represented_distance>
<real_distance><value>90</value><um>cm</um></real_distance></scale>
<building_type><main_type>SCHOOL</main_type></building_type>
<floor><spaces>
<space id="a"><labels><type>R</type><label>CLASSROOM</label></labels>
<bounding_polygon><point x="0" y="0"/><point x="200" y="0"/><point x="200" y="100"/><point x="0" y="100"/>
</bounding_polygon>
<space_representation><linesegment id="s"><point x="30" y="100"/><point x="30" y="100"/>
<class>PORTAL</class></linesegment>
</space_representation>
<portals><portal><linesegment>s</linesegment><target><id>a</id><id>b</id></target></portal></portals></space>
<space id="b"><labels><type>C</type><label>CORRIDOR</label></labels>
<bounding_polygon><point x="0" y="106"/><point x="200" y="106"/><point x="200" y="200"/><point x="0" y="200"/>
</bounding_polygon>
<portals><portal><linesegment>s</linesegment><target><id>a</id><id>b</id></target></portal></portals></space>
</spaces></floor></building>"""


def write_kth(folder: Path) -> Path:
    """Two rooms with a hollow wall between them, a door, and free space all around."""
    occ, rooms = np.full((120, 200), 254, np.uint8), np.zeros((120, 200), np.uint8)
    occ[20:100, 20:180] = 0
    occ[22:98, 22:98] = occ[22:98, 104:178] = 254
    occ[22:98, 100:102] = 254  # the hollow
    rooms[22:98, 22:98], rooms[22:98, 104:178] = 1, 2
    occ[50:68, 98:104] = 254  # the door
    occ[98:100, 40:60] = 254  # a door to the outside
    cv2.imwrite(str(folder / "50_PLAN1_occ.png"), occ)
    cv2.imwrite(str(folder / "50_PLAN1_rooms.png"), rooms)
    return folder / "50_PLAN1_occ.png"


def write_houseexpo(folder: Path, *, sidecar: bool = True) -> Path:
    verts = [
        [0, 0],
        [0, 3],
        [3, 3],
        [3, 2],
        [3.1, 2],
        [3.1, 3],
        [6, 3],
        [6, 0],
        [3.1, 0],
        [3.1, 1],
        [3, 1],
        [3, 0],
    ]
    boxes = {"Living_Room": [[-0.1, -0.1, 3.1, 3.1]], "Kitchen": [[3.0, -0.1, 6.1, 3.1]]}
    (folder / "house.json").write_text(json.dumps({"verts": verts, "id": "house", "room_category": boxes}))
    if sidecar:
        areas = [
            [[0, 0], [3.05, 0], [3.05, 3], [0, 3], [0, 0]],
            [[3.05, 0], [6, 0], [6, 3], [3.05, 3], [3.05, 0]],
        ]
        extra = {"areas": areas, "door": [[[3.05, 1], [3.05, 2]]]}
        (folder / "house.label_data.json").write_text(json.dumps(extra))
    return folder / "house.json"


def two_rooms(*, gap: float = 0.9, thickness: float = 0.2, **changes: object) -> FloorPlan:
    """Two rooms of 4 x 3 m with a door in the wall between them."""
    a, b = shapely.box(0.0, 0.0, 4.0, 3.0), shapely.box(4.0 + thickness, 0.0, 8.0 + thickness, 3.0)
    hull = shapely.box(-0.2, -0.2, 8.2 + thickness, 3.2)
    middle = 4.0 + thickness / 2
    door = Door(start=(middle, 1.0), end=(middle, 1.0 + gap), rooms=(1, 2))
    walls = hull.difference(a.union(b)).difference(shapely.box(3.9, 1.0, 4.1 + thickness, 1.0 + gap))
    plan = FloorPlan(
        name="two",
        rooms=(Room(id=1, polygon=a, label="office"), Room(id=2, polygon=b)),
        doors=(door,),
        walls=walls,
    )
    return dataclasses.replace(plan, **changes)  # type: ignore[arg-type]
