"""Occupancy grids on disk: ROS maps, plain images, and what is unknown in them."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.ros_map import grid_from_image, images_of, load_grid, save_grid

TRINARY = arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([-1, 0, 100])
)
PERCENT = arrays(np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 100))


def write_map(folder: Path, pixels: NDArray[np.uint8], text: str = "") -> Path:
    cv2.imwrite(str(folder / "map.png"), pixels)
    path = folder / "map.yaml"
    path.write_text(text or "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(TRINARY, st.floats(0.01, 2.0), st.tuples(*[st.floats(-50, 50)] * 3))
def test_trinary_round_trip(
    tmp_path: Path, cells: NDArray[np.int8], resolution: float, origin: tuple[float, float, float]
) -> None:
    grid = OccupancyGrid(cells, resolution, Pose(*origin))
    save_grid(grid, tmp_path / "map.yaml")
    loaded = load_grid(tmp_path / "map.yaml")
    assert np.array_equal(loaded.cells, cells)
    assert (loaded.resolution, loaded.origin) == (grid.resolution, grid.origin)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(PERCENT, st.sampled_from(["scale", "raw"]))
def test_every_value_survives_scale_and_raw(tmp_path: Path, cells: NDArray[np.int8], mode: str) -> None:
    save_grid(OccupancyGrid(cells, 0.05), tmp_path / mode, mode=mode)
    assert (tmp_path / f"{mode}.png").is_file()
    assert np.array_equal(load_grid(tmp_path / f"{mode}.yaml").cells, cells)


def test_the_mode_may_be_written_in_capitals(tmp_path: Path) -> None:
    raw = write_map(tmp_path, np.array([[0, 60], [100, 255]], np.uint8))
    for mode in ("raw", "Raw", "RAW"):
        raw.write_text(f"image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\nmode: {mode}\n")
        assert load_grid(raw).cells.tolist() == [[100, -1], [0, 60]]


def test_what_is_written(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.array([[0, 100], [-1, 30]], np.int8), 0.05)
    save_grid(grid, tmp_path / "hall.yaml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hall.pgm", "hall.yaml"]
    pixels = cv2.imread(str(tmp_path / "hall.pgm"), cv2.IMREAD_UNCHANGED)
    assert pixels.tolist() == [[205, 205], [254, 0]]
    assert "resolution: 0.05" in (tmp_path / "hall.yaml").read_text()


def test_thresholds_as_in_nav2(tmp_path: Path) -> None:
    """Occupied from occupied_thresh on, free up to free_thresh; both ends belong to the classes."""
    levels = np.array(
        [[0, 51, 102, 127, 153, 204, 255]], np.uint8
    )  # occupancy 1, 0.8, 0.6, 0.502, 0.4, 0.2, 0
    text = "image: map.png\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.8\nfree_thresh: 0.2\n"
    assert load_grid(write_map(tmp_path, levels, text)).cells.tolist() == [[100, 100, -1, -1, -1, 0, 0]]
    scale = load_grid(write_map(tmp_path, levels, text + "mode: scale\n")).cells.tolist()
    assert scale == [[100, 100, 67, 50, 33, 0, 0]]
    raw = load_grid(write_map(tmp_path, levels, text + "mode: raw\n")).cells.tolist()
    assert raw == [[0, 51, -1, -1, -1, -1, -1]]


def test_negate_origin_and_rows(tmp_path: Path) -> None:
    text = "image: map.png\nresolution: 0.5\norigin: [1.5, -2, 0.25]\nnegate: 1\n"
    grid = load_grid(write_map(tmp_path, np.array([[255, 0], [0, 0]], np.uint8), text))
    assert grid.cells.tolist() == [[0, 0], [100, 0]]  # the image's top row is the last row
    assert grid.origin == Pose(1.5, -2.0, 0.25)
    with pytest.warns(MapWarning, match="yaw of the origin is -nan and is read as 0"):
        assert load_grid(write_map(tmp_path, grid.cells, text.replace("0.25", "-nan"))).origin == (1.5, -2, 0)


def test_transparent_is_unknown(tmp_path: Path) -> None:
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 1, 3] = 0
    assert load_grid(write_map(tmp_path, pixels)).cells.tolist() == [[0, -1]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: [map.png\n", "broken YAML"),
        ("just words", "needs the entries"),
        ("image: map.png\norigin: [0, 0, 0]\n", "'resolution' is missing"),
        ("image: other.png\nresolution: 0.1\norigin: [0, 0, 0]\n", "cannot read the image"),
        ("image: map.png\nresolution: 0\norigin: [0, 0, 0]\n", "resolution must be above 0"),
        ("image: map.png\nresolution: -0.05\norigin: [0, 0, 0]\n", "resolution must be above 0"),
        ("image: map.png\nresolution: .nan\norigin: [0, 0, 0]\n", "resolution must be a finite number"),
        ("image: map.png\nresolution: wide\norigin: [0, 0, 0]\n", "resolution must be a finite number"),
        ("image: map.png\nresolution: 0.1\norigin: [0, 0]\n", "origin must be"),
        ("image: map.png\nresolution: 0.1\norigin: [0, 0, .inf]\n", "origin must be a finite number"),
        ("image: map.png\nresolution: 0.1\norigin: [0, 0, 0]\nmode: fuzzy\n", "mode must be one of"),
        (
            "image: map.png\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.1\n",
            "free_thresh < occupied_thresh",
        ),
    ],
)
def test_bad_yaml_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = write_map(tmp_path, np.zeros((3, 3), np.uint8), text)
    with pytest.raises(MapError, match=message) as caught:
        load_grid(path)
    assert str(tmp_path) in str(caught.value)


def saved_by_nav2(folder: Path, *, free_thresh: float = 0.25) -> Path:
    """A building in the unknown, as ROS 2's map_saver writes it."""
    text = f"image: map.png\nmode: trinary\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: {free_thresh}\n"
    return write_map(folder, building(205), text)


