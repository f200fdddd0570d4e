"""The whole way picture -> plan, and pictures that are none."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import ConfigError, LayoutExploreError, MapError, MapWarning, MissingExtraError
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps.geojson import save_plan
from layoutexplore.priors import reading
from layoutexplore.priors.evacuation_picture import PictureStyle, draw_evacuation_plan, picture_points
from layoutexplore.priors.plan import PriorHints, PriorPlan
from layoutexplore.priors.presets import study_prior
from layoutexplore.priors.reading import paper_share, prior_of_picture, read_prior
from tests.priors.cases import door_middles, office, seen_part


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


def test_rooms_below_zero_are_refused() -> None:
    minus = np.full((3, 2), -1, np.int32)
    with pytest.raises(MapError, match="the id -1"):
        draw_evacuation_plan(minus < 0, minus, 0.1, np.random.default_rng(0))
    with pytest.raises(MapError, match="the id -1"):
        PriorPlan(name="x", free=minus < 0, room_ids=minus, resolution=0.1)


@pytest.mark.parametrize("thick", [4, 5, 6])
def test_walls_as_thick_as_asked_for_stay_as_they_are(thick: int) -> None:
    ids = np.zeros((80, 120 + thick), np.int32)
    ids[10:-10, 10:60], ids[10:-10, 60 + thick : -10] = 1, 2
    style = PictureStyle(
        pixels_per_metre=10.0, wall=0.4, signs=0.0, numbers=False, routes=False, swings=False, legend=False
    )
    image = draw_evacuation_plan(ids > 0, ids, 0.1, np.random.default_rng(0), style=style)
    black = np.flatnonzero((image[20, 30:90] == 0).all(axis=1)) + 30
    assert black.tolist() == list(range(60, 60 + thick))


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


def test_a_scale_that_is_told_leaves_a_plan_of_single_lines_its_walls() -> None:
    inside = np.pad(office().rasterize(0.05).free[::-1].astype(np.uint8), 20)
    lines = (cv2.dilate(inside, np.ones((3, 3), np.uint8)) > 0) & (inside == 0)
    image = np.where(lines[..., None], np.uint8(0), np.full(3, 255, np.uint8))
    untold, told = (prior_of_picture(image, hints=PriorHints(scale=scale)).prior for scale in (None, 0.05))
    assert not told.unused and told.resolution == 0.05
    assert abs(told.rooms - untold.rooms) <= 2 and 8 <= told.rooms <= 14


def test_a_reading_of_words_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan is another one then: of two machines, or where memory was short."""

    def killed(*_: object) -> None:
        raise MissingExtraError("tesseract has failed")

    monkeypatch.setattr("layoutexplore.layout.blueprint.find_words", killed)
    with pytest.warns(MapWarning, match="words .* by their size alone: tesseract has failed") as caught:
        assert prior_of_picture(sheet(), name="wall.png").prior.rooms >= 8
    (said,) = (str(warning.message) for warning in caught)
    assert said.startswith("wall.png: "), "once, however often the picture is read"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert study_prior("rough", office(), 0).prior.rooms >= 8  # a study would say it in each run


