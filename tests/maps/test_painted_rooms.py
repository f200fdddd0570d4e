"""Maps with painted rooms: what they are called, how large they are, which are of one building."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.evaluation.segmentation import score_case
from layoutexplore.maps.painted_rooms import find_cases, read_case, read_scales


def paint(folder: Path, name: str, wall: int = 40, free: int = 254) -> None:
    """A flat of two rooms beside each other and its truth, the wall at a column."""
    folder.mkdir(parents=True, exist_ok=True)
    image = np.full((60, 90), 205, np.uint8)
    image[5:55, 5:85] = 0
    truth = np.zeros(image.shape, np.uint8)
    for room, (left, right) in enumerate(((8, wall), (wall + 3, 82)), start=1):
        image[8:52, left:right], truth[8:52, left:right] = free, 100 * room
    cv2.imwrite(str(folder / f"{name}.png"), image)
    cv2.imwrite(str(folder / f"{name}_gt.png"), truth)


def test_folders_of_one_name_are_told_apart_and_a_folder_counts_once(tmp_path: Path) -> None:
    for k, place in enumerate(("a/maps", "b/maps", "c/b/maps", "other")):
        paint(tmp_path / place, "flat1", 30 + 4 * k)
    maps = [tmp_path / place for place in ("a/maps", "other", "b/maps", "c/../a/maps")]
    assert [case.folder for case in find_cases(maps)] == ["a/maps", "other", "b/maps"]
    deep = find_cases([tmp_path / "b/maps", tmp_path / "c/b/maps"])
    assert [case.folder for case in deep] == [f"{tmp_path.name}/b/maps", "c/b/maps"]
    told = find_cases(maps[:3], {"a/maps/flat1": "castle", "flat1": "barn"})
    assert [case.building for case in told] == ["castle", "barn", "barn"]


def test_an_index_says_the_scale_before_the_resolution_does(tmp_path: Path) -> None:
    for k, name in enumerate(("one", "two")):
        paint(tmp_path, name, 40 + k)
    (tmp_path / "index.csv").write_text("file,m_per_px\none.png,0.025\ntwo.png,\n")
    cases = find_cases([tmp_path])
    assert [read_case(case, 0.1)[0].resolution for case in cases] == [0.025, 0.1]
    (tmp_path / "index.csv").write_text("File, m_per_px\nother.png,NA\n\ntwo.png, 0.5\nshort\n")
    assert [case.resolution for case in find_cases([tmp_path])] == [None, 0.5]
    (tmp_path / "index.csv").write_text("file,m_per_px\none.png,-1\n")
    with pytest.raises(MapError, match="m_per_px"):
        find_cases([tmp_path])


def test_maps_with_the_same_pixels_are_of_one_building(tmp_path: Path) -> None:
    for folder, name, wall in (("x", "map15", 40), ("x", "map23", 44), ("y", "tower", 40), ("y", "mill", 50)):
        paint(tmp_path / folder, name, wall)
    # another file with the same pixels
    same = cv2.imread(str(tmp_path / "y" / "tower.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "y" / "tower.png"), same, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    cases = {case.name: case for case in find_cases([tmp_path / "x", tmp_path / "y"])}
    assert {name: case.building for name, case in cases.items()} == {
        "map15": "tower",
        "map23": "tower",
        "tower": "tower",
        "mill": "mill",
    }
    assert [name for name, case in cases.items() if case.is_guess] == ["map15", "map23"]


def test_a_map_whose_free_space_is_too_dark_to_count_is_refused(tmp_path: Path) -> None:
    paint(tmp_path, "dark", free=240)
    paint(tmp_path, "light", 44, free=254)
    dark, light = find_cases([tmp_path])
    with pytest.raises(
        MapError, match=r"dark\.png: .* from grey 250 on, and only 0 of \d+ .* paint free space 254"
    ):
        score_case(dark, "doorways", protocol="bormann", resolution=0.05)
    assert score_case(light, "doorways", protocol="bormann", resolution=0.05)[0].segments >= 1
    assert read_case(dark, 0.05)[0].free.any(), "to learn from it may be dark"


def test_a_truth_of_16_bit_holds_numbers_of_rooms(tmp_path: Path) -> None:
    paint(tmp_path, "flat")
    plain = read_case(find_cases([tmp_path])[0], 0.05)[1]
    truth = cv2.imread(str(tmp_path / "flat_gt.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "flat_gt.png"), (truth // 100).astype(np.uint16))
    assert np.array_equal(read_case(find_cases([tmp_path])[0], 0.05)[1], plain)
    cv2.imwrite(str(tmp_path / "flat_gt.png"), np.zeros(truth.shape, np.uint16))
    with pytest.raises(MapError, match="no room is painted"):
        read_case(find_cases([tmp_path])[0], 0.05)


def test_a_scale_that_is_none_is_told_shortly(tmp_path: Path) -> None:
    (tmp_path / "index.csv").write_text(f"file,m_per_px\nmap.png,0x{'f' * 9000}\n")
    with pytest.raises(MapError, match=r"index\.csv: m_per_px of map\.png is no number: '0xf") as told:
        read_scales(tmp_path / "index.csv", ["map.png"])
    assert len(str(told.value)) < 600
