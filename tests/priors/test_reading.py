"""The whole way picture -> plan, and pictures that are none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import LayoutExploreError, MapError
from layoutexplore.priors.evacuation_picture import PictureStyle, draw_evacuation_plan, picture_points
from layoutexplore.priors.plan import PriorHints
from layoutexplore.priors.reading import prior_of_picture, read_prior
from tests.priors.cases import door_middles, office


def sheet(style: PictureStyle | None = None) -> np.ndarray:
    raster = office().rasterize(0.1)
    return draw_evacuation_plan(
        raster.free, raster.room_ids, 0.1, np.random.default_rng(0), style=style or PictureStyle()
    )


def test_a_picture_has_all_that_hangs_on_a_wall() -> None:
    image = sheet()
    colours = {tuple(c) for c in np.unique(image.reshape(-1, 3), axis=0).tolist()}
    assert {
        (0, 0, 0),
        (255, 255, 255),
        (205, 25, 30),
        (0, 150, 70),
        (20, 70, 190),
        (222, 243, 226),
    } <= colours
    assert np.array_equal(image, sheet())
    plain = sheet(PictureStyle(signs=0.0, numbers=False, routes=False, swings=False, legend=False))
    assert plain.shape[0] < image.shape[0] and (plain == 0).all(axis=2).sum() < (image == 0).all(axis=2).sum()


def test_the_picture_is_read_back() -> None:
    style, raster = PictureStyle(), office().rasterize(0.1)
    read = prior_of_picture(sheet())
    prior = read.prior
    assert 8 <= prior.rooms <= 14 and not prior.unused
    assert 0.6 < read.pixels * style.pixels_per_metre < 1.6
    height = round(raster.shape[0] * style.pixels_per_metre * 0.1)
    doors = door_middles(office()) - (raster.origin.x, raster.origin.y)
    pixels = picture_points(doors, height, style)
    left, bottom = read.corner
    at = np.floor(np.stack([pixels[:, 0] - left, bottom - pixels[:, 1]], 1) * read.pixels / prior.resolution)
    assert prior.free[at[:, 1].astype(int), at[:, 0].astype(int)].mean() >= 0.8


def test_a_told_scale_is_kept() -> None:
    read = prior_of_picture(sheet(), hints=PriorHints(scale=1 / 16))
    assert read.pixels == pytest.approx(1 / 16) and read.prior.scale_spread < 0.05


def test_a_file_is_read_by_what_it_is(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "plan.png"), sheet()[..., ::-1])
    assert read_prior(tmp_path / "plan.png").rooms >= 8
    assert read_prior("office-01").name == "office-01"


def test_a_photo_without_a_plan_says_so(tmp_path: Path) -> None:
    bright = np.full((300, 400, 3), 230, np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), bright)
    with pytest.raises(MapError, match=r"photo\.png.*no walls"):
        read_prior(tmp_path / "photo.png")
    noise = np.random.default_rng(0).integers(0, 256, (300, 400, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "noise.png"), noise)
    try:
        assert read_prior(tmp_path / "noise.png").unused
    except LayoutExploreError as error:
        assert "noise.png" in str(error)


def test_a_scan_of_a_hundred_megapixels_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "huge.pgm"
    path.write_bytes(b"P5 10000 10000 255\n" + bytes(100))
    with pytest.raises(MapError, match="image_pixels"):
        read_prior(path)


def test_a_missing_file_says_so() -> None:
    with pytest.raises(LayoutExploreError, match="no such file"):
        read_prior("nowhere/plan.png")
