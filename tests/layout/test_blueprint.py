"""Blueprints: walls stay, symbols, door swings and words go."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest

from layoutexplore.errors import ConfigError, MapError, MissingExtraError
from layoutexplore.layout import blueprint
from layoutexplore.layout.blueprint import BlueprintConfig, find_words, grid_from_blueprint, load_blueprint
from layoutexplore.layout.pipeline import reconstruct

SILENT = BlueprintConfig(words=False)


def plan():
    """Two rooms of 10 x 8 m, a door between them, one to the outside, an extinguisher, a swing, an arrow."""
    image = np.full((220, 460, 3), 255, np.uint8)
    cv2.rectangle(image, (30, 30), (430, 190), (90, 90, 90), 6)
    cv2.line(image, (230, 30), (230, 190), (90, 90, 90), 6)
    image[100:118, 225:236] = 255
    image[184:196, 60:78] = 255
    cv2.ellipse(image, (230, 118), (18, 18), 0, 180, 270, (120, 120, 120), 1)
    cv2.rectangle(image, (300, 60), (318, 84), (200, 30, 30), -1)
    cv2.arrowedLine(image, (350, 150), (400, 150), (40, 160, 80), 5)
    cv2.circle(image, (120, 150), 6, (20, 20, 20), -1)
    return image


def test_walls_stay_and_symbols_go():
    grid = grid_from_blueprint(plan(), 0.05, config=SILENT)
    cells = grid.cells[::-1]
    assert (cells[30, 60:400] == 100).all()
    for row, col in ((72, 309), (150, 375), (150, 120), (105, 215)):
        assert cells[row, col] == 0
    assert cells[5, 5] == -1 and cells[215, 455] == -1
    assert cells[109, 230] == 0
    assert len(reconstruct(grid, "rose2").rooms) == 2


@pytest.mark.parametrize("width", [4, 6, 8, 10])
def test_walls_lie_where_they_are_drawn(width):
    """Whether strokes are removed by a box of an even or an odd side."""
    image = np.full((220, 460, 3), 255, np.uint8)
    cv2.rectangle(image, (30, 30), (430, 190), (90, 90, 90), width)
    cv2.line(image, (230, 30), (230, 190), (90, 90, 90), width)
    occupied = grid_from_blueprint(image, 0.05, config=SILENT).occupied[::-1]
    assert np.array_equal(occupied, image[..., 0] < 255)


def test_templates_are_erased():
    image = plan()
    cv2.rectangle(image, (340, 80), (380, 100), (10, 10, 10), -1)
    mark = image[75:106, 335:386].copy()
    assert grid_from_blueprint(image, 0.05, config=SILENT).cells[::-1][90, 360] == 100
    assert grid_from_blueprint(image, 0.05, config=SILENT, templates=[mark]).cells[::-1][90, 360] == 0


def test_door_swings_go_where_the_scale_makes_their_strokes_wide():
    """At 0.1 m a pixel a stroke of one pixel is as wide as a wall may be."""
    image = plan()
    cv2.ellipse(image, (230, 118), (18, 18), 0, 180, 270, (60, 60, 60), 1)
    cv2.line(image, (212, 118), (230, 118), (60, 60, 60), 1)
    cells = grid_from_blueprint(image, 0.1, config=BlueprintConfig(words=False, symbol_size=3.0)).cells[::-1]
    assert (cells[98:122, 205:224] == 0).all()
    assert (cells[30, 60:400] == 100).all() and cells[60, 230] == 100


def test_dark_symbols_with_a_tint_go_and_the_wall_behind_them_stays():
    image = plan()
    for left in (280, 310, 340):
        cv2.rectangle(image, (left, 26), (left + 24, 50), (90, 45, 45), -1)
        cv2.circle(image, (left + 12, 38), 5, (255, 255, 255), -1)
    cv2.line(image, (230, 30), (430, 30), (20, 20, 20), 6)
    cv2.rectangle(image, (30, 30), (430, 190), (20, 20, 20), 6)
    cv2.rectangle(image, (310, 26), (334, 50), (90, 45, 45), -1)  # hides the wall
    cells = grid_from_blueprint(image, 0.05, config=SILENT).cells[::-1]
    assert (cells[36:52, 270:370] == 0).all()
    assert (cells[30, 60:400] == 100).all()


def test_a_thin_line_across_a_gate_keeps_the_outside_out():
    image = plan()
    image[184:196, 60:180] = 255  # a gate of 6 m
    cv2.line(image, (60, 190), (180, 190), (90, 90, 90), 1)
    cells = grid_from_blueprint(image, 0.05, config=SILENT).cells[::-1]
    assert cells[120, 100] == 0 and cells[210, 100] == -1


def test_a_missing_ocr_is_named(monkeypatch):
    def absent(module, extra):
        raise MissingExtraError(f"{module} is not installed: pip install 'layoutexplore[{extra}]'")

    monkeypatch.setattr(blueprint, "require", absent)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[blueprint\]"):
        grid_from_blueprint(plan(), 0.05)


def test_words_are_found_and_erased():
    pytest.importorskip("pytesseract")
    if shutil.which("tesseract") is None:
        pytest.skip("tesseract is not installed")
    image = plan()
    cv2.putText(image, "Reading", (255, 130), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (20, 20, 20), 3, cv2.LINE_AA)
    boxes = find_words(image, BlueprintConfig())
    assert any(left < 300 < left + width and top < 120 < top + height for top, left, height, width in boxes)
    cells = grid_from_blueprint(image, 0.05).cells[::-1]
    assert (cells[108:132, 260:360] == 0).all()


def test_walls_that_are_taken_for_words_stay(monkeypatch):
    image = plan()
    without_words = grid_from_blueprint(image, 0.05, config=SILENT)
    height, width = image.shape[:2]
    found = [(0, 0, 25, width), (0, 0, height, width)]
    monkeypatch.setattr(blueprint, "find_words", lambda image, config: found)
    assert (grid_from_blueprint(image, 0.05).cells == without_words.cells).all()


def test_words_that_take_no_end_are_given_up(tmp_path, monkeypatch):
    pytesseract = pytest.importorskip("pytesseract")
    program = tmp_path / "tesseract"
    program.write_text('#!/bin/sh\n[ "$1" = --version ] && echo tesseract 5.3.0 && exit\nexec sleep 60\n')
    program.chmod(0o755)
    monkeypatch.setattr(pytesseract.pytesseract, "tesseract_cmd", str(program))
    monkeypatch.setattr(blueprint, "_SECONDS", 0.2)
    with pytest.raises(MissingExtraError, match=r"found no end within 0\.2 s"):
        find_words(plan(), BlueprintConfig())


def test_unusable_pictures_are_refused(tmp_path):
    with pytest.raises(MapError, match="no walls"):
        grid_from_blueprint(np.full((50, 50, 3), 255, np.uint8), 0.05, config=SILENT)
    with pytest.raises(MapError, match="RGB"):
        grid_from_blueprint(np.zeros((5, 5), np.uint8), 0.05, config=SILENT)
    with pytest.raises(MapError, match="cannot read"):
        load_blueprint(tmp_path / "missing.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(MapError, match="not an image"):
        load_blueprint(tmp_path / "text.png")
    with pytest.raises(ConfigError):
        BlueprintConfig(magnification=0)


def test_every_kind_of_picture_is_read_alike_and_errors_name_it(tmp_path):
    grey = cv2.cvtColor(plan(), cv2.COLOR_RGB2GRAY)
    clear = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA)
    clear[grey == 255] = 0  # paper as transparent black
    kinds = {
        "grey": grey,
        "deep": grey.astype(np.uint16) * 257,
        "colour": cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR),
        "clear": clear,
    }
    expected = grid_from_blueprint(kinds["colour"], 0.05, config=SILENT).cells
    for name, image in kinds.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
        assert np.array_equal(load_blueprint(tmp_path / f"{name}.png", config=SILENT).cells, expected), name
    cv2.imwrite(str(tmp_path / "paper.png"), np.full((50, 50), 255, np.uint8))
    with pytest.raises(MapError, match=r"paper\.png: the blueprint shows no walls"):
        load_blueprint(tmp_path / "paper.png", config=SILENT)


def test_evacuation_plans_have_rooms(data_dir):
    paths = sorted((data_dir / "blueprints").glob("*.png"))
    assert paths
    for path in paths:
        assert len(reconstruct(load_blueprint(path, config=SILENT), "rose2").rooms) >= 8