def test_the_unknown_of_map_saver_is_no_floor(tmp_path: Path) -> None:
    with pytest.warns(MapWarning, match="205 is read as unknown"):
        grid = load_grid(saved_by_nav2(tmp_path))
    assert np.array_equal(grid.cells, grid_from_image(building(205), 0.05).cells)
    by_thresholds = load_grid(saved_by_nav2(tmp_path), unknown_grey="none")
    assert not by_thresholds.unknown.any() and by_thresholds.free_area > 2 * grid.free_area


def test_painted_free_space_does_not_hide_the_unknown(tmp_path: Path) -> None:
    path, painted = saved_by_nav2(tmp_path), building(205)
    painted[40:60, 40:60] = 255
    painted[50, 50:60] = 128  # an antialiased stroke
    cv2.imwrite(str(tmp_path / "map.png"), painted)
    with pytest.warns(MapWarning):
        assert load_grid(path).cells[0, 0] == -1


def test_a_map_of_many_levels_keeps_its_thresholds(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    text = "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: 0.25\n"
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    grid = load_grid(write_map(tmp_path, ramp, text))
    assert grid.cells[0, 205] == 0 and not recwarn.list
    assert load_grid(tmp_path / "map.yaml", unknown_grey=205).cells[0, 204:207].tolist() == [0, -1, 0]
    assert load_grid(saved_by_nav2(tmp_path, free_thresh=0.196)).cells[0, 0] == -1 and not recwarn.list


def test_the_unknown_level_of_an_image_can_be_said(tmp_path: Path) -> None:
    image = building(205)
    image[34:106, 92:146] = 240  # a lighter room
    cv2.imwrite(str(tmp_path / "a.png"), image)
    assert load_grid(tmp_path / "a.png", unknown_grey=240).cells[70, 100] == -1
    assert not load_grid(tmp_path / "a.png", unknown_grey="none").unknown.any()
    with pytest.raises(MapError, match="unknown_grey"):
        load_grid(tmp_path / "a.png", unknown_grey=300)


@pytest.mark.parametrize("named", ["/home/somebody/maps/map.png", "../old/map.png", "C:\\\\maps\\\\map.png"])
def test_an_image_that_has_moved_is_found_beside_its_yaml(tmp_path: Path, named: str) -> None:
    (tmp_path / "old").mkdir()
    cv2.imwrite(str(tmp_path / "old" / "map.png"), np.zeros((9, 9), np.uint8))
    (tmp_path / "here").mkdir()
    path = write_map(
        tmp_path / "here", building(205), f'image: "{named}"\nresolution: 0.1\norigin: [0, 0, 0]\n'
    )
    with pytest.warns(MapWarning, match=r"reads map\.png beside it"):
        assert load_grid(path).shape == building(205).shape


def test_an_image_stays_in_the_folder_of_its_yaml_unless_allowed(tmp_path: Path) -> None:
    (tmp_path / "here" / "images").mkdir(parents=True)
    for place in ("outside.png", "here/images/inside.png"):
        cv2.imwrite(str(tmp_path / place), building(205))
    text = "image: {}\nresolution: 0.1\norigin: [0, 0, 0]\n"
    path = tmp_path / "here" / "map.yaml"
    for named in ("../outside.png", str(tmp_path / "outside.png"), "images/../../outside.png"):
        path.write_text(text.format(named))
        with pytest.raises(MapError, match="lies in another folder"):
            load_grid(path)
        assert load_grid(path, image_anywhere=True).free.any()
    for named in ("images/inside.png", str(tmp_path / "here" / "images" / "inside.png")):
        path.write_text(text.format(named))
        assert load_grid(path).free.any()


def test_images_are_read_by_versions_of_opencv_without_its_logging(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_map(tmp_path, building(205))
    monkeypatch.delattr(cv2.utils, "logging", raising=False)
    assert load_grid(path).free.any()
    levels = [5]
    monkeypatch.setattr(cv2, "setLogLevel", lambda level: levels.append(level) or levels[-2], raising=False)
    assert load_grid(path).free.any() and levels == [5, 0, 5]


def test_bad_images_and_options(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("this is no image")
    (tmp_path / "empty.png").write_bytes(b"")
    whole = cv2.imencode(".png", np.zeros((50, 50), np.uint8))[1].tobytes()
    (tmp_path / "cut.png").write_bytes(whole[:30])
    for name in ("text.png", "empty.png", "cut.png"):
        with pytest.raises(MapError, match=name):
            load_grid(tmp_path / name)
    with pytest.raises(MapError, match="cannot read"):
        load_grid(tmp_path / "absent.pgm")
    with pytest.raises(MapError, match="cannot read"):
        load_grid(tmp_path / "absent.yaml")
    for resolution in (0.0, -1.0, math.nan):
        with pytest.raises(MapError, match="resolution"):
            load_grid(tmp_path / "text.png", resolution=resolution)
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), 0.1)
    with pytest.raises(MapError, match="mode"):
        save_grid(grid, tmp_path / "x", mode="fuzzy")
    (tmp_path / "file").write_text("")
    with pytest.raises(MapError, match="cannot write"):
        save_grid(grid, tmp_path / "file" / "x")
    with pytest.raises(MapError, match="uint8"):
        grid_from_image(np.zeros((2, 2), np.float32), 0.1)  # type: ignore[arg-type]


def building(unknown: int, *, wall: int = 0, free: int = 254) -> NDArray[np.uint8]:
    """A building of 6 x 4 m at 0.05 m with two rooms, a door, and a room that was never entered."""
    image = np.full((140, 180), unknown, np.uint8)
    image[30:110, 30:150] = wall
    image[34:106, 34:88] = image[34:106, 92:146] = free
    image[60:80, 88:92] = free
    image[90:100, 140:149] = unknown  # seen past a corner: nothing is known of it
    return image


@pytest.mark.parametrize("unknown", [205, 230, 153, 178, 180, 204, 127, 103])
def test_any_mid_grey_can_be_the_unknown(unknown: int) -> None:
    grid, expected = grid_from_image(building(unknown), 0.05), grid_from_image(building(205), 0.05)
    assert np.array_equal(grid.cells, expected.cells)
    assert grid.cells[-1, 0] == -1
    assert grid.cells[139 - 95, 145] == -1
    assert grid.cells[139 - 32, 100] == 100


@settings(deadline=None, max_examples=30)
@given(
    st.integers(0, 255),
    st.lists(st.tuples(st.integers(0, 20), st.integers(0, 179)), min_size=1, max_size=8),
    st.data(),
)
def test_stray_pixels_change_nothing_else(
    level: int, spots: list[tuple[int, int]], data: st.DataObject
) -> None:
    unknown = data.draw(st.sampled_from([205, 153, 230]))
    image = building(unknown)
    clean = grid_from_image(image, 0.05).cells
    stray = np.zeros(image.shape, np.bool_)
    stray[tuple(np.transpose(spots))] = True
    image[stray] = level
    cells = grid_from_image(image, 0.05).cells
    assert np.array_equal(cells[~stray[::-1]], clean[~stray[::-1]])
    if 90 <= level <= 230:  # a mid-grey speck out in the unknown is nothing
        assert (cells[stray[::-1]] == -1).all()


def test_furniture_of_a_grey_near_the_unknown_is_occupied() -> None:
    image = building(205)
    image[40:52, 40:60] = 211
    grid = grid_from_image(image, 0.05)
    assert (grid.cells[::-1][40:52, 40:60] == 100).all()


def test_a_courtyard_of_another_grey_is_unknown() -> None:
    image = np.full((300, 300), 180, np.uint8)
    image[20:280, 20:280] = 0
    image[24:276, 24:276] = 255
    image[96:204, 96:204] = 0
    image[98:202, 98:202] = 204
    grid = grid_from_image(image, 0.05)
    assert grid.cells[150, 150] == -1
    assert grid.cells[97, 150] == 100


def test_antialiased_edges_towards_the_unknown_are_no_walls() -> None:
    image = np.full((100, 100), 205, np.uint8)
    image[20:80, 20:80] = 254
    image[20:80, 19] = image[20:80, 80] = 222
    image[20, 20:80] = image[79, 20:80] = 0
    grid = grid_from_image(image, 0.05)
    assert (grid.cells[21:79, 19] == -1).all()
    assert (grid.cells[20, 20:80] == 100).all()


@pytest.mark.parametrize(("wall", "free"), [(0, 255), (127, 195), (127, 255), (0, 200)])
def test_two_level_maps_become_trinary(wall: int, free: int) -> None:
    image = np.full((200, 200), wall, np.uint8)
    image[60:140, 60:140] = free
    image[100, 60:130] = wall
    grid = grid_from_image(image, 0.05)
    assert grid.cells[10, 10] == -1
    assert (grid.cells[99, 60:130] == 100).all()
    assert grid.cells[58, 100] == 100
    assert grid.free.sum() == 80 * 80 - 70


def test_two_level_maps_without_a_mass_stay_as_they_are() -> None:
    image = np.full((60, 60), 255, np.uint8)
    image[[0, -1]] = image[:, [0, -1]] = 0
    grid = grid_from_image(image, 0.05)
    assert sorted(np.unique(grid.cells)) == [0, 100]


def test_uniform_images_have_an_answer() -> None:
    for level in (0, 127, 205, 255):
        grid = grid_from_image(np.full((50, 50), level, np.uint8), 0.05)
        assert grid.free.all() == (level == 255)


def test_given_thresholds_and_transparency_count() -> None:
    image = np.array([[100, 200]], np.uint8)
    assert grid_from_image(image, 0.1, free_threshold=150).free.tolist() == [[False, True]]
    hidden = np.array([[False, True]])
    assert grid_from_image(image, 0.1, free_threshold=150, transparent=hidden).free.tolist() == [
        [False, False]
    ]


UNKNOWN_SHARE = {
    "bormann/Freiburg52_scan": 0.253,
    "bormann/lab_ipa": 0.79,
    "bormann/office_c": 0.634,
    "bormann_furnished/office_a": 0.177,
    "bormann_furnished/Freiburg101_scan": 0.73,
    "cluttered/freiburg_building101": 0.52,
    "cluttered/intel_map": 0.596,
    "unlabelled/NOGT_intel_map": 0.34,
}


@pytest.mark.parametrize("name", UNKNOWN_SHARE)
def test_real_maps_with_known_unknown(data_dir: Path, name: str) -> None:
    grid = load_grid(data_dir / "gridmaps" / f"{name}.png")
    assert grid.unknown.mean() == pytest.approx(UNKNOWN_SHARE[name], abs=0.015)


@pytest.mark.parametrize(
    "folder", ["bormann", "bormann_furnished", "cluttered", "fr79_incremental", "unlabelled", "schools"]
)
def test_every_real_map_is_trinary(data_dir: Path, folder: str) -> None:
    paths = sorted(
        path for path in (data_dir / "gridmaps" / folder).glob("*.png") if not path.stem.endswith("_gt")
    )
    assert paths
    for path in paths[:: 1 if len(paths) <= 10 else 3]:
        grid = load_grid(path, resolution=0.05)
        grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        assert np.array_equal(grid.free, grey[::-1] > 230), path
        assert 0.002 < grid.occupied.mean() < 0.2, path
        assert grid.unknown.mean() > 0.15, path


def test_furniture_of_the_survey_maps_is_occupied(data_dir: Path) -> None:
    """Where a furnished map differs from the same map without furniture, it is occupied, not unknown."""
    paths = sorted((data_dir / "gridmaps" / "bormann_furnished").glob("*.png"))
    maps = [path for path in paths if not path.stem.endswith("_gt")]
    assert maps
    for path in maps:
        furnished, empty = load_grid(path), load_grid(data_dir / "gridmaps" / "bormann" / path.name)
        furniture = empty.free & ~furnished.free
        assert furnished.occupied[furniture].mean() > 0.8, path


@pytest.mark.parametrize("courtyard", [False, True])
def test_fine_scans_are_read_as_coarse_ones(courtyard: bool) -> None:
    image = np.full((60, 80), 205, np.uint8)
    image[4:56, 4:76] = 0
    image[6:54, 6:74] = 254
    if courtyard:
        image[10:50, 20:60] = 150
    coarse = grid_from_image(image, 0.3).cells
    fine = image.repeat(25, 0).repeat(25, 1)
    cells = grid_from_image(fine, 0.3 / 25).cells
    assert (cells == coarse.repeat(25, 0).repeat(25, 1)).mean() > 0.995


def test_a_folder_written_as_on_windows_is_found(tmp_path: Path) -> None:
    save_grid(OccupancyGrid(np.array([[0, 100]], np.int8), 0.1), tmp_path / "map.yaml")
    (tmp_path / "maps").mkdir()
    (tmp_path / "map.pgm").rename(tmp_path / "maps" / "map.pgm")
    text = (tmp_path / "map.yaml").read_text()
    (tmp_path / "map.yaml").write_text(text.replace("map.pgm", r"maps\map.pgm"))
    assert load_grid(tmp_path / "map.yaml").cells.tolist() == [[0, 100]]
    assert tmp_path / "maps" / "map.pgm" in images_of(tmp_path / "map.yaml")
    (tmp_path / "map.yaml").write_text(text.replace("map.pgm", r"..\map.pgm"))
    with pytest.raises(MapError, match="another folder"):
        load_grid(tmp_path / "map.yaml")
