"""What is said about a picture, and what is read of it."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import ConfigError, MapError, MapWarning, MissingExtraError
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.importing.pictures import PictureConfig, picture_config, read_picture
from layoutexplore.layout import blueprint
from tests.importing.cases import office, write_ros_map


def test_words_of_a_command_line() -> None:
    assert picture_config() == PictureConfig()
    assert picture_config(scale_by="50 cm = 10 px").resolution == pytest.approx(0.05)
    assert picture_config(unknown_grey="none").unknown_grey == "none"
    assert picture_config(unknown_grey="7").unknown_grey == 7
    for word in ("256", "-1", "grey", ""):
        with pytest.raises(ConfigError, match="--unknown-grey"):
            picture_config(unknown_grey=word)
    with pytest.raises(ConfigError, match="one of them"):
        picture_config(resolution=0.05, scale_by="1 m = 20 px")
    with pytest.raises(MapError, match="resolution"):
        picture_config(resolution=-1.0)


def test_a_picture_on_white_paper_has_no_floor_outside(tmp_path: Path) -> None:
    paper = office(unknown=255, free=255)
    paper[154:158, 100:118] = 255  # the front door
    cv2.imwrite(str(tmp_path / "plan.png"), paper)
    grid = read_picture(tmp_path / "plan.png")
    assert grid.free_area == pytest.approx((3 * 76 * 78 + 40 * 242 + 4 * 4 * 18) * 0.05**2, rel=0.02)
    kept = read_picture(tmp_path / "plan.png", PictureConfig(keep_outside=True))
    assert kept.free_area > grid.free_area + 50


def test_the_unknown_of_a_ros_map(tmp_path: Path) -> None:
    path = write_ros_map(tmp_path, office())
    with pytest.warns(MapWarning, match="205"):
        seen = read_picture(path)
    assert seen.free_area == pytest.approx((3 * 76 * 78 + 40 * 242 + 3 * 4 * 18) * 0.05**2)
    assert read_picture(path, PictureConfig(unknown_grey="none", keep_outside=True)).free_area > 140
    with pytest.raises(MapError, match="no blueprint"):
        read_picture(path, PictureConfig(blueprint=True))


def test_a_ros_map_of_probabilities_has_floor_and_walls(tmp_path: Path) -> None:
    cells = np.array([[90, 90, 90], [90, 8, 40], [-1, 90, 90]], np.int8)
    save_grid(OccupancyGrid(cells, 0.05), tmp_path / "soft.yaml", mode="scale")
    read = read_picture(tmp_path / "soft.yaml", PictureConfig(keep_outside=True))
    assert read.cells.tolist() == [[100, 100, 100], [100, 0, -1], [-1, 100, 100]]


def test_a_blueprint_is_read_without_its_ocr(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(module: str, extra: str) -> None:
        raise MissingExtraError(f"{module} is not installed")

    monkeypatch.setattr(blueprint, "require", absent)
    cv2.imwrite(str(tmp_path / "plan.png"), office(unknown=255, free=255))
    with pytest.warns(MapWarning, match="words are erased by their size"):
        grid = read_picture(tmp_path / "plan.png", PictureConfig(blueprint=True))
        kept = read_picture(tmp_path / "plan.png", PictureConfig(blueprint=True, keep_outside=True))
    assert grid.unknown[0, 0] and grid.free[100, 60]
    assert kept.free[0, 0] and np.array_equal(kept.occupied, grid.occupied)
    assert np.isclose(grid.resolution, 0.05)


def test_of_a_folder_a_map_inside_it_is_asked_for(tmp_path: Path) -> None:
    """As `explore --out` leaves one."""
    with pytest.raises(MapError, match=r"is a folder: name one map inside it$"):
        read_picture(tmp_path)
    path = write_ros_map(tmp_path, np.full((9, 9), 254, np.uint8))
    with pytest.raises(MapError, match=rf"is a folder: name one map inside it, as {re.escape(str(path))}$"):
        read_picture(tmp_path)
