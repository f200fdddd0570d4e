"""HouseExpo plans."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from layoutexplore.errors import MapError
from layoutexplore.maps import load_plan
from tests.maps.cases import share_reached, write_houseexpo


def test_houseexpo_with_and_without_rooms(tmp_path: Path) -> None:
    path = write_houseexpo(tmp_path)
    plan = load_plan(path)
    assert [room.label for room in plan.rooms] == ["living room", "kitchen"]
    assert plan.doors[0].rooms == (1, 2)
    assert plan.area == pytest.approx(18 - 0.2, abs=0.01)
    assert share_reached(plan) == 1.0
    assert share_reached(plan.with_doors_closed([0])) < 0.6
    (tmp_path / "house.label_data.json").unlink()
    assert len(load_plan(path).rooms) == 1


@pytest.mark.parametrize(
    "thing", ["[]", "{", '{"verts": 3}', '{"verts": [[0, 0], [1, NaN], [1, 1]]}', '{"verts": [[0, 0]]}']
)
def test_bad_houseexpo(tmp_path: Path, thing: str) -> None:
    (tmp_path / "bad.json").write_text(thing)
    with pytest.raises(MapError, match=r"bad\.json"):
        load_plan(tmp_path / "bad.json")


def test_bad_houseexpo_rooms(tmp_path: Path) -> None:
    path = write_houseexpo(tmp_path)
    (tmp_path / "house.label_data.json").write_text('{"areas": [], "door": [[1, 2]]}')
    with pytest.raises(MapError, match=r"door\[0\]"):
        load_plan(path)


def test_labels_of_a_contour_with_thousands_of_corners_are_counted(tmp_path: Path) -> None:
    """Each label's box is cut by the contour."""
    turns = [[round(0.02 * k, 2), 5 + 4 * ((k // 2) % 2)] for k in range(20_000)]
    boxes = {"Room": [[0, 0, 300, 5 + 0.01 * k] for k in range(2000)]}
    path = tmp_path / "comb.json"
    path.write_text(json.dumps({"verts": [[0, 0], *turns, [400, 0]], "room_category": boxes}))
    with pytest.raises(MapError, match="comparing rooms, labels and doors takes"):
        load_plan(path)
    path.write_text(
        json.dumps({"verts": [[0.01 * k, 20 * (k % 2)] for k in range(9000)] + [[90, 30], [0, 30]]})
    )
    with pytest.raises(MapError, match="pairs of edges lie within"):
        load_plan(path)
