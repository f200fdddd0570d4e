"""What every loader of floor plans has in common."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from shapely import LineString, box
from shapely.geometry import mapping

from layoutexplore.errors import MapError
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps import expand_plans, library, load_plan
from layoutexplore.maps.geojson import save_plan
from layoutexplore.simulation.simulation import Simulation
from tests.maps.cases import SCHOOL, share_reached, two_rooms, write_houseexpo, write_kth


def write_geojson(folder: Path) -> Path:
    save_plan(two_rooms(), folder / "plan.geojson")
    return folder / "plan.geojson"


def write_school(folder: Path) -> Path:
    (folder / "school.xml").write_text(SCHOOL)
    return folder / "school.xml"


def write_ros_map(folder: Path) -> Path:
    save_grid(two_rooms().rasterize(0.1).grid, folder / "map.yaml")
    return folder / "map.yaml"


def write_image(folder: Path) -> Path:
    cv2.imwrite(str(folder / "image.png"), np.pad(np.full((60, 80), 254, np.uint8), 5))
    return folder / "image.png"


def write_foreign_geojson(folder: Path) -> Path:
    shapes = {"a": box(0, 0, 5, 4), "b": box(5, 0, 9, 4), "": LineString([(5, 1), (5, 2)])}
    features = [
        {"type": "Feature", "properties": {"name": name}, "geometry": mapping(shape)}
        for name, shape in shapes.items()
    ]
    (folder / "qgis.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return folder / "qgis.geojson"


SAMPLES: dict[str, list[Callable[[Path], Path]]] = {
    "load_geojson": [write_geojson],
    "load_foreign_geojson": [write_foreign_geojson],
    "load_school_xml": [write_school],
    "load_kth": [write_kth],
    "load_houseexpo": [write_houseexpo],
    "load_image": [write_ros_map, write_image],
}
samples = pytest.mark.parametrize(
    "write", [write for writers in SAMPLES.values() for write in writers], ids=lambda write: write.__name__
)


def test_every_loader_has_a_sample() -> None:
    assert set(SAMPLES) == {name for name in vars(library) if name.startswith("load_")} - {"load_plan"}


class Pointer(os.PathLike[str]):
    """A path that is neither a text nor a `Path`, as `os.scandir` hands out."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __fspath__(self) -> str:
        return str(self._path)


@samples
def test_a_path_may_be_a_text(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path)
    load = next(getattr(library, name) for name, writers in SAMPLES.items() if write in writers)
    for read in (load, load_plan, library.cached_plan):
        assert len({read(given).content_hash for given in (path, str(path), Pointer(path))}) == 1
    assert library.find_plans([Pointer(path)]) == expand_plans(Pointer(path)) == [str(path)]
    assert Simulation(Pointer(path)).plan.name == load_plan(path).name
    save_plan(load_plan(path), Pointer(tmp_path / "again.geojson"))
    assert (tmp_path / "again.geojson").is_file()


@samples
def test_a_file_is_a_plan_twice_the_same(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    plan, again = load_plan(path), load_plan(str(path))
    assert plan.content_hash == again.content_hash and plan.rooms and plan.name and plan.building
    assert all(isinstance(v, str) for item in plan.metadata.items() for v in item)
    assert all(room.polygon.is_valid and room.polygon.area > 0 for room in plan.rooms)
    assert share_reached(plan) > 0.9
    assert expand_plans(path) == [str(path)] == expand_plans(tmp_path)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@samples
def test_a_plan_of_any_format_is_kept_as_geojson(write: Callable[[Path], Path], tmp_path: Path) -> None:
    plan = load_plan(write(tmp_path))
    save_plan(plan, tmp_path / "kept.geojson")
    kept = load_plan(tmp_path / "kept.geojson")
    assert (kept.name, kept.building, kept.metadata) == (plan.name, plan.building, plan.metadata)
    assert [(r.id, r.label, r.polygon.area) for r in kept.rooms] == [
        (r.id, r.label, r.polygon.area) for r in plan.rooms
    ]
    assert [(d.start, d.end, d.rooms, d.is_open) for d in kept.doors] == [
        (d.start, d.end, d.rooms, d.is_open) for d in plan.doors
    ]


@samples
@pytest.mark.parametrize("damage", [b"", b"\x00\xff nonsense"], ids=["empty", "nonsense"])
def test_damaged_files_are_named(write: Callable[[Path], Path], damage: bytes, tmp_path: Path) -> None:
    path = write(tmp_path)
    path.write_bytes(damage)
    with pytest.raises(MapError, match=path.stem):
        load_plan(path)
    path.unlink()
    with pytest.raises(MapError, match="no such file"):
        load_plan(path)
