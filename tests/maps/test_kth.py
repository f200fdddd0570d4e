"""Floors of the KTH campus."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.maps import load_plan
from tests.maps.cases import share_reached, write_kth


def test_kth_outside_and_hollow_walls_are_solid(tmp_path: Path) -> None:
    path = write_kth(tmp_path)
    for each in (path, path.with_name("50_PLAN1_rooms.png")):
        plan = load_plan(each)
        assert (plan.name, plan.building) == ("50_PLAN1", "50")
        assert len(plan.rooms) == 2
        (door,) = plan.doors
        assert door.rooms == (1, 2)
        assert door.width == pytest.approx(0.9, abs=0.11)
        assert share_reached(plan) == 1.0
        raster = plan.rasterize(0.05)
        assert raster.free.sum() == pytest.approx(76 * 76 + 76 * 74 + 18 * 6, abs=45)
        assert raster.occupied[raster.world_to_cell(0.5, 0.5)]


def test_bad_kth(tmp_path: Path) -> None:
    path = write_kth(tmp_path)
    rooms = path.with_name("50_PLAN1_rooms.png")
    cv2.imwrite(str(rooms), np.ones((5, 5), np.uint8))
    with pytest.raises(MapError, match="do not fit"):
        load_plan(path)
    cv2.imwrite(str(rooms), np.zeros((120, 200), np.uint8))
    with pytest.raises(MapError, match="no room"):
        load_plan(path)
    rooms.write_bytes(b"nonsense")
    with pytest.raises(MapError, match="not an image"):
        load_plan(path)


def test_kth_floors(data_dir: Path) -> None:
    meta = json.loads((data_dir / "floorplans" / "kth" / "meta.json").read_text())
    paths = sorted((data_dir / "floorplans" / "kth").glob("*_occ.png"))
    assert len(paths) == 7
    for path in paths:
        plan = load_plan(path)
        facts = meta[plan.name]
        assert len(plan.rooms) == facts["rooms"]
        raster = plan.rasterize(0.1)
        assert raster.free.sum() * 0.01 == pytest.approx(facts["indoor_free_m2"], rel=0.03)
        assert share_reached(plan) >= 0.92, path.name  # 50010536_PLAN3 has a hall without a door
        assert len(plan.doors) >= 0.9 * len(plan.rooms)


def test_a_thousand_stripes_are_told_apart(tmp_path: Path) -> None:
    stripes = np.broadcast_to(np.arange(2000) // 2 * (np.arange(2000) % 2), (1500, 2000)).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "bars_occ.png"), np.full(stripes.shape, 255, np.uint8))
    cv2.imwrite(str(tmp_path / "bars_rooms.png"), stripes)
    load_plan(write_kth(tmp_path))  # kernels compile
    assert len(load_plan(tmp_path / "bars_occ.png").rooms) == 999
