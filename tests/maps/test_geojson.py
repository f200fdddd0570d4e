"""Our own floor plan format: exact round trips, and errors that name file and feature."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from layoutexplore.errors import MapError
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.geojson import FORMAT, save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import CORNER


def hexagon() -> FloorPlan:
    """A plan with numbers that have no short decimal form."""
    angles = np.arange(6) * math.pi / 3
    outline = shapely.Polygon(np.stack([math.pi * np.cos(angles), math.e * np.sin(angles)], axis=1))
    return FloorPlan(
        name="Sechseck",
        building="Haus Nº 6",
        rooms=(
            Room(id=1, polygon=outline.buffer(-0.1), label="salle à manger"),
            Room(id=7, polygon=shapely.box(5, 5, 6, 6)),
        ),
        doors=(
            Door(start=(1 / 3, 2.0), end=(1.1, 2.0), rooms=(0, 1)),
            Door(start=(5.1, 5.0), end=(5.9, 5.0), rooms=(7, 0), is_open=False),
        ),
        walls=outline.difference(outline.buffer(-0.1)),
        furniture=shapely.MultiPolygon([shapely.box(0, 0, 0.3, 0.7), shapely.box(1, 0, 1.3, 0.7)]),
        passages=shapely.box(3, 0, 5, 1),
        metadata={"licence": "MIT"},
    )


def test_geojson_round_trip_is_exact(tmp_path: Path) -> None:
    plan = hexagon()
    save_plan(plan, tmp_path / "plan.geojson")
    loaded = load_plan(tmp_path / "plan.geojson")
    assert (loaded.name, loaded.building, dict(loaded.metadata)) == (
        plan.name,
        plan.building,
        dict(plan.metadata),
    )
    for one, two in zip(plan.rooms, loaded.rooms, strict=True):
        assert (one.id, one.label) == (two.id, two.label)
        assert shapely.equals_identical(one.polygon, two.polygon)
    for door, same in zip(plan.doors, loaded.doors, strict=True):
        assert (door.start, door.end, door.rooms, door.is_open) == (
            same.start,
            same.end,
            same.rooms,
            same.is_open,
        )
    for kind in ("walls", "furniture", "passages"):
        assert shapely.equals_identical(getattr(plan, kind), getattr(loaded, kind))
    assert loaded.content_hash == plan.content_hash
    text = (tmp_path / "plan.geojson").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 25
    assert "salle à manger" in text


def test_a_plan_of_an_image_keeps_its_cells_as_geojson(tmp_path: Path) -> None:
    plan = floorplan_from_ascii(CORNER, 0.5)
    save_plan(plan, tmp_path / "plan.geojson")
    loaded = load_plan(tmp_path / "plan.geojson")
    one, two = plan.rasterize(0.5), loaded.rasterize(0.5)
    free_one, free_two = (
        raster.free[raster.free.any(axis=1)][:, raster.free.any(axis=0)] for raster in (one, two)
    )
    assert np.array_equal(free_one, free_two)


def geojson(*features: dict[str, Any], **members: Any) -> str:
    return json.dumps({"type": "FeatureCollection", "features": list(features), **members})


def feature(kind: str, geometry: dict[str, Any] | None, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": {"kind": kind, **properties}, "geometry": geometry}


SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]]}
BOW = {"type": "Polygon", "coordinates": [[[0, 0], [4, 4], [4, 0], [0, 4], [0, 0]]]}
LINE = {"type": "LineString", "coordinates": [[0, 0], [1, 0]]}
ROOM = feature("room", SQUARE, id=1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "broken JSON"),
        ("[]", "FeatureCollection"),
        ('{"type": "Feature"}', "FeatureCollection"),
        (geojson(), "no free space"),
        (geojson(ROOM, units="ft"), "units"),
        (geojson(ROOM, metadata=[1]), "metadata"),
        (geojson(ROOM, "oops"), "feature 1: must be a Feature"),  # type: ignore[arg-type]
        (geojson(ROOM, feature("roof", SQUARE)), "feature 1: kind must be one of"),
        (geojson(ROOM, feature("roof", SQUARE)), "--column room=NAME"),
        (geojson(feature("roof", SQUARE), format=FORMAT), r"kind must be one of[^(]*$"),
        (geojson(feature("room", None, id=1)), r"feature 0 \(room\): geometry must be a Polygon"),
        (
            geojson(feature("room", LINE, id=1)),
            r"feature 0 \(room\): geometry must be a Polygon, got 'LineString'",
        ),
        (geojson(feature("room", BOW, id=1)), r"feature 0 \(room\): Self-intersection"),
        (geojson(feature("room", SQUARE, id=1.5)), r"feature 0 \(room\): id must be a whole number"),
        (geojson(feature("room", SQUARE), format=FORMAT), r"feature 0 \(room\): id must be a whole number"),
        (geojson(feature("room", SQUARE, id=1, label=3)), "label must be a string"),
        (geojson(ROOM, ROOM), "room ids"),
        (geojson(feature("room", {"type": "Polygon", "coordinates": []}, id=1)), "empty"),
        (
            geojson(feature("room", {"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, id=1)),
            "broken coordinates",
        ),
        (
            geojson(feature("room", {"type": "Polygon", "coordinates": [[[0, 0], [True, 0], [1, 1]]]}, id=1)),
            "broken coordinates: 'a coordinate must be a number, got True'",
        ),
        (
            geojson(feature("room", {"type": "Polygon", "coordinates": [[[0, 0], ["7", 0], [1, 1]]]}, id=1)),
            "broken coordinates: .*got '7'",
        ),
        (geojson(feature("room", {"type": "Polygon", "coordinates": "abc"}, id=1)), "broken coordinates"),
        (
            geojson(
                feature(
                    "room",
                    {"type": "Polygon", "coordinates": [[[0, 0], [math.nan, 0], [4, 4], [0, 0]]]},
                    id=1,
                )
            ),
            "finite numbers",
        ),
        (
            geojson(ROOM, feature("walls", SQUARE), feature("walls", SQUARE)),
            "feature 2: there is more than one",
        ),
        (geojson(ROOM, feature("door", LINE, rooms=[1])), "rooms must be two room ids"),
        (geojson(ROOM, feature("door", LINE, rooms=[1, 5])), "there is no room 5"),
        (geojson(ROOM, feature("door", LINE, rooms=[1, 0], open="yes")), "open must be true or false"),
        (
            geojson(ROOM, feature("door", {"type": "LineString", "coordinates": [[0, 0], [1, 0], [2, 0]]})),
            "line of two points",
        ),
    ],
)
def test_bad_geojson_names_file_and_feature(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.geojson"
    path.write_text(text)
    with pytest.raises(MapError, match=message) as caught:
        load_plan(path)
    assert str(path) in str(caught.value)
