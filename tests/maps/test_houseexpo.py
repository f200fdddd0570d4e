"""HouseExpo plans."""

from __future__ import annotations

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