def test_a_start_beside_the_plan_is_refused(tmp_path: Path) -> None:
    save_plan(office(), tmp_path / "plan.geojson")
    with pytest.raises(ConfigError, match=r"here: 900/3 lies outside of .*, in its metres: x is from 0"):
        read_prior(tmp_path / "plan.geojson", PriorHints(here=(900.0, 3.0)))
    picture = sheet()
    rows, cols, _ = picture.shape
    with pytest.raises(ConfigError, match=rf"outside of wall\.png, in its pixels: .* y from 0 to {rows}"):
        prior_of_picture(picture, name="wall.png", hints=PriorHints(here=(cols / 2, rows + 1.0)))


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("smaller", [1.0, 1.5])
def test_a_start_lies_in_its_room_however_large_the_picture(
    smaller: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    style, plan = PictureStyle(pixels_per_metre=24.0), office()
    image = sheet(style)
    monkeypatch.setattr(reading, "MOST_PIXELS", image.shape[0] * image.shape[1] / smaller**2)
    raster = plan.rasterize(0.1)
    for room in plan.rooms[1:]:
        middle = np.array([room.polygon.centroid.coords[0]]) - (raster.origin.x, raster.origin.y)
        x, y = picture_points(middle, round(raster.shape[0] * 2.4), style)[0]
        hints = PriorHints(here=(x, image.shape[0] - y), scale=1 / 24.0 if told else None)
        read = prior_of_picture(image, hints=hints)
        assert read.prior.hints.here is not None
        assert not told or read.pixels == pytest.approx(1 / 24.0)
        unit = 1.0 if told else read.pixels * 24.0
        col, row = (int(v / read.prior.resolution) for v in read.prior.hints.here)
        area = np.count_nonzero(read.prior.room_ids == read.prior.room_ids[row, col])
        assert area * read.prior.resolution**2 == pytest.approx(room.polygon.area * unit**2, rel=0.2)


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
    with pytest.raises(MapError, match=r"noise\.png.*shows no plan"):
        read_prior(tmp_path / "noise.png")


def picture_of_nature(mean: float) -> np.ndarray:
    """Coloured clouds, uint8 (300, 400, 3): amplitudes fall with the frequency, as in photos."""
    rng = np.random.default_rng(0)
    frequency = np.hypot(np.fft.fftfreq(300)[:, None], np.fft.rfftfreq(400))
    frequency[0, 0] = 1.0
    noise = [np.fft.irfft2(np.fft.rfft2(rng.normal(size=(300, 400))) / frequency, (300, 400)) for _ in "rgb"]
    return np.clip(np.stack([mean + 50 * n / n.std() for n in noise], axis=-1), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("mean", [60.0, 120.0, 180.0])
def test_a_photo_of_something_else_is_refused(mean: float, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "clouds.png"), picture_of_nature(mean))
    with pytest.raises(MapError, match=r"clouds\.png.*shows no plan.*is paper"):
        read_prior(tmp_path / "clouds.png")


def test_a_photo_of_a_plan_is_read() -> None:
    """Blurred, noisy, and lit from one side."""
    image = cv2.GaussianBlur(sheet(), (0, 0), 1.0) * np.linspace(0.8, 1.0, sheet().shape[1])[:, None]
    noisy = image + np.random.default_rng(0).normal(0.0, 5.0, image.shape)
    assert paper_share(np.clip(noisy, 0, 255).astype(np.uint8)) > 0.7
    assert prior_of_picture(np.clip(noisy, 0, 255).astype(np.uint8)).prior.rooms >= 8


def test_a_picture_of_one_room_is_not_used() -> None:
    image = np.full((600, 800, 3), 255, np.uint8)
    cv2.rectangle(image, (100, 100), (700, 500), (0, 0, 0), 8)
    assert "1 room" in prior_of_picture(image).prior.unused


def test_the_map_of_a_robot_without_rooms_tells_how_to_get_some(tmp_path: Path) -> None:
    path = tmp_path / "floor.yaml"
    save_grid(seen_part(office(), 1.0), path)
    told = read_prior(path).unused
    assert "it shows 1 room" in told and f"maps import {path} --out PLAN.geojson` makes a plan with" in told
    rooms = office().rasterize(0.1).room_ids
    cv2.imwrite(str(tmp_path / "floor_rooms.png"), rooms[::-1].astype(np.uint16))
    assert read_prior(path).unused == ""


def test_a_map_with_hardly_any_floor_is_named(tmp_path: Path) -> None:
    cells = np.full((40, 40), OCCUPIED, np.int8)
    cells[20, 20] = FREE
    save_grid(OccupancyGrid(cells, 0.01), tmp_path / "speck.yaml")
    with pytest.raises(MapError, match=r"speck\.yaml: plan 'speck' has no free space"):
        read_prior(tmp_path / "speck.yaml")


def test_a_scan_of_a_hundred_megapixels_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "huge.pgm"
    path.write_bytes(b"P5 10000 10000 255\n" + bytes(100))
    with pytest.raises(MapError, match="image_pixels"):
        read_prior(path)
    cv2.imwrite(str(tmp_path / "scan.png"), np.full((10000, 10000), 255, np.uint8))
    with pytest.raises(MapError, match=r"scan\.png: 10000 x 10000 pixels.*make it smaller"):
        read_prior(tmp_path / "scan.png")


def test_a_missing_file_says_so() -> None:
    with pytest.raises(LayoutExploreError, match="no such file"):
        read_prior("nowhere/plan.png")


@pytest.mark.parametrize(
    "scale, said", [(1e-4, r"all of it is .* and no building is"), (1e4, "m long at the")]
)
def test_a_scale_at_which_no_building_is_drawn_ends_the_reading(scale: float, said: str) -> None:
    read = prior_of_picture(sheet(), hints=PriorHints(scale=scale))
    assert re.search(said, read.prior.unused)


def test_a_large_picture_with_few_rooms_is_read_soon() -> None:
    image = np.full((1400, 2100, 3), 255, np.uint8)
    for x, y, right, low in ((0, 0, 1900, 1200), (950, 0, 0, 500), (950, 700, 0, 500)):
        cv2.rectangle(image, (100 + x, 100 + y), (100 + x + right, 100 + y + low), (0, 0, 0), 12)
    assert prior_of_picture(image).prior.rooms == 2
